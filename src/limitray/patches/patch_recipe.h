// Stage: patches (S0). What is left of a refined group of faces once OpenSubdiv has done its work:
// plain tables that turn the positions of the control points into patches. Made once a topology,
// run for each set of positions (each frame of an animation).
//
// A group has a list of points: the control points it uses, then the points computed from earlier
// ones by stencils (refined vertices level by level, Gregory points last). Patches index that list.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "limitray/math/vec.h"
#include "limitray/patches/patch_buffer.h"
#include "limitray/patches/single_crease.h"

namespace limitray {

/// Points as weighted sums of earlier points. Most stencils share their weights with many others
/// (all regular vertices have the same), so the weights are kept once and named by number.
class StencilList {
 public:
  /// Appends a point; sources and weights are of equal length, zero weights are dropped.
  void add(std::span<const std::int32_t> sources, std::span<const double> weights);
  /// Appends the points to `points`, which holds all sources so far.
  void apply(std::vector<Vec3d>& points) const;
  std::size_t size() const { return mask_of_point_.size(); }
  /// Frees what only `add` needs.
  void finish();

 private:
  std::uint32_t find_mask(std::span<const double> weights);

  std::vector<std::uint32_t> mask_of_point_;  // one a point
  std::vector<std::int32_t> sources_;         // of all points, one after the other
  std::vector<std::uint32_t> mask_begin_{0};  // into weights_; mask m ends where m+1 begins
  std::vector<double> weights_;
  std::unordered_multimap<std::uint64_t, std::uint32_t> masks_by_hash_;
};

inline constexpr std::uint16_t no_crease = 0xFFFF;

/// A regular patch: 16 B-spline points. `edges` are PatchEdge bits of the boundaries, or of the one
/// crease edge when `crease` is an index into PatchRecipe::creases.
struct RegularPatch {
  std::array<std::int32_t, 16> points;
  std::uint16_t edges = 0;
  std::uint16_t crease = no_crease;
};

/// The 20 points of a Gregory patch, in OpenSubdiv's order (see gregory_net.h).
using GregoryPatch = std::array<std::int32_t, 20>;

/// The tables of one group of faces. Its nets are those of `regular` in order (a crease patch gives
/// one a piece), then those of `gregory`; `infos` has one entry a net, bumps counted from 0.
struct PatchRecipe {
  std::vector<std::int32_t> control_points;  // into the cage's points
  StencilList stencils;
  std::vector<std::vector<CreasePiece>> creases;  // one a sharpness
  std::vector<RegularPatch> regular;
  std::vector<GregoryPatch> gregory;
  std::vector<PatchInfo> infos;

  /// Writes infos.size() nets and gregory.size() bumps, relative to `origin`, for the cage's
  /// `points`. Returns the largest |control value|.
  double make(std::span<const Vec3d> points, Vec3d origin, PatchNet<double>* nets,
              PatchBump<double>* bumps) const;
};

}  // namespace limitray

// Stage: patches (S0). What is left of a refined group of faces once OpenSubdiv has done its work:
// plain tables that turn the positions of the control points into patches. Made once a topology,
// run for each set of positions (each frame of an animation).
//
// A recipe has a list of points: the control points it uses, then those that its stencils compute.
// Its patches index that list.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "limitray/math/vec.h"
#include "limitray/patches/patch_buffer.h"
#include "limitray/patches/single_crease.h"
#include "limitray/patches/stencil_list.h"

namespace limitray {

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

  std::size_t bytes() const {
    return sizeof(std::int32_t) * control_points.size() + stencils.bytes() +
           sizeof(RegularPatch) * regular.size() + sizeof(GregoryPatch) * gregory.size() +
           sizeof(PatchInfo) * infos.size();
  }

  /// Writes infos.size() nets and gregory.size() bumps, relative to `origin`, for the cage's
  /// `points`. Returns the largest |control value|.
  double make(std::span<const Vec3d> points, Vec3d origin, PatchNet<double>* nets,
              PatchBump<double>* bumps) const;
};

/// All patches of a cage with control points `points`, in the order of the recipes.
PatchBuffer<double> run_recipes(std::span<const PatchRecipe> recipes, std::span<const Vec3d> points,
                                const std::function<void()>& stop);

}  // namespace limitray

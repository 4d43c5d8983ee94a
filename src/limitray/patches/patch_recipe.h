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

inline constexpr std::uint32_t no_piece = (1u << 28) - 1;

/// A regular patch: 16 B-spline points. `edges` are PatchEdge bits of the boundaries, or of the one
/// crease edge when `piece` is an index into PatchRecipe::pieces: then it is that piece of a patch.
struct RegularPatch {
  std::array<std::int32_t, 16> points;
  std::uint32_t edges : 4, piece : 28;
};

/// The 20 points of a Gregory patch, in OpenSubdiv's order (see gregory_net.h).
using GregoryPatch = std::array<std::int32_t, 20>;

/// The tables of one group of faces. Its nets are those of `regular` in order, then those of
/// `gregory`; `infos` has one entry a net, bumps counted from 0.
struct PatchRecipe {
  std::vector<std::int32_t> control_points;  // into the cage's points
  StencilList stencils;
  std::vector<CreasePiece> pieces;  // of all sharpnesses
  std::vector<RegularPatch> regular;
  std::vector<GregoryPatch> gregory;
  std::vector<PatchInfo> infos;

  std::size_t size() const { return infos.size(); }
  std::size_t point_count() const { return control_points.size() + stencils.size(); }
  std::size_t bytes() const {
    return sizeof(std::int32_t) * control_points.size() + stencils.bytes() +
           sizeof(RegularPatch) * regular.size() + sizeof(GregoryPatch) * gregory.size() +
           sizeof(PatchInfo) * infos.size();
  }

  /// Writes point_count() points relative to `origin`, for the cage's `points`.
  void make_points(std::span<const Vec3d> cage_points, Vec3d origin, Point4* points) const;

  /// Sorts the regular and the Gregory patches each by `place` (one value a net), which is sorted
  /// along: what is written there then goes to memory in order.
  void sort_patches(std::span<std::uint32_t> place);
};

/// Some patches of a recipe whose points are made: what becomes nets in one go (write_nets.h).
struct PatchBlock {
  const PatchRecipe* recipe;
  const Point4* points;
  std::size_t begin, end;  // nets of the recipe
  std::size_t first_net;   // of the recipe, among those of all recipes
};

/// Writes a block's patches; returns the largest |control value|. Called from several threads.
using BlockWriter = std::function<double(const PatchBlock&)>;

/// Centre of the box around the points that the recipes use: a stray point elsewhere costs no
/// precision.
Vec3d centre(std::span<const PatchRecipe> recipes, std::span<const Vec3d> points);

/// Where patches lie on the cage, in the order of the recipes.
std::vector<PatchInfo> infos_of(std::span<const PatchRecipe> recipes);

/// Has all patches of a cage with control points `points` written, relative to `origin`. Returns
/// the largest |control value|. All memory is allocated before the first call of `write`.
double run_recipes(std::span<const PatchRecipe> recipes, std::span<const Vec3d> points,
                   Vec3d origin, const BlockWriter& write, const std::function<void()>& stop);

}  // namespace limitray

// Stage: patches (S0). Comes in: a validated control cage. Goes out: a PatchBuffer in double.
//
// refine.cpp is the only file that includes OpenSubdiv. Feature-adaptive refinement after
// Niessner et al. 2012, "Feature-Adaptive GPU Rendering of Catmull-Clark Subdivision Surfaces";
// semi-sharp creases as exact Bezier pieces (same paper, section 5).
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "limitray/cage/cage.h"
#include "limitray/patches/patch_buffer.h"
#include "limitray/patches/patch_recipe.h"

namespace limitray {

struct RefineOptions {
  /// 1..10: how deep smooth irregular features are isolated; there the surface is Gregory patches,
  /// near the limit surface (tests/cpp/patches_limit_test.cpp says how near at each level).
  /// Everywhere else it is exact: semi-sharp features are followed until they have decayed, to
  /// level ceil(sharpness) if that is deeper. A cage that has any is isolated to level 2 at least,
  /// and with Chaikin's rule its smooth features go as deep as its creases.
  int isolation_level = 4;
  /// Bytes that all patches may need while a mesh is made; 0: what the machine has free.
  std::size_t memory_limit = 0;
  /// Called often during refinement, from any of its threads; an exception ends it.
  std::function<void()> stop = nullptr;
};

/// Where the values of patches are relative to, and the largest of them.
struct PatchExtent {
  Vec3d origin;
  double radius;
};

/// The topology of a cage, refined once; makes patches for any positions of its points. Patches
/// that meet agree in double to 1e-14 of the cage's size, but for OpenSubdiv's Gregory patches at
/// an inner vertex of two faces where one infinitely sharp crease ends: these leave a gap.
class Refiner {
 public:
  /// Refines the topology. Throws std::invalid_argument if the cage cannot be refined, OutOfMemory
  /// (memory.h) as soon as it is clear that the patches, and the tree over them, won't fit.
  Refiner(const ControlCage& cage, const RefineOptions& options);
  /// The same for a face-varying primvar of `cage`: OpenSubdiv's face-varying patches under the
  /// cage's linear interpolation rule (any but `all`, whose surface is bilinear). Its "points" are
  /// the rows of the primvar's values, three components at a time.
  Refiner(const ControlCage& cage, const Primvar& face_varying, const RefineOptions& options);
  ~Refiner();
  Refiner(Refiner&&) noexcept;
  Refiner& operator=(Refiner&&) noexcept;

  /// Patches of the surface for control points `points` (as many as the cage or the primvar has).
  /// Patch order is the same at each call.
  PatchBuffer<double> make_patches(std::span<const Vec3d> points) const;

  /// The same in steps: first the patches without values, but with their infos; then `write` is
  /// called for blocks of them, which together are all. `stop` as in RefineOptions.
  template <class T>
  PatchBuffer<T> unwritten_patches() const;
  PatchExtent write_patches(std::span<const Vec3d> points, const BlockWriter& write,
                            const std::function<void()>& stop = nullptr) const;
  /// Changes the order of patches so that those written one after the other have growing `place`
  /// (one a patch), which is reordered along.
  void sort_patches(std::span<std::uint32_t> place);

 private:
  struct Topology;
  std::unique_ptr<Topology> topology_;
};

/// `infos` in the order of a tree's leaves: info i of the result is order[i] of the input, and
/// bumps are counted in the new order.
std::vector<PatchInfo> in_order(std::span<const PatchInfo> infos,
                                std::span<const std::uint32_t> order);

/// `patches` rounded once to T, each patch moved to its place in `order` (patch i of the result is
/// order[i] of the input; empty: same order).
template <class T>
PatchBuffer<T> round_patches(const PatchBuffer<double>& patches,
                             std::span<const std::uint32_t> order = {});

}  // namespace limitray

// Stage: scene, inside. One mesh of a scene: its cage, patches and tree, and how the kernels see
// it.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "limitray/bvh/bounds.h"
#include "limitray/cage/cage.h"
#include "limitray/intersect/kernels.h"
#include "limitray/limits.h"
#include "limitray/patches/gregory_error.h"
#include "limitray/patches/primvar_surface.h"
#include "limitray/patches/refine.h"

namespace limitray {

/// Hulls of patches, in their order.
using Hulls = std::unique_ptr<PatchHull<float>[]>;

/// Patches for the tracer in the refiner's order, without values.
PatchBuffer<float> unwritten_patches(const Refiner& refiner);

/// Writes the values for `points` into `patches`: those of patch i to place[i] (empty: the same
/// order). All memory is allocated before the first is written.
Hulls write_patches(const Refiner& refiner, std::span<const Vec3d> points,
                    std::span<const std::uint32_t> place, PatchBuffer<float>& patches,
                    const std::function<void()>& stop = nullptr);

/// The hulls of `patches`, padded.
std::vector<Box> boxes_of(const Hulls& hulls, const PatchBuffer<float>& patches);

/// One mesh: its cage, its patches in the order of the tree's leaves, its tree.
struct Geometry {
  ControlCage cage;
  RefineOptions options;
  Refiner refiner;
  PatchBuffer<float> patches;
  std::vector<std::uint32_t> leaf_of;  // where the refiner's patch i is in `patches`
  Bvh bvh;
  double build_seconds = 0;

  // The double path's patches, made when first asked for.
  mutable std::mutex mutex;
  mutable PatchBuffer<double> patches_double;
  // So are its primvars.
  mutable std::map<std::string, std::unique_ptr<PrimvarSurface>> primvars;

  mutable std::optional<double> error_of_limit;  // estimated when first asked for

  Geometry(ControlCage c, const RefineOptions& o)
      : cage(std::move(c)), options(o), refiner(cage, options) {
    options.stop = nullptr;  // it was for this call
  }

  /// See MeshStatistics.
  double limit_error() const {
    const std::lock_guard lock(mutex);
    if (!error_of_limit) error_of_limit = gregory_error(cage, options.isolation_level);
    return *error_of_limit;
  }

  /// Makes patches and tree. `cancelled` as in build_bvh; where it is true `stop` throws.
  void build(const std::function<void()>& stop, const std::function<bool()>& cancelled);
  /// New values for `points`, in place; `cage.points` stay. Throws std::bad_alloc before anything
  /// is changed.
  void move_patches(std::span<const Vec3d> points);

  const PatchBuffer<double>& in_double() const;

  /// Null if the cage has no such primvar.
  const Primvar* find_primvar(const std::string& name) const {
    const auto it = std::find_if(cage.primvars.begin(), cage.primvars.end(),
                                 [&](const Primvar& p) { return p.name == name; });
    return it == cage.primvars.end() ? nullptr : &*it;
  }
  /// The same as a surface, made at the first call.
  const PrimvarSurface* surface_of(const std::string& name) const {
    const Primvar* primvar = find_primvar(name);
    if (!primvar) return nullptr;
    const std::lock_guard lock(mutex);
    std::unique_ptr<PrimvarSurface>& surface = primvars[name];
    if (!surface) surface = std::make_unique<PrimvarSurface>(cage, *primvar, refiner, options);
    return surface.get();
  }
};

/// Lower and upper corner of the box around a tree under `to_world`; inverted for an empty one.
inline std::array<Vec3d, 2> placed_bounds(const PatchBuffer<float>& patches, const Bvh& bvh,
                                          const Affine& to_world) {
  const double inf = std::numeric_limits<double>::infinity();
  std::array<Vec3d, 2> b{Vec3d{inf, inf, inf}, Vec3d{-inf, -inf, -inf}};
  if (bvh.nodes.empty()) return b;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d p = patches.origin;
    for (int i = 0; i < 3; ++i)
      p[i] += double(corner >> i & 1 ? bvh.bounds.hi[i] : bvh.bounds.lo[i]);
    p = to_world.point(p);
    for (int i = 0; i < 3; ++i) {
      b[0][i] = std::min(b[0][i], p[i]);
      b[1][i] = std::max(b[1][i], p[i]);
    }
  }
  return b;
}
inline std::array<Vec3d, 2> placed_bounds(const Geometry& g, const Affine& to_world) {
  return placed_bounds(g.patches, g.bvh, to_world);
}

/// The extent of a tree and of the control values of its patches.
inline Extent extent_of(const Box& bounds, const Vec3d& center, double radius) {
  Extent e{center, {}, radius};
  for (int i = 0; i < 3; ++i) {
    e.half[i] = std::max(double(-bounds.lo[i]), double(bounds.hi[i])) + 1e-7 * radius;
    e.radius = std::max(e.radius, e.half[i]);
  }
  return e;
}

template <class T>
GeometryView<T> view_of(const Geometry& g, const PatchBuffer<T>& p) {
  return {p.nets.data(),
          p.bumps.data(),
          p.infos.data(),
          p.models.data(),
          g.bvh.order.data(),
          g.bvh.nodes.empty() ? nullptr : g.bvh.nodes.data(),
          extent_of(g.bvh.bounds, p.origin, g.patches.radius),
          g.cage.orientation == Orientation::left_handed};
}

}  // namespace limitray

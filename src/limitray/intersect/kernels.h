// Stage: intersection. The functions that exist once for each instruction set, as a table.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/bvh/builder.h"
#include "limitray/bvh/trace_patches.h"
#include "limitray/intersect/ray_order.h"
#include "limitray/patches/patch_buffer.h"
#include "limitray/scene.h"

namespace limitray {

/// What the kernels read of one mesh. Patches are stored in the order of the tree's leaves.
template <class T>
struct GeometryView {
  const PatchNet<T>* nets;
  const PatchBump<T>* bumps;
  const PatchInfo* infos;
  const PatchModel<T>* models;
  const std::uint32_t* patch_ids;  // leaf -> patch id as the refiner numbered it
  const BvhNode* nodes;            // null for an empty surface
  Extent extent;                   // of the tree, about PatchBuffer::origin
  bool left_handed;
};
/// Null for a Bezier patch.
template <class T>
const PatchBump<T>* bump_of(const GeometryView<T>& g, std::uint32_t leaf) {
  const std::uint32_t b = g.infos[leaf].bump;
  return b == no_bump ? nullptr : g.bumps + b;
}
/// One placement of a mesh.
struct InstanceView {
  std::uint32_t geometry;
  bool identity;
  Affine to_object, to_world;
};
template <class T>
struct SceneView {
  std::span<const GeometryView<T>> geometries;
  std::span<const InstanceView> instances;
  const BvhNode* nodes;  // over instances; null for none
  Extent extent;         // of the boxes in `nodes`
  bool use_newton;
};

/// Most rays in one call, fewer than 2^24. More share more nodes, until they outgrow the caches.
inline constexpr int max_rays_a_call = 16384;

/// One intersection among all along a ray.
struct Intersection {
  double t, t_error, u, v;
  Vec3d normal;
  bool front;
  std::uint32_t geometry_id, primitive_id, sub_quad;
};

/// Where a ray met one patch: (u,v) in the base face or its sub-quad, unit normal.
struct PatchHit {
  double t;
  float u, v;
  Vec3f normal;
};

struct Kernels {
  const char* name;
  /// Returns the largest |control value|.
  double (*write_patches)(const PatchBlock&, const TracePlaces&);
  PatchModel<double> (*patch_model_d)(const PatchNet<double>&, const PatchBump<double>*);
  /// Two values behind the last ray of a batch must be readable.
  void (*closest_f)(const SceneView<float>&, const RayBatch<float>&, RayRange,
                    const HitArrays<float>&, Statistics&);
  void (*closest_d)(const SceneView<double>&, const RayBatch<double>&, RayRange,
                    const HitArrays<double>&, Statistics&);
  void (*occluded_f)(const SceneView<float>&, const RayBatch<float>&, RayRange, std::uint8_t*,
                     Statistics&);
  void (*occluded_d)(const SceneView<double>&, const RayBatch<double>&, RayRange, std::uint8_t*,
                     Statistics&);
  /// All intersections of ray `i`, in no order, duplicates at shared borders included.
  void (*all_d)(const SceneView<double>&, const RayBatch<double>&, std::size_t i,
                std::vector<Intersection>&, Statistics&);
  /// For callers with a tree of their own: the nearest hit of a ray with one patch, and whether
  /// there is one. The ray is in the space of the mesh.
  bool (*closest_patch)(const GeometryView<float>&, std::uint32_t patch, const ObjectRay&,
                        PatchHit&);
  bool (*occluded_patch)(const GeometryView<float>&, std::uint32_t patch, const ObjectRay&);
};

/// The table for this machine: the widest instruction set it has, or the one that the environment
/// variable LIMITRAY_ISA names (avx512, avx2, portable). Throws std::runtime_error if the variable
/// names none, or one that the machine lacks.
const Kernels& kernels();

// One a translation unit, kernels_<isa>.cpp.
const Kernels& kernels_portable();
const Kernels& kernels_avx2();
const Kernels& kernels_avx512();

}  // namespace limitray

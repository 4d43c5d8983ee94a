// Stage: BVH. An 8-wide tree of boxes in one flat array, root first, children after their parents;
// the same array serves CPU and GPU. Leaves hold one item each.
//
// Boxes are conservative by construction (bvh/bounds.h): each is padded by more than all rounding
// of the slab test for rays as made by make_patch_ray, so the test below compares without a
// tolerance.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>
#include <utility>

#include "limitray/intersect/ray.h"

namespace limitray {

/// Axis-aligned box; empty as made.
struct Box {
  float lo[3] = {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
                 std::numeric_limits<float>::infinity()};
  float hi[3] = {-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
                 -std::numeric_limits<float>::infinity()};

  void add(const Box& b) {
    for (int i = 0; i < 3; ++i) {
      lo[i] = b.lo[i] < lo[i] ? b.lo[i] : lo[i];
      hi[i] = b.hi[i] > hi[i] ? b.hi[i] : hi[i];
    }
  }
};

/// No ray meets it: its near plane is farther than any ray's far end.
inline constexpr Box beyond_all{
    {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
     std::numeric_limits<float>::infinity()},
    {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
     std::numeric_limits<float>::infinity()}};

inline constexpr int bvh_width = 8;
inline constexpr int bvh_max_depth = 40;
inline constexpr std::uint32_t leaf_flag = 0x80000000u;

/// Child i: box [lo[axis][i], hi[axis][i]], an item (child & ~leaf_flag) if leaf_flag is set, else
/// a node. An absent child has the box `beyond_all`.
struct alignas(32) BvhNode {
  float lo[3][bvh_width], hi[3][bvh_width];
  std::uint32_t child[bvh_width];
};
static_assert(sizeof(BvhNode) == 224);

inline namespace LIMITRAY_ISA {

/// A ray for the slab test, in the units of PatchRay's z.
struct BoxRay {
  float org[3], inv[3];
};

/// `r` must come from make_patch_ray for the space that the boxes live in.
template <class T>
BoxRay make_box_ray(const PatchRay<T>& r) {
  // A zero component must not make 0 * inf: its planes are then at +-huge, or at 0 on the border,
  // which is padding only.
  const float huge = std::numeric_limits<float>::max();
  const Quad<float> dir{float(r.dir[0]), float(r.dir[1]), float(r.dir[2]), 1};
  const Quad<float> inverse = min(max(1 / dir, Quad<float>{} - huge), Quad<float>{} + huge);
  return {{float(r.org[0]), float(r.org[1]), float(r.org[2])},
          {inverse[0], inverse[1], inverse[2]}};
}
/// The same for all children of a node at once.
struct BoxRays {
  Simd<float, 8> org[3], inv[3];

  explicit BoxRays(const BoxRay& r) {
    for (int i = 0; i < 3; ++i)
      org[i] = Simd<float, 8>{} + r.org[i], inv[i] = Simd<float, 8>{} + r.inv[i];
  }
};

inline Simd<float, 8> load8(const float* p) {
  Simd<float, 8> v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
/// One bit a child that the ray may meet between zmin and zmax; `entry` gets where it enters.
inline unsigned intersect_boxes(const BvhNode& n, const BoxRays& r, float zmin, float zmax,
                                Simd<float, 8>& entry) {
  using V = Simd<float, 8>;
  V lo[3], hi[3];
  for (int i = 0; i < 3; ++i) {
    const V a = (load8(n.lo[i]) - r.org[i]) * r.inv[i], b = (load8(n.hi[i]) - r.org[i]) * r.inv[i];
    lo[i] = min(a, b), hi[i] = max(a, b);
  }
  const V near = max(max(lo[0], lo[1]), max(lo[2], V(V{} + zmin)));
  const V far = min(min(hi[0], hi[1]), min(hi[2], V(V{} + zmax)));
  entry = near;
#if defined(LIMITRAY_AVX512)
  return _mm256_cmp_ps_mask(__m256(near), __m256(far), _CMP_LE_OQ);
#elif defined(LIMITRAY_AVX2)
  return unsigned(_mm256_movemask_ps(_mm256_cmp_ps(__m256(near), __m256(far), _CMP_LE_OQ)));
#else
  const auto mask = near <= far;
  unsigned bits = 0;
  for (int i = 0; i < 8; ++i) bits |= unsigned(mask[i] != 0) << i;
  return bits;
#endif
}

/// A child left to visit, and where the ray enters its box.
struct BvhEntry {
  std::uint32_t child;
  float z;
};

/// Pushes the children in `hits`, the farthest first, but keeps the nearest: it is returned.
inline std::uint32_t push_farther(const BvhNode& node, unsigned hits, const Simd<float, 8>& entry,
                                  BvhEntry* stack, int& size) {
  const int first = std::countr_zero(hits);
  hits &= hits - 1;
  if (!hits) return node.child[first];  // most often
  BvhEntry nearest{node.child[first], entry[first]};
  const int base = size;
  do {
    const int i = std::countr_zero(hits);
    hits &= hits - 1;
    BvhEntry e{node.child[i], entry[i]};
    if (e.z < nearest.z) std::swap(e, nearest);
    int k = size++;
    for (; k > base && stack[k - 1].z < e.z; --k) stack[k] = stack[k - 1];
    stack[k] = e;
  } while (hits);
  return nearest.child;
}

/// A walk of one ray through a tree: what is left to visit.
struct BvhWalk {
  int size;
  BvhEntry stack[bvh_max_depth * (bvh_width - 1) + 1];

  void begin() { size = 1, stack[0] = {0, -std::numeric_limits<float>::infinity()}; }
  void end() { size = 0; }
};
/// What next_item returns at the end.
inline constexpr std::uint32_t no_item = leaf_flag;

/// The next item whose box the ray meets, nearer boxes first. `zmax` is the far end as it stands;
/// prefetch(child) is called early for what is likely next. Counts nodes.
template <class Prefetch>
[[gnu::always_inline]] inline std::uint32_t next_item(const BvhNode* nodes, const BoxRay& ray,
                                                      float zmin, float zmax, BvhWalk& walk,
                                                      Prefetch&& prefetch,
                                                      std::uint64_t& node_visits) {
  const BoxRays rays(ray);
  int size = walk.size;
  while (size > 0) {
    const BvhEntry e = walk.stack[--size];
    if (e.z > zmax) continue;
    std::uint32_t current = e.child;
    while (!(current & leaf_flag)) {
      ++node_visits;
      const BvhNode& node = nodes[current];
      Simd<float, 8> entry;
      const unsigned hits = intersect_boxes(node, rays, zmin, zmax, entry);
      if (!hits) break;
      prefetch(node.child[std::countr_zero(hits)]);
      current = push_farther(node, hits, entry, walk.stack, size);
    }
    if (current & leaf_flag) {
      walk.size = size;
      if (size > 0) prefetch(walk.stack[size - 1].child);  // what comes after the item
      return current & ~leaf_flag;
    }
  }
  walk.size = 0;
  return no_item;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

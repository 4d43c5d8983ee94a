// Stage: BVH. An 8-wide tree of boxes in one flat array, root first, children after their parents;
// the same array serves CPU and GPU. Leaves hold one item each.
//
// Boxes are conservative by construction (bvh/bounds.h): each is padded by more than all rounding of
// the slab test for rays as made by make_patch_ray, so the test below compares without a tolerance.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

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

inline constexpr int bvh_width = 8;
inline constexpr int bvh_max_depth = 40;
inline constexpr std::uint32_t leaf_flag = 0x80000000u;

/// Child i: box [lo[axis][i], hi[axis][i]], an item (child & ~leaf_flag) if leaf_flag is set, else a
/// node. An absent child has an empty box, which no ray meets.
struct alignas(32) BvhNode {
  float lo[3][bvh_width], hi[3][bvh_width];
  std::uint32_t child[bvh_width];
};
static_assert(sizeof(BvhNode) == 224);

inline namespace LIMITRAY_ISA {

/// A ray for the slab test, in the units of PatchRay's z.
struct BoxRay {
  Simd<float, 8> org[3], inv[3];
  bool backward[3];  // direction component is negative: the near plane is hi
};

/// `r` must come from make_patch_ray for the space that the boxes live in.
template <class T>
BoxRay make_box_ray(const PatchRay<T>& r) {
  // A zero component must not make 0 * inf: its planes are then at +-huge, or at 0 on the border,
  // which is padding only.
  const float huge = std::numeric_limits<float>::max();
  const Quad<float> dir{float(r.dir[0]), float(r.dir[1]), float(r.dir[2]), 1};
  const Quad<float> inverse = min(max(1 / dir, Quad<float>{} - huge), Quad<float>{} + huge);
  BoxRay b;
  for (int i = 0; i < 3; ++i) {
    b.org[i] = Simd<float, 8>{} + float(r.org[i]);
    b.inv[i] = Simd<float, 8>{} + inverse[i];
    b.backward[i] = inverse[i] < 0;
  }
  return b;
}

inline Simd<float, 8> load8(const float* p) {
  Simd<float, 8> v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
/// One bit a child that the ray may meet between zmin and zmax; `entry` gets where it enters.
inline unsigned intersect_boxes(const BvhNode& n, const BoxRay& r, float zmin, float zmax,
                                Simd<float, 8>& entry) {
  using V = Simd<float, 8>;
  V near = V{} + zmin, far = V{} + zmax;
  for (int i = 0; i < 3; ++i) {
    const V lo = load8(r.backward[i] ? n.hi[i] : n.lo[i]);
    const V hi = load8(r.backward[i] ? n.lo[i] : n.hi[i]);
    near = max(near, V((lo - r.org[i]) * r.inv[i]));
    far = min(far, V((hi - r.org[i]) * r.inv[i]));
  }
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

/// Visits the items whose boxes the ray meets, nearer boxes first. `zmax()` gives the far end as it
/// stands; leaf(item) returns true to end the walk. Counts nodes.
template <class Zmax, class Leaf>
void traverse(const BvhNode* nodes, const BoxRay& ray, float zmin, Zmax&& zmax, Leaf&& leaf,
              std::uint64_t& node_visits) {
  struct Entry {
    std::uint32_t child;
    float z;
  };
  Entry stack[bvh_max_depth * (bvh_width - 1) + 1];
  int size = 0;
  std::uint32_t current = 0;
  while (true) {
    if (current & leaf_flag) {
      if (leaf(current & ~leaf_flag)) return;
    } else {
      ++node_visits;
      const BvhNode& node = nodes[current];
      Simd<float, 8> entry;
      unsigned hits = intersect_boxes(node, ray, zmin, zmax(), entry);
      if (hits) {
        alignas(32) float z[8];
        std::memcpy(z, &entry, sizeof(z));
        // Push the children sorted, the nearest on top.
        const int base = size;
        do {
          const int i = std::countr_zero(hits);
          hits &= hits - 1;
          const Entry e{node.child[i], z[i]};
          int k = size++;
          for (; k > base && stack[k - 1].z < e.z; --k) stack[k] = stack[k - 1];
          stack[k] = e;
        } while (hits);
      }
    }
    do {
      if (size == 0) return;
      --size;
    } while (stack[size].z > zmax());
    current = stack[size].child;
  }
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: BVH. Many rays walk a tree together: each node is visited once, with the list of the rays
// that meet it.
//
// After Barringer and Akenine-Moeller 2014, "Dynamic Ray Stream Traversal". One ray alone waits: for
// the next node, and for the branch that hangs on it. Here the loop over a node's rays has no
// branch that depends on them, and the node is loaded once. Children are visited in an order that
// is the same for all rays of a walk (by their depth along a direction common to them), so what a
// ray meets, and when, does not depend on its neighbours.
#pragma once

#include <memory>

#include "limitray/bvh/bvh.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Lists may be written this far past their end.
inline constexpr int list_slack = 16;

/// Room for the lists of a walk of n rays: eight for each level of the tree. What is not used is
/// not touched.
constexpr std::size_t list_room(int n) {
  return std::size_t(bvh_max_depth + 1) * bvh_width * std::size_t(n + 2 * list_slack);
}

/// Which rays of `list` meet which children of a node: theirs are written to child + i * stride.
/// counts[i] gets how many.
inline void intersect_lists(const NodePlanes& node, const BoxRay* rays, const std::uint32_t* list,
                            int count, std::uint32_t* child, int stride,
                            int (&counts)[bvh_width]) {
  for (int& n : counts) n = 0;
  for (int begin = 0; begin < count; begin += 16) {
    alignas(16) std::uint8_t hits[16];
    const int here = std::min(16, count - begin);
    for (int k = 0; k < here; ++k) {
      const BoxRay& r = rays[list[begin + k]];
      Simd<float, 8> entry;
      hits[k] = std::uint8_t(intersect_boxes(node, r, r.zmax, entry));
    }
#if defined(LIMITRAY_AVX512)
    const __m128i all = _mm_load_si128(reinterpret_cast<const __m128i*>(hits));
    const __m512i ids = _mm512_loadu_si512(list + begin);
    const auto valid = __mmask16((1u << here) - 1);
    for (int i = 0; i < bvh_width; ++i) {
      const __mmask16 m = _mm_mask_test_epi8_mask(valid, all, _mm_set1_epi8(char(1 << i)));
      _mm512_storeu_si512(child + i * stride + counts[i], _mm512_maskz_compress_epi32(m, ids));
      counts[i] += std::popcount(unsigned(m));
    }
#else
    for (int k = 0; k < here; ++k)
      for (int i = 0; i < bvh_width; ++i) {
        child[i * stride + counts[i]] = list[begin + k];
        counts[i] += hits[k] >> i & 1;
      }
#endif
  }
}

/// Calls on_leaf(item, list, count) for the leaves that the `count` rays in `list` may meet; their
/// directions have the same signs. rays[id].zmax may fall meanwhile. `along` is the direction by
/// whose depth children are sorted; `room` holds list_room(count) ids.
template <class OnLeaf, class Prefetch>
void walk_lists(const BvhNode* nodes, const BoxRay* rays, unsigned signs, const float (&along)[3],
                const std::uint32_t* list, int count, std::uint32_t* room, OnLeaf&& on_leaf,
                Prefetch&& prefetch, std::uint64_t& node_visits) {
  // The lists of a node's children follow those of its siblings.
  struct Entry {
    const std::uint32_t* list;
    std::uint32_t* room;
    std::uint32_t child;
    int count;
  };
  Entry stack[bvh_max_depth * (bvh_width - 1) + 1];
  int size = 1;
  stack[0] = {list, room, 0, count};
  while (size > 0) {
    const Entry e = stack[--size];
    if (e.child & leaf_flag) {
      on_leaf(e.child & ~leaf_flag, e.list, e.count);
      continue;
    }
    node_visits += std::uint64_t(e.count);
    const BvhNode& node = nodes[e.child];
    const int stride = (e.count + list_slack + 7) & ~7;
    int counts[bvh_width];
    intersect_lists(NodePlanes(node, signs), rays, e.list, e.count, e.room, stride, counts);
    Simd<float, 8> depth{};
    for (int i = 0; i < 3; ++i) depth += along[i] * (load_eight(node.lo[i]) + load_eight(node.hi[i]));
    // The farthest first.
    const int base = size;
    float depths[bvh_width];
    for (int i = 0; i < bvh_width; ++i) {
      if (!counts[i]) continue;
      prefetch(node.child[i]);
      int k = size++;
      for (; k > base && depths[k - 1 - base] < depth[i]; --k)
        stack[k] = stack[k - 1], depths[k - base] = depths[k - 1 - base];
      stack[k] = {e.room + i * stride, e.room + bvh_width * stride, node.child[i], counts[i]};
      depths[k - base] = depth[i];
    }
  }
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

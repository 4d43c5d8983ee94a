// Stage: BVH. Many rays walk a tree together: each node is visited once, with the list of the rays
// that meet it.
//
// After Barringer and Akenine-Moeller 2014, "Dynamic Ray Stream Traversal". One ray alone waits:
// for the next node, and for the branch that hangs on it. Here the loop over a node's rays has no
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

/// Rays that meet children of a node: those of child i are list[i * stride], ...
struct ChildLists {
  std::uint32_t* list;
  int stride;
  int counts[bvh_width];
};

/// Which rays of `list` meet which children of a node. Returns one bit a child that is met.
inline unsigned intersect_lists(const NodePlanes& node, const BoxRay* rays,
                                const std::uint32_t* list, int count, ChildLists& to) {
  for (int& n : to.counts) n = 0;
  std::uint64_t met = 0;
  for (int begin = 0; begin < count; begin += list_slack) {
    // A byte a ray. In registers: bytes written one by one are slow to read back as a vector.
    const int here = std::min(list_slack, count - begin);
    const auto hits_of = [&](const std::uint32_t* ids, int n) {
      std::uint64_t bytes = 0;
      for (int k = 0; k < n; ++k) {
        const BoxRay& r = rays[ids[k]];
        ChildValues entry;
        bytes |= std::uint64_t(intersect_boxes(node, r, r.zmax, entry)) << (8 * k);
      }
      return bytes;
    };
    const std::uint64_t hits[2] = {hits_of(list + begin, std::min(here, 8)),
                                   hits_of(list + begin + 8, here - 8)};
    met |= hits[0] | hits[1];
#if defined(LIMITRAY_AVX512)
    const __m128i all = _mm_set_epi64x(std::int64_t(hits[1]), std::int64_t(hits[0]));
    const __m512i ids = _mm512_loadu_si512(list + begin);
    const auto valid = __mmask16((1u << here) - 1);
    for (int i = 0; i < bvh_width; ++i) {
      const __mmask16 m = _mm_mask_test_epi8_mask(valid, all, _mm_set1_epi8(char(1 << i)));
      _mm512_storeu_si512(to.list + i * to.stride + to.counts[i],
                          _mm512_maskz_compress_epi32(m, ids));
      to.counts[i] += std::popcount(unsigned(m));
    }
#else
    for (int k = 0; k < here; ++k)
      for (int i = 0; i < bvh_width; ++i) {
        to.list[i * to.stride + to.counts[i]] = list[begin + k];
        to.counts[i] += int(hits[k >> 3] >> (8 * (k & 7) + i) & 1);
      }
#endif
  }
  met |= met >> 32, met |= met >> 16, met |= met >> 8;
  return unsigned(met) & 0xFFu;
}

/// How many of the children in `met`, at least one, are farther along a direction than each, by
/// their middles. Where two are equally far, the order is that of the node.
struct ChildRanks {
  std::uint8_t farther[bvh_width];

  ChildRanks(const BvhNode& node, unsigned met, const float (&along)[3]) {
    if ((met & (met - 1)) == 0) {
      farther[std::countr_zero(met)] = 0;
      return;
    }
    using V = ChildValues::Part;
    using Bits = Simd<std::uint32_t, ChildValues::lanes>;
    constexpr std::uint32_t numbers[bvh_width] = {0, 1, 2, 3, 4, 5, 6, 7};
    ChildValues depth;
    for (int k = 0; k < ChildValues::parts; ++k) {
      V sum{};
      for (int i = 0; i < 3; ++i)
        sum += along[i] * (ChildValues(node.lo[i]).part[k] + ChildValues(node.hi[i]).part[k]);
      // The last bits tell equal ones apart.
      Bits last_bits;
      std::memcpy(&last_bits, numbers + k * ChildValues::lanes, sizeof(last_bits));
      depth.part[k] = V((Bits(sum) & ~7u) | last_bits);
    }
    float each[bvh_width];
    depth.store(each);
    for (int i = 0; i < bvh_width; ++i) {
      unsigned greater = 0;
      for (int k = 0; k < ChildValues::parts; ++k)
        greater |= bits_of(depth.part[k] > each[i]) << (k * ChildValues::lanes);
      farther[i] = std::uint8_t(std::popcount(met & greater));
    }
  }
};

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
  // Pushes children, the nearest last: entry(i) for child i.
  const auto push = [&](const BvhNode& node, unsigned met, auto&& entry) {
    const ChildRanks ranks(node, met, along);
    for (unsigned left = met; left; left &= left - 1) {
      const int i = std::countr_zero(left);
      prefetch(node.child[i]);
      stack[size + ranks.farther[i]] = entry(i);
    }
    size += std::popcount(met);
  };
  while (size > 0) {
    const Entry e = stack[--size];
    if (e.child & leaf_flag) {
      on_leaf(e.child & ~leaf_flag, e.list, e.count);
      continue;
    }
    node_visits += std::uint64_t(e.count);
    const BvhNode& node = nodes[e.child];
    const NodePlanes planes(node, signs);
    if (e.count == 1) {
      // Almost half of all lists in a mesh of many patches; it is that of its children, too.
      const BoxRay& ray = rays[e.list[0]];
      ChildValues entry;
      if (const unsigned met = intersect_boxes(planes, ray, ray.zmax, entry))
        push(node, met, [&](int i) { return Entry{e.list, e.room, node.child[i], 1}; });
      continue;
    }
    ChildLists lists{e.room, (e.count + list_slack + 7) & ~7, {}};
    std::uint32_t* next_room = e.room + bvh_width * lists.stride;
    if (const unsigned met = intersect_lists(planes, rays, e.list, e.count, lists))
      push(node, met, [&](int i) {
        return Entry{e.room + i * lists.stride, next_room, node.child[i], lists.counts[i]};
      });
  }
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

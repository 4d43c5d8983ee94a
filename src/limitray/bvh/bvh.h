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

/// A ray for the slab test, in the units of PatchRay's z: the plane at x is met at x inv - org_inv.
struct alignas(32) BoxRay {
  float inv[3], org_inv[3];
  float zmin, zmax;

  /// One bit an axis along which the ray goes down.
  unsigned signs() const { return (inv[0] < 0) | (inv[1] < 0) << 1 | (inv[2] < 0) << 2; }
};

/// Bound on |inv|: a direction that is (almost) zero along an axis must not make inf - inf. Planes
/// are at least the padding of 48 u R from what they bound, so that such a ray stays between them
/// over 1e6 R and more.
inline constexpr float most_inverse = 1e12f;

/// `r` must come from make_patch_ray for the space that the boxes live in.
template <class T>
BoxRay make_box_ray(const PatchRay<T>& r) {
  BoxRay b;
  for (int i = 0; i < 3; ++i) {
    b.inv[i] = std::min(std::max(1 / float(r.dir[i]), -most_inverse), most_inverse);
    b.org_inv[i] = float(r.org[i]) * b.inv[i];
  }
  b.zmin = -float_up(-r.zmin), b.zmax = float_up(r.zmax);
  return b;
}

/// One value for each child, in as many registers as it takes.
struct ChildValues {
  static constexpr int lanes = std::min(bvh_width, register_bytes / int(sizeof(float)));
  static constexpr int parts = bvh_width / lanes;
  using Part = Simd<float, lanes>;
  Part part[parts];

  ChildValues() = default;
  explicit ChildValues(const float (&values)[bvh_width]) {
    std::memcpy(part, values, sizeof(part));
  }
  void store(float (&values)[bvh_width]) const { std::memcpy(values, part, sizeof(part)); }
};

/// A node's planes in the order in which rays of the same signs meet them.
struct NodePlanes {
  ChildValues first[3], last[3];

  NodePlanes(const BvhNode& n, unsigned signs) {
    for (int i = 0; i < 3; ++i) {
      const bool down = signs >> i & 1;
      first[i] = ChildValues(down ? n.hi[i] : n.lo[i]);
      last[i] = ChildValues(down ? n.lo[i] : n.hi[i]);
    }
  }
};
/// One bit a child that the ray may meet before zmax; `entry` gets where it enters.
[[gnu::always_inline]] inline unsigned intersect_boxes(const NodePlanes& n, const BoxRay& r,
                                                       float zmax, ChildValues& entry) {
  using V = ChildValues::Part;
  const V none{};
  unsigned bits = 0;
  for (int k = 0; k < ChildValues::parts; ++k) {
    V in[3], out[3];
    for (int i = 0; i < 3; ++i) {
      in[i] = n.first[i].part[k] * r.inv[i] - (r.org_inv[i] - none);
      out[i] = n.last[i].part[k] * r.inv[i] - (r.org_inv[i] - none);
    }
    entry.part[k] = max(max(in[0], in[1]), max(in[2], V(r.zmin - none)));
    const V exit = min(min(out[0], out[1]), min(out[2], V(zmax - none)));
    bits |= bits_of(entry.part[k] <= exit) << (k * ChildValues::lanes);
  }
  return bits;
}

/// A child left to visit, and where the ray enters its box.
struct BvhEntry {
  std::uint32_t child;
  float z;
};

/// Pushes the children in `hits`, the farthest first, but keeps the nearest: it is returned.
inline std::uint32_t push_farther(const BvhNode& node, unsigned hits, const ChildValues& entries,
                                  BvhEntry* stack, int& size) {
  const int first = std::countr_zero(hits);
  hits &= hits - 1;
  if (!hits) return node.child[first];  // most often
  float entry[bvh_width];
  entries.store(entry);
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
                                                      float zmax, BvhWalk& walk,
                                                      Prefetch&& prefetch,
                                                      std::uint64_t& node_visits) {
  const unsigned signs = ray.signs();
  int size = walk.size;
  while (size > 0) {
    const BvhEntry e = walk.stack[--size];
    if (e.z > zmax) continue;
    std::uint32_t current = e.child;
    while (!(current & leaf_flag)) {
      ++node_visits;
      const BvhNode& node = nodes[current];
      ChildValues entry;
      const unsigned hits = intersect_boxes(NodePlanes(node, signs), ray, zmax, entry);
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

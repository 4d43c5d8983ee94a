// Stage: BVH. Comes in: boxes. Goes out: the flat tree of bvh.h. builder.cpp is the only file of
// the core that includes Embree (embree_geometry aside): its SAH builder makes the tree.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "limitray/bvh/bvh.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {

struct Bvh {
  std::vector<BvhNode> nodes;        // nodes[0] is the root; none for no items
  std::vector<std::uint32_t> order;  // leaf k of the tree holds item order[k]: leaves count upward
  Box bounds;

  std::size_t bytes() const { return nodes.size() * sizeof(BvhNode); }
};

/// Builds a tree over `boxes` (at most 2^31). Leaf k stands for item order[k], so that items stored
/// in that order are read in the order of the tree. Throws std::runtime_error if Embree fails.
/// `cancelled` is asked often, from any thread: once it is true the tree returned has no nodes.
Bvh build_bvh(std::span<const Box> boxes, const std::function<bool()>& cancelled = nullptr);

/// New boxes for the same tree, in leaf order: leaf k has hulls[k], padded (bvh/bounds.h).
void refit_bvh(Bvh& bvh, std::span<const PatchHull<float>> hulls, float padding);

}  // namespace limitray

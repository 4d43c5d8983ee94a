#include "limitray/bvh/builder.h"

#include "limitray/bvh/bounds.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <tbb/parallel_for.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace limitray {
namespace {

/// A node while Embree builds: a leaf has no children.
struct BuildNode {
  std::uint32_t item = 0;
  unsigned child_count = 0;
  BuildNode* child[bvh_width];
  RTCBounds bounds[bvh_width];
};

void* create_node(RTCThreadLocalAllocator allocator, unsigned count, void*) {
  auto* n = new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), 16)) BuildNode;
  n->child_count = count;
  return n;
}
void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count; ++i)
    static_cast<BuildNode*>(node)->child[i] = static_cast<BuildNode*>(children[i]);
}
void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  for (unsigned i = 0; i < count; ++i) static_cast<BuildNode*>(node)->bounds[i] = *bounds[i];
}
void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* items, std::size_t,
                  void*) {
  auto* n = new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), 16)) BuildNode;
  n->item = items[0].primID;
  return n;
}

/// Embree's builder goes on while this is true.
bool goes_on(void* cancelled, double) {
  return !(*static_cast<const std::function<bool()>*>(cancelled))();
}

Box to_box(const RTCBounds& b) {
  Box r;
  r.lo[0] = b.lower_x, r.lo[1] = b.lower_y, r.lo[2] = b.lower_z;
  r.hi[0] = b.upper_x, r.hi[1] = b.upper_y, r.hi[2] = b.upper_z;
  return r;
}

void set_child(BvhNode& node, int i, const Box& box, std::uint32_t child) {
  for (int axis = 0; axis < 3; ++axis) {
    node.lo[axis][i] = box.lo[axis];
    node.hi[axis][i] = box.hi[axis];
  }
  node.child[i] = child;
}
BvhNode empty_node() {
  BvhNode n;
  for (int i = 0; i < bvh_width; ++i) set_child(n, i, beyond_all, 0);
  return n;
}

/// Writes the tree below `from` depth first; node `index` is already there.
void flatten(const BuildNode& from, std::uint32_t index, int depth, Bvh& out) {
  if (depth >= bvh_max_depth) throw std::runtime_error("build_bvh: the tree is too deep");
  for (unsigned i = 0; i < from.child_count; ++i) {
    const BuildNode& child = *from.child[i];
    const bool leaf = child.child_count == 0;
    const auto id = std::uint32_t(leaf ? out.order.size() : out.nodes.size());
    set_child(out.nodes[index], int(i), to_box(from.bounds[i]), leaf ? id | leaf_flag : id);
    if (leaf) {
      out.order.push_back(child.item);
    } else {
      out.nodes.push_back(empty_node());
      flatten(child, id, depth + 1, out);
    }
  }
}

/// Embree's device is made once: it starts threads.
RTCDevice device() {
  static const std::unique_ptr<RTCDeviceTy, void (*)(RTCDevice)> d(rtcNewDevice(nullptr),
                                                                   rtcReleaseDevice);
  if (!d) throw std::runtime_error("build_bvh: Embree could not make a device");
  return d.get();
}

/// New boxes below a node, from the leaves up; what is below the first two levels in parallel.
struct Refit {
  BvhNode* nodes;
  const PatchHull<float>* hulls;
  float padding;

  Box child(BvhNode& node, int i, int depth) const {
    if (node.lo[0][i] == beyond_all.lo[0]) return {};  // absent
    const std::uint32_t child = node.child[i];
    const Box box = child & leaf_flag ? padded(hulls[child & ~leaf_flag], padding)
                                      : below(nodes[child], depth + 1);
    set_child(node, i, box, child);
    return box;
  }
  Box below(BvhNode& node, int depth) const {
    Box all;
    if (depth < 2) {
      Box boxes[bvh_width];
      tbb::parallel_for(0, bvh_width, [&](int i) { boxes[i] = child(node, i, depth); });
      for (const Box& box : boxes) all.add(box);
    } else {
      for (int i = 0; i < bvh_width; ++i) all.add(child(node, i, depth));
    }
    return all;
  }
};

}  // namespace

Bvh build_bvh(std::span<const Box> boxes, const std::function<bool()>& cancelled) {
  Bvh out;
  for (const Box& b : boxes) out.bounds.add(b);
  if (boxes.empty()) return out;
  out.nodes.push_back(empty_node());
  if (boxes.size() == 1) {
    set_child(out.nodes[0], 0, boxes[0], leaf_flag);
    out.order.push_back(0);
    return out;
  }

  std::vector<RTCBuildPrimitive> items(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const Box& b = boxes[i];
    items[i] = {b.lo[0], b.lo[1], b.lo[2], 0, b.hi[0], b.hi[1], b.hi[2], std::uint32_t(i)};
  }
  const std::unique_ptr<RTCBVHTy, void (*)(RTCBVH)> bvh(rtcNewBVH(device()), rtcReleaseBVH);
  RTCBuildArguments a = rtcDefaultBuildArguments();
  a.byteSize = sizeof(a);
  a.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
  a.maxBranchingFactor = bvh_width;
  a.maxDepth = bvh_max_depth - 8;  // Embree may go deeper where it splits large leaves
  a.minLeafSize = a.maxLeafSize = 1;
  a.bvh = bvh.get();
  a.primitives = items.data();
  a.primitiveCount = a.primitiveArrayCapacity = items.size();
  a.createNode = create_node;
  a.setNodeChildren = set_children;
  a.setNodeBounds = set_bounds;
  a.createLeaf = create_leaf;
  if (cancelled) {
    a.buildProgress = goes_on;
    a.userPtr = const_cast<std::function<bool()>*>(&cancelled);
  }
  const auto* root = static_cast<const BuildNode*>(rtcBuildBVH(&a));
  if (!root && cancelled && cancelled()) return {};
  if (!root)
    throw std::runtime_error("build_bvh: Embree failed with error " +
                             std::to_string(rtcGetDeviceError(device())));
  out.order.reserve(boxes.size());
  flatten(*root, 0, 0, out);
  return out;
}

void refit_bvh(Bvh& bvh, std::span<const PatchHull<float>> hulls, float padding) {
  if (bvh.nodes.empty()) return;
  bvh.bounds = Refit{bvh.nodes.data(), hulls.data(), padding}.below(bvh.nodes[0], 0);
}

}  // namespace limitray

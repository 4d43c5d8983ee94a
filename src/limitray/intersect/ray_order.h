// Stage: intersection. Comes in: a batch of rays. Goes out: the order in which they are traced:
// those that go the same way, from the same place, one after the other, so that they share nodes
// and patches (bvh/list_walk.h). It changes when a ray is traced, never what it meets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/intersect/ray.h"
#include "limitray/scene.h"

namespace limitray {

/// Most rays that are sorted together.
inline constexpr std::size_t max_ordered_rays = std::size_t(1) << 22;

/// Sorts rays by the signs of their directions, then by where in a grid over `extent` they begin.
class RayOrder {
 public:
  /// The more patches a scene has, the finer is the grid.
  RayOrder(const Extent& extent, std::size_t patches);

  /// The order of rays first..first+count of a batch (count at most max_ordered_rays), relative to
  /// `first`. Valid until the next call.
  template <class T>
  std::span<const std::uint32_t> sort(const RayBatch<T>& batch, std::size_t first,
                                      std::size_t count);

 private:
  template <class T>
  std::uint32_t key_of(const T* ray) const;

  int cell_bits_;
  float lowest_[3], cells_a_unit_[3];
  std::vector<std::uint16_t> keys_;
  std::vector<std::uint32_t> order_, places_;
};

}  // namespace limitray

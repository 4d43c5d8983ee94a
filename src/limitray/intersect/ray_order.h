// Stage: intersection. Comes in: a batch of rays. Goes out: the order in which they are traced:
// those that go the same way, from the same place, one after the other, so that they share nodes
// and patches (bvh/list_walk.h). It changes when a ray is traced, never what it meets.
//
// Rays are copied into that order and their hits are copied back from it. Both copies go along
// the batch: what it sorts into fills one place of each key after the other, so that lines of the
// cache are full when they leave it. Rays and hits left where they are would miss it one by one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/intersect/ray.h"
#include "limitray/scene.h"

namespace limitray {

/// Most rays that are sorted together. More share more, but take more room.
inline constexpr std::size_t max_sorted_rays = std::size_t(1) << 20;

/// Sorts rays by the signs of their directions and by where in a grid over an extent they begin.
class RayOrder {
 public:
  /// The more patches a scene has, and the more rays are sorted together, the finer is the grid.
  RayOrder(const Extent& extent, std::size_t patches, std::size_t rays);

  std::size_t key_count() const { return std::size_t(8) << 3 * cell_bits_; }
  /// Octant of the direction, then the cell of the origin in Morton order; the cell first in large
  /// meshes, where rays that begin together find more of it in the caches than rays of one octant.
  template <class T>
  void find_keys(const T* rays, std::size_t count, std::uint16_t* keys) const;

 private:
  int cell_bits_, octant_shift_, cell_shift_;
  float lowest_[3], cells_a_unit_[3];
};

/// Rays begin, begin + 1, ..., end - 1.
struct RayRange {
  std::size_t begin, end;

  std::size_t size() const { return end - begin; }
};

/// Some rays of a batch, sorted, and room for their hits. Made once, it takes one part of a batch
/// after the other.
template <class T>
class SortedRays {
 public:
  /// Takes rays first..first+count of a batch, at most max_sorted_rays.
  void sort(const RayOrder& order, const RayBatch<T>& batch, std::size_t first, std::size_t count);
  /// The rays in order; two more values may be read behind the last.
  RayBatch<T> batch() const { return {{rays_.data(), 6 * places_.size()}, tnear_, tfar_}; }
  /// Tells that only these rays were traced: no others are restored.
  void keep_only(std::span<const RayRange> traced);
  bool is_kept(std::size_t place) const { return kept_.empty() || kept_[place]; }
  /// Ray first + i of the batch is ray places()[i] here.
  std::span<const std::uint32_t> places() const { return places_; }

  /// Room for those answers about the sorted rays that `wanted` asks for.
  HitArrays<T> hits(const HitArrays<T>& wanted);
  /// Brings them back: ray i of the part that was taken last fills row first + i of `out`.
  void restore(const HitArrays<T>& out) const;
  /// The same for one answer a ray.
  std::uint8_t* occluded();
  void restore(std::uint8_t* out) const;

 private:
  template <class F>
  void for_each_slice(F&& f) const;
  template <std::size_t width, class U>
  void copy_rows(const U* rows, std::size_t begin, std::size_t end, U* out) const;

  std::size_t first_ = 0;
  std::vector<T> rays_, own_tnear_, own_tfar_;
  std::span<const T> tnear_, tfar_;
  std::vector<std::uint16_t> keys_;
  std::vector<std::uint32_t> places_, next_places_;
  std::vector<bool> kept_;    // empty for all
  std::vector<T> values_[7];  // as many columns as HitArrays has, for the wanted ones
  std::vector<std::uint32_t> ids_[4];
  std::vector<std::uint8_t> occluded_;
};

}  // namespace limitray

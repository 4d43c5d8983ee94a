// Stage: patches (S0). Points of a refinement as weighted sums of earlier points: refined vertices
// level by level, and the points of Gregory patches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "limitray/math/vec.h"

namespace limitray {

/// Points as weighted sums of earlier points. Most stencils share their weights with many others
/// (all regular vertices have the same), so the weights are kept once and named by number.
class StencilList {
 public:
  /// Appends a point; sources and weights are of equal length, zero weights are dropped.
  void add(std::span<const std::int32_t> sources, std::span<const double> weights);
  /// Writes points[first] and on; the `first` points before them are the first sources.
  void apply(Point4* points, std::size_t first) const;
  std::size_t size() const { return mask_of_point_.size(); }
  std::size_t bytes() const {
    return 4 * (mask_of_point_.size() + sources_.size() + mask_begin_.size()) +
           sizeof(double) * weights_.size();
  }
  /// Frees what only `add` needs.
  void finish();

 private:
  std::uint32_t find_mask(std::span<const double> weights);

  std::vector<std::uint32_t> mask_of_point_;  // one a point
  std::vector<std::int32_t> sources_;         // of all points, one after the other
  std::vector<std::uint32_t> mask_begin_{0};  // into weights_; mask m ends where m+1 begins
  std::vector<double> weights_;
  std::unordered_multimap<std::uint64_t, std::uint32_t> masks_by_hash_;
};

}  // namespace limitray

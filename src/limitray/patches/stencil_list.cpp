// Stage: patches (S0). See stencil_list.h.
#include "limitray/patches/stencil_list.h"

#include <algorithm>
#include <cstring>

namespace limitray {

void StencilList::add(std::span<const std::int32_t> sources, std::span<const double> weights) {
  double kept[1024];
  std::vector<double> many;
  double* mask = kept;
  if (weights.size() > std::size(kept)) {
    many.resize(weights.size());
    mask = many.data();
  }
  std::size_t size = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    mask[size++] = weights[i];
    sources_.push_back(sources[i]);
  }
  mask_of_point_.push_back(find_mask({mask, size}));
}

std::uint32_t StencilList::find_mask(std::span<const double> weights) {
  std::uint64_t hash = weights.size();
  for (double w : weights) {
    std::uint64_t bits;
    std::memcpy(&bits, &w, sizeof bits);
    hash = (hash ^ bits) * 0x9E3779B97F4A7C15ull;
    hash ^= hash >> 29;
  }
  const auto [begin, end] = masks_by_hash_.equal_range(hash);
  for (auto it = begin; it != end; ++it) {
    const std::uint32_t first = mask_begin_[it->second], last = mask_begin_[it->second + 1];
    if (std::equal(weights.begin(), weights.end(), weights_.begin() + first,
                   weights_.begin() + last))
      return it->second;
  }
  const auto mask = static_cast<std::uint32_t>(mask_begin_.size() - 1);
  weights_.insert(weights_.end(), weights.begin(), weights.end());
  mask_begin_.push_back(static_cast<std::uint32_t>(weights_.size()));
  masks_by_hash_.emplace(hash, mask);
  return mask;
}

void StencilList::finish() {
  masks_by_hash_.clear();
  masks_by_hash_.rehash(0);
  mask_of_point_.shrink_to_fit();
  sources_.shrink_to_fit();
  weights_.shrink_to_fit();
}

void StencilList::apply(std::vector<Vec3d>& points) const {
  const std::size_t first = points.size();
  points.resize(first + size());
  const std::int32_t* source = sources_.data();
  for (std::size_t i = 0; i < size(); ++i) {
    const std::uint32_t begin = mask_begin_[mask_of_point_[i]],
                        end = mask_begin_[mask_of_point_[i] + 1];
    Vec3d sum{};
    for (std::uint32_t w = begin; w < end; ++w) sum = sum + weights_[w] * points[*source++];
    points[first + i] = sum;
  }
}

}  // namespace limitray

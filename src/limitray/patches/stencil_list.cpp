// Stage: patches (S0). See stencil_list.h.
#include "limitray/patches/stencil_list.h"

#include <algorithm>
#include <cstring>

#include "limitray/math/net.h"

namespace limitray {
namespace {

// Two registers of two hold a point: of one of four the compiler would keep the sum in memory.
using Pair = Simd<double, 2>;

Pair load_pair(const double* p) {
  Pair v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
void store_pair(double* p, Pair v) { std::memcpy(p, &v, sizeof(v)); }

}  // namespace

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

void StencilList::apply(Point4* points, std::size_t first) const {
  const std::int32_t* source = sources_.data();
  Point4* to = points + first;
  for (const std::uint32_t mask : mask_of_point_) {
    const double *weight = weights_.data() + mask_begin_[mask],
                 *end = weights_.data() + mask_begin_[mask + 1];
    Pair xy{}, z{};
    for (; weight < end; ++weight) {
      const double* from = points[*source++].c;
      xy += *weight * load_pair(from);
      z += *weight * load_pair(from + 2);
    }
    store_pair(to->c, xy);
    store_pair(to->c + 2, z);
    ++to;
  }
}

}  // namespace limitray

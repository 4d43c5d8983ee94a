#include "limitray/intersect/ray_order.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace limitray {
namespace {

/// Patches that the last cache holds: sorting by place gains nothing for fewer.
constexpr double cached_patches = 1 << 16;
constexpr double bits_a_doubling = 0.7;
constexpr int max_cell_bits = 4;
/// Rays that one thread sorts by itself.
constexpr std::size_t slice_size = std::size_t(1) << 16;

/// A number's bits with two zeros between them.
constexpr std::uint16_t spread_bits[1 << max_cell_bits] = {00000, 00001, 00010, 00011, 00100, 00101,
                                                           00110, 00111, 01000, 01001, 01010, 01011,
                                                           01100, 01101, 01110, 01111};

}  // namespace

RayOrder::RayOrder(const Extent& extent, std::size_t patches) {
  const double bits = bits_a_doubling * std::log2(std::max(double(patches), 1.0) / cached_patches);
  cell_bits_ = std::clamp(int(std::lround(bits)), 0, max_cell_bits);
  const double cells = double(1 << cell_bits_);
  for (int i = 0; i < 3; ++i) {
    lowest_[i] = float(extent.center[i] - extent.half[i]);
    cells_a_unit_[i] = float(0.5 * cells / std::max(extent.half[i], 1e-30));
  }
}

/// Octant of the direction, then the cell of the origin in Morton order.
template <class T>
std::uint32_t RayOrder::key_of(const T* ray) const {
  std::uint32_t key = 0;
  for (int i = 0; i < 3; ++i) key |= std::uint32_t(ray[3 + i] < 0) << i;
  if (cell_bits_ == 0) return key;
  key <<= 3 * cell_bits_;
  const float last = float((1 << cell_bits_) - 1);
  for (int i = 0; i < 3; ++i) {
    const float x = (float(ray[i]) - lowest_[i]) * cells_a_unit_[i];
    const float cell = x > 0 ? std::min(x, last) : 0.0f;  // 0 for what is not a number, too
    key |= std::uint32_t(spread_bits[int(cell)]) << i;
  }
  return key;
}

template <class T>
std::span<const std::uint32_t> RayOrder::sort(const RayBatch<T>& batch, std::size_t first,
                                              std::size_t count) {
  const std::size_t keys = std::size_t(8) << 3 * cell_bits_;
  const std::size_t slices = (count + slice_size - 1) / slice_size;
  keys_.resize(count), order_.resize(count);
  places_.assign(keys * slices, 0);  // [slice][key]
  const auto for_each_slice = [&](auto&& f) {
    tbb::parallel_for(std::size_t(0), slices, [&](std::size_t s) {
      f(&places_[s * keys], s * slice_size, std::min(count, (s + 1) * slice_size));
    });
  };
  for_each_slice([&](std::uint32_t* counts, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      keys_[i] = std::uint16_t(key_of(batch.rays.data() + 6 * (first + i)));
      ++counts[keys_[i]];
    }
  });
  std::uint32_t place = 0;
  for (std::size_t key = 0; key < keys; ++key)
    for (std::size_t s = 0; s < slices; ++s) place += std::exchange(places_[s * keys + key], place);
  for_each_slice([&](std::uint32_t* next, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) order_[next[keys_[i]]++] = std::uint32_t(i);
  });
  return order_;
}

template std::span<const std::uint32_t> RayOrder::sort(const RayBatch<float>&, std::size_t,
                                                       std::size_t);
template std::span<const std::uint32_t> RayOrder::sort(const RayBatch<double>&, std::size_t,
                                                       std::size_t);

}  // namespace limitray

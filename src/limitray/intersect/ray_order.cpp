#include "limitray/intersect/ray_order.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

namespace limitray {
namespace {

/// Cells a side, as a power of two: the more, the more patches there are beyond those that the last
/// cache holds.
constexpr double cached_patches = 1 << 16;
constexpr double bits_a_doubling = 0.7;
constexpr int min_cell_bits = 2, max_cell_bits = 4;
/// Rays that one thread sorts by itself.
constexpr std::size_t slice_size = std::size_t(1) << 16;

/// A number's bits with two zeros between them.
constexpr std::uint16_t spread_bits[1 << max_cell_bits] = {00000, 00001, 00010, 00011, 00100, 00101,
                                                           00110, 00111, 01000, 01001, 01010, 01011,
                                                           01100, 01101, 01110, 01111};

/// Where an answer is written, and how many values a ray has.
template <class T>
struct Values {
  T* HitArrays<T>::*array;
  std::size_t width;
};
template <class T>
constexpr Values<T> all_values[7] = {{&HitArrays<T>::t, 1},     {&HitArrays<T>::t_error, 1},
                                     {&HitArrays<T>::uv, 2},    {&HitArrays<T>::normal, 3},
                                     {&HitArrays<T>::point, 3}, {&HitArrays<T>::dp_du, 3},
                                     {&HitArrays<T>::dp_dv, 3}};
template <class T>
constexpr std::uint32_t* HitArrays<T>::*all_ids[4] = {
    &HitArrays<T>::geometry_id, &HitArrays<T>::primitive_id, &HitArrays<T>::sub_quad,
    &HitArrays<T>::patch_id};

}  // namespace

RayOrder::RayOrder(const Extent& extent, std::size_t patches, std::size_t rays) {
  const double bits = bits_a_doubling * std::log2(std::max(double(patches), 1.0) / cached_patches);
  // Eight rays or more a key: what sorts a few rays must not cost more than they do.
  const int affordable = std::max((int(std::bit_width(rays)) - 1) / 3 - 2, 0);
  cell_bits_ =
      std::min(std::clamp(int(std::lround(bits)), min_cell_bits, max_cell_bits), affordable);
  const bool place_first = cell_bits_ > min_cell_bits;
  octant_shift_ = place_first ? 0 : 3 * cell_bits_;
  cell_shift_ = place_first ? 3 : 0;
  const double cells = double(1 << cell_bits_);
  for (int i = 0; i < 3; ++i) {
    lowest_[i] = float(extent.center[i] - extent.half[i]);
    cells_a_unit_[i] = float(0.5 * cells / std::max(extent.half[i], 1e-30));
  }
}

template <class T>
void RayOrder::find_keys(const T* rays, std::size_t count, std::uint16_t* keys) const {
  const float last = float((1 << cell_bits_) - 1);
  for (std::size_t i = 0; i < count; ++i) {
    const T* ray = rays + 6 * i;
    const unsigned octant =
        unsigned(ray[3] < 0) | unsigned(ray[4] < 0) << 1 | unsigned(ray[5] < 0) << 2;
    unsigned place = 0;
    for (int k = 0; k < 3; ++k) {
      const float x = (float(ray[k]) - lowest_[k]) * cells_a_unit_[k];
      const float below = last < x ? last : x;
      const float cell = below > 0 ? below : 0.0f;  // 0 for what is not a number, too
      place |= unsigned(spread_bits[int(cell)]) << k;
    }
    keys[i] = std::uint16_t(octant << octant_shift_ | place << cell_shift_);
  }
}

/// f(slice, begin, end) for the rays, slice by slice.
template <class T>
template <class F>
void SortedRays<T>::for_each_slice(F&& f) const {
  const std::size_t count = places_.size();
  tbb::parallel_for(std::size_t(0), (count + slice_size - 1) / slice_size, [&](std::size_t s) {
    f(s, s * slice_size, std::min(count, (s + 1) * slice_size));
  });
}

template <class T>
void SortedRays<T>::sort(const RayOrder& order, const RayBatch<T>& batch, std::size_t first,
                         std::size_t count) {
  first_ = first;
  kept_.clear();
  keys_.resize(count), places_.resize(count), rays_.resize(6 * count + 2);
  const auto take = [&](std::span<const T> given, std::vector<T>& own) {
    if (given.size() == 1) return given;
    own.resize(count);
    return std::span<const T>(own);
  };
  tnear_ = take(batch.tnear, own_tnear_), tfar_ = take(batch.tfar, own_tfar_);

  const std::size_t keys = order.key_count();
  const std::size_t slices = (count + slice_size - 1) / slice_size;
  next_places_.assign(keys * slices, 0);  // [slice][key]
  for_each_slice([&](std::size_t slice, std::size_t begin, std::size_t end) {
    std::uint32_t* counts = &next_places_[slice * keys];
    order.find_keys(batch.rays.data() + 6 * (first + begin), end - begin, &keys_[begin]);
    for (std::size_t i = begin; i < end; ++i) ++counts[keys_[i]];
  });
  std::uint32_t place = 0;
  for (std::size_t key = 0; key < keys; ++key)
    for (std::size_t s = 0; s < slices; ++s)
      place += std::exchange(next_places_[s * keys + key], place);
  for_each_slice([&](std::size_t slice, std::size_t begin, std::size_t end) {
    std::uint32_t* next = &next_places_[slice * keys];
    // Local pointers: the compiler need not read them anew after each write.
    const T* from = batch.rays.data() + 6 * first;
    T* rays = rays_.data();
    std::uint32_t* places = places_.data();
    const std::uint16_t* keys_of = keys_.data();
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t p = places[i] = next[keys_of[i]]++;
      std::memcpy(rays + 6 * p, from + 6 * i, 6 * sizeof(T));
    }
    if (batch.tnear.size() != 1)
      for (std::size_t i = begin; i < end; ++i) own_tnear_[places[i]] = batch.tnear[first + i];
    if (batch.tfar.size() != 1)
      for (std::size_t i = begin; i < end; ++i) own_tfar_[places[i]] = batch.tfar[first + i];
  });
}

template <class T>
HitArrays<T> SortedRays<T>::hits(const HitArrays<T>& wanted) {
  HitArrays<T> here;
  const auto give = [&](auto& column, auto array, std::size_t width) {
    if (!(wanted.*array)) return;
    column.resize(width * places_.size());
    here.*array = column.data();
  };
  for (int k = 0; k < 7; ++k) give(values_[k], all_values<T>[k].array, all_values<T>[k].width);
  for (int k = 0; k < 4; ++k) give(ids_[k], all_ids<T>[k], 1);
  return here;
}
/// Row first + i of `out` gets row places[i] of `rows`.
template <class T>
template <std::size_t width, class U>
void SortedRays<T>::copy_rows(const U* rows, std::size_t begin, std::size_t end, U* out) const {
  const std::uint32_t* places = places_.data();
  const auto copy_if = [rows, places, begin, end, out = out + width * first_](auto&& is_wanted) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t p = places[i];
      if (!is_wanted(p)) continue;
      for (std::size_t k = 0; k < width; ++k) out[width * i + k] = rows[width * p + k];
    }
  };
  if (kept_.empty())
    copy_if([](std::size_t) { return true; });
  else
    copy_if([this](std::size_t p) { return kept_[p]; });
}
template <class T>
void SortedRays<T>::restore(const HitArrays<T>& out) const {
  for_each_slice([&](std::size_t, std::size_t begin, std::size_t end) {
    const auto copy = [&](const auto& column, auto* to, std::size_t width) {
      if (!to) return;
      if (width == 1) copy_rows<1>(column.data(), begin, end, to);
      if (width == 2) copy_rows<2>(column.data(), begin, end, to);
      if (width == 3) copy_rows<3>(column.data(), begin, end, to);
    };
    for (int k = 0; k < 7; ++k)
      copy(values_[k], out.*all_values<T>[k].array, all_values<T>[k].width);
    for (int k = 0; k < 4; ++k) copy(ids_[k], out.*all_ids<T>[k], 1);
  });
}

template <class T>
void SortedRays<T>::keep_only(std::span<const RayRange> traced) {
  kept_.assign(places_.size(), false);
  for (const RayRange& r : traced)
    std::fill(kept_.begin() + std::ptrdiff_t(r.begin), kept_.begin() + std::ptrdiff_t(r.end), true);
}

template <class T>
std::uint8_t* SortedRays<T>::occluded() {
  occluded_.resize(places_.size());
  return occluded_.data();
}
template <class T>
void SortedRays<T>::restore(std::uint8_t* out) const {
  for_each_slice([&](std::size_t, std::size_t begin, std::size_t end) {
    copy_rows<1>(occluded_.data(), begin, end, out);
  });
}

template void RayOrder::find_keys(const float*, std::size_t, std::uint16_t*) const;
template void RayOrder::find_keys(const double*, std::size_t, std::uint16_t*) const;
template class SortedRays<float>;
template class SortedRays<double>;

}  // namespace limitray

// Stage: mathematics. One value for each of several rays: a SIMD register of floats, lane j belongs
// to ray j. What is written for a lane type V runs for a single float or double, too; then a mask
// is a bool.
#pragma once

#include <algorithm>
#include <bit>
#include <utility>

#include "limitray/math/net.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// As many rays as a register holds floats: 16, 8 or 4.
inline constexpr int lane_count = register_bytes / int(sizeof(float));
using Lanes = Simd<float, lane_count>;
using LaneMask = Simd<std::int32_t, lane_count>;
using LaneBits = Simd<std::uint32_t, lane_count>;

/// What a compare of V gives, and the type of its elements.
template <class V>
using MaskOf = decltype(V{} < V{});
template <class V>
struct ElementOf {
  using type = std::remove_cvref_t<decltype(V{}[0])>;
};
template <>
struct ElementOf<float> {
  using type = float;
};
template <>
struct ElementOf<double> {
  using type = double;
};
template <class V>
using Element = typename ElementOf<V>::type;

template <class V>
V select(MaskOf<V> mask, V a, V b) {
  return mask ? a : b;
}

/// One lane's value, read from memory: the compiler would spill the vector anew for each.
template <class V>
auto lane_of(const V& v, int lane) {
  if constexpr (std::is_arithmetic_v<V>) {
    return v;
  } else {
    std::remove_cvref_t<decltype(v[0])> value;
    std::memcpy(&value, reinterpret_cast<const char*>(&v) + lane * int(sizeof(value)),
                sizeof(value));
    return value;
  }
}

template <class V>
inline constexpr int lanes_of = int(sizeof(V) / sizeof(V{}[0]));
template <class V, int... i>
V powers_of_2(std::integer_sequence<int, i...>) {
  return V{(1 << i)...};
}
template <class V, int... i>
auto or_halves(V v, std::integer_sequence<int, i...>) {
  return __builtin_shufflevector(v, v, i...) |
         __builtin_shufflevector(v, v, (int(sizeof...(i)) + i)...);
}
/// All lanes' bits together, in as many steps as there are halvings: compilers test lane by lane.
template <class V>
auto or_all(V v) {
  if constexpr (lanes_of<V> == 2)
    return v[0] | v[1];
  else
    return or_all(or_halves(v, std::make_integer_sequence<int, lanes_of<V> / 2>{}));
}

/// One bit a lane whose mask is set.
template <class M>
unsigned bits_of(M mask) {
  if constexpr (std::is_integral_v<M>) {
    return mask != 0;
  } else {
#if defined(LIMITRAY_AVX512)
    if constexpr (sizeof(M) == 64 && sizeof(mask[0]) == 4)
      return _mm512_movepi32_mask(__m512i(mask));
    if constexpr (sizeof(M) == 64 && sizeof(mask[0]) == 8)
      return _mm512_movepi64_mask(__m512i(mask));
    if constexpr (sizeof(M) == 32 && sizeof(mask[0]) == 4)
      return _mm256_movepi32_mask(__m256i(mask));
    if constexpr (sizeof(M) == 32 && sizeof(mask[0]) == 8)
      return _mm256_movepi64_mask(__m256i(mask));
#elif defined(LIMITRAY_AVX2)
    if constexpr (sizeof(M) == 32 && sizeof(mask[0]) == 4)
      return unsigned(_mm256_movemask_ps(__m256(mask)));
    if constexpr (sizeof(M) == 32 && sizeof(mask[0]) == 8)
      return unsigned(_mm256_movemask_pd(__m256d(mask)));
#endif
    return unsigned(or_all(mask & powers_of_2<M>(std::make_integer_sequence<int, lanes_of<M>>{})));
  }
}
inline LaneMask mask_of(unsigned bits) {
  LaneMask bit;
  for (int i = 0; i < lane_count; ++i) bit[i] = 1 << i;
  return (LaneMask{} + std::int32_t(bits)) & bit ? LaneMask{} - 1 : LaneMask{};
}
template <class M>
bool any(M mask) {
  return bits_of(mask) != 0;
}
template <class M>
int count(M mask) {
  return std::popcount(bits_of(mask));
}

/// Half of these rays: as many doubles as a register holds.
using HalfLanes = Simd<double, lane_count / 2>;

inline Lanes load_lanes(const float* p) {
  Lanes v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}

inline void store_lanes(float* p, Lanes v) { std::memcpy(p, &v, sizeof(v)); }

inline Simd<float, 8> load_eight(const float* p) {
  Simd<float, 8> v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
inline void store_eight(float* p, Simd<float, 8> v) { std::memcpy(p, &v, sizeof(v)); }

template <class Half, int... i>
Lanes concatenate(Half a, Half b, std::integer_sequence<int, i...>) {
  return __builtin_shufflevector(a, b, i...);
}
template <int begin, int... i>
auto part(Lanes v, std::integer_sequence<int, i...>) {
  return __builtin_shufflevector(v, v, (begin + i)...);
}
/// The lanes of two vectors of doubles as floats.
inline Lanes join(HalfLanes low, HalfLanes high) {
  using Half = Simd<float, lane_count / 2>;
  const Half a = __builtin_convertvector(low, Half), b = __builtin_convertvector(high, Half);
  return concatenate(a, b, std::make_integer_sequence<int, lane_count>{});
}
/// The first lanes as doubles, or the others.
inline HalfLanes half_of(Lanes v, bool high) {
  using Half = Simd<float, lane_count / 2>;
  Half h;
  std::memcpy(&h, reinterpret_cast<const char*>(&v) + (high ? sizeof(h) : 0), sizeof(h));
  return __builtin_convertvector(h, HalfLanes);
}

/// One round of a transposition: swaps the blocks of `size` lanes beside the diagonal of two rows.
template <int size, int... i>
[[gnu::always_inline]] inline void swap_blocks(Lanes& a, Lanes& b,
                                               std::integer_sequence<int, i...>) {
  const Lanes low = __builtin_shufflevector(a, b, (i & size ? lane_count + i - size : i)...);
  b = __builtin_shufflevector(a, b, (i & size ? lane_count + i : i + size)...);
  a = low;
}
template <int size, int rows>
[[gnu::always_inline]] inline void transpose_blocks(Lanes (&row)[rows]) {
  if constexpr (size > 0) {
    for (int j = 0; j < rows; ++j)
      if (!(j & size))
        swap_blocks<size>(row[j], row[j + size], std::make_integer_sequence<int, lane_count>{});
    transpose_blocks<size / 2>(row);
  }
}
/// out[i], lane j = rows[j][i]: 16 values of each ray, by value.
[[gnu::always_inline]] inline void load_by_lane(const float* const (&rows)[lane_count],
                                                Lanes (&out)[16]) {
  for (int block = 0; block < 16; block += lane_count) {
    Lanes row[lane_count];
    for (int j = 0; j < lane_count; ++j) row[j] = load_lanes(rows[j] + block);
    transpose_blocks<lane_count / 2>(row);
    for (int i = 0; i < lane_count; ++i) out[block + i] = row[i];
  }
}
/// The same for 8 values of each ray.
template <int lanes>
[[gnu::always_inline]] inline void load_by_lane(const float* const (&rows)[lanes],
                                                Lanes (&out)[8]) {
  if constexpr (lanes == 16) {
    // Rays j and j + 8 share a register.
    for (int j = 0; j < 8; ++j)
      out[j] = concatenate(load_eight(rows[j]), load_eight(rows[j + 8]),
                           std::make_integer_sequence<int, 16>{});
    transpose_blocks<4>(out);
  } else {
    for (int block = 0; block < 8; block += lanes) {
      Lanes row[lanes];
      for (int j = 0; j < lanes; ++j) row[j] = load_lanes(rows[j] + block);
      transpose_blocks<lanes / 2>(row);
      for (int i = 0; i < lanes; ++i) out[block + i] = row[i];
    }
  }
}
/// The other way round: rows[j][i] = values[i], lane j. `values` are lost.
template <int lanes>
[[gnu::always_inline]] inline void store_by_lane(Lanes (&values)[8], float* const (&rows)[lanes]) {
  if constexpr (lanes == 16) {
    transpose_blocks<4>(values);
    for (int j = 0; j < 8; ++j) {
      constexpr std::make_integer_sequence<int, lanes / 2> eight{};
      store_eight(rows[j], part<0>(values[j], eight));
      store_eight(rows[j + 8], part<lanes / 2>(values[j], eight));
    }
  } else {
    for (int block = 0; block < 8; block += lanes) {
      Lanes row[lanes];
      for (int i = 0; i < lanes; ++i) row[i] = values[block + i];
      transpose_blocks<lanes / 2>(row);
      for (int j = 0; j < lanes; ++j) store_lanes(rows[j] + block, row[j]);
    }
  }
}
/// The same back: rows[j][i] = in[i], lane j.
[[gnu::always_inline]] inline void store_by_lane(const Lanes (&in)[16],
                                                 float* const (&rows)[lane_count]) {
  for (int block = 0; block < 16; block += lane_count) {
    Lanes row[lane_count];
    for (int i = 0; i < lane_count; ++i) row[i] = in[block + i];
    transpose_blocks<lane_count / 2>(row);
    for (int j = 0; j < lane_count; ++j) store_lanes(rows[j] + block, row[j]);
  }
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

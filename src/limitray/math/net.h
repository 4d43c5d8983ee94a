// Stage: mathematics. SIMD values the kernels are written in:
//   Quad<T>  4 values: Bernstein weights of one direction, or one value for each corner;
//   Net<T>   16 values: one component of a patch, rows of t, columns of s (see patch_buffer.h).
// A Net is one AVX-512 register, two AVX2 registers or four rows of 4 elsewhere. Built on the
// vector extensions of GCC and Clang: arithmetic reads as scalar algebra and needs no intrinsics;
// only the compares that feed a branch have them.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "limitray/math/isa.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

#if defined(LIMITRAY_AVX512)
inline constexpr int register_bytes = 64;
#elif defined(LIMITRAY_AVX2)
inline constexpr int register_bytes = 32;
#else
inline constexpr int register_bytes = 16;
#endif

template <class T, int lanes>
struct SimdOf {
  typedef T type __attribute__((vector_size(lanes * sizeof(T))));
};
template <class T, int lanes>
using Simd = typename SimdOf<T, lanes>::type;

template <class T>
using Quad = Simd<T, 4>;

template <class T>
Quad<T> quad(T a, T b, T c, T d) {
  return Quad<T>{a, b, c, d};
}
template <class T>
Quad<T> load_quad(const T* p) {
  Quad<T> q;
  std::memcpy(&q, p, sizeof(q));
  return q;
}
template <class T>
void store_quad(T* p, Quad<T> q) {
  std::memcpy(p, &q, sizeof(q));
}
template <class V>
V max(V a, V b) {
  return a > b ? a : b;
}
template <class V>
V min(V a, V b) {
  return a < b ? a : b;
}
template <class V>
V abs(V v) {
  return max(v, V(-v));
}

/// Sums of a, b, c, d as the four lanes of one quad: horizontal sums at the price of one.
template <class Q>
Q sum4(Q a, Q b, Q c, Q d) {
  const Q ab = __builtin_shufflevector(a, b, 0, 4, 1, 5) +  //
               __builtin_shufflevector(a, b, 2, 6, 3, 7);   // a02 b02 a13 b13
  const Q cd = __builtin_shufflevector(c, d, 0, 4, 1, 5) +  //
               __builtin_shufflevector(c, d, 2, 6, 3, 7);
  return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}
/// Largest lanes of a, b, c, d as the four lanes of one quad.
template <class Q>
Q max4(Q a, Q b, Q c, Q d) {
  const Q ab = max(Q(__builtin_shufflevector(a, b, 0, 4, 1, 5)),
                   Q(__builtin_shufflevector(a, b, 2, 6, 3, 7)));
  const Q cd = max(Q(__builtin_shufflevector(c, d, 0, 4, 1, 5)),
                   Q(__builtin_shufflevector(c, d, 2, 6, 3, 7)));
  return max(Q(__builtin_shufflevector(ab, cd, 0, 1, 4, 5)),
             Q(__builtin_shufflevector(ab, cd, 2, 3, 6, 7)));
}
/// Sum of the lanes.
template <class Q>
auto sum(Q q) {
  return (q[0] + q[1]) + (q[2] + q[3]);
}

template <class T>
struct Net {
  // Never fewer than 4 lanes: a row stays in one part.
  static constexpr int lanes =
      register_bytes / int(sizeof(T)) < 4 ? 4 : register_bytes / int(sizeof(T));
  static constexpr int parts = 16 / lanes;
  using Part = Simd<T, lanes>;
  Part part[parts];
};

template <class T>
Net<T> load_net(const T* p) {
  Net<T> n;
  std::memcpy(n.part, p, sizeof(n.part));
  return n;
}
template <class T>
void store_net(T* p, const Net<T>& n) {
  std::memcpy(p, n.part, sizeof(n.part));
}

/// Applies f to the parts of the arguments.
template <class T, class F, class... Nets>
[[gnu::always_inline]] inline Net<T> map(F f, const Nets&... nets) {
  Net<T> r;
  for (int i = 0; i < Net<T>::parts; ++i) r.part[i] = f(nets.part[i]...);
  return r;
}
template <class T>
Net<T> operator+(const Net<T>& a, const Net<T>& b) {
  return map<T>([](auto x, auto y) { return x + y; }, a, b);
}
template <class T>
Net<T> operator-(const Net<T>& a, const Net<T>& b) {
  return map<T>([](auto x, auto y) { return x - y; }, a, b);
}
template <class T>
Net<T> operator*(const Net<T>& a, const Net<T>& b) {
  return map<T>([](auto x, auto y) { return x * y; }, a, b);
}
template <class T>
Net<T> operator+(const Net<T>& a, std::type_identity_t<T> s) {
  return map<T>([s](auto x) { return x + s; }, a);
}
template <class T>
Net<T> operator-(const Net<T>& a, std::type_identity_t<T> s) {
  return map<T>([s](auto x) { return x - s; }, a);
}
template <class T>
Net<T> operator*(std::type_identity_t<T> s, const Net<T>& a) {
  return map<T>([s](auto x) { return x * s; }, a);
}
template <class T>
Net<T> abs(const Net<T>& a) {
  return map<T>([](auto x) { return abs(x); }, a);
}
template <class T>
Net<T> max(const Net<T>& a, const Net<T>& b) {
  return map<T>([](auto x, auto y) { return max(x, y); }, a, b);
}

/// Whether no lane of a compare's result is set; `parts` are the vectors of one Net.
template <class T, class M>
bool none(const M (&mask)[Net<T>::parts]) {
  M m = mask[0];
  for (int i = 1; i < Net<T>::parts; ++i) m |= mask[i];
#if defined(LIMITRAY_AVX2) && !defined(LIMITRAY_AVX512)
  if constexpr (std::is_same_v<T, float>) return _mm256_movemask_ps(__m256(m)) == 0;
  if constexpr (std::is_same_v<T, double>) return _mm256_movemask_pd(__m256d(m)) == 0;
#endif
  bool any = false;
  for (int i = 0; i < Net<T>::lanes; ++i) any |= m[i] != 0;
  return !any;
}
/// Whether all 16 values are above s (below s). A NaN is neither.
template <class T>
bool all_above(const Net<T>& n, T s) {
#if defined(LIMITRAY_AVX512)
  if constexpr (std::is_same_v<T, float>) {
    return _mm512_cmp_ps_mask(__m512(n.part[0]), _mm512_set1_ps(s), _CMP_GT_OQ) == 0xFFFF;
  } else {
    return _mm512_cmp_pd_mask(__m512d(n.part[0]), _mm512_set1_pd(s), _CMP_GT_OQ) == 0xFF &&
           _mm512_cmp_pd_mask(__m512d(n.part[1]), _mm512_set1_pd(s), _CMP_GT_OQ) == 0xFF;
  }
#else
  using Mask = decltype(n.part[0] > s);
  Mask not_above[Net<T>::parts];
  for (int i = 0; i < Net<T>::parts; ++i) not_above[i] = ~(n.part[i] > s);
  return none<T>(not_above);
#endif
}
template <class T>
bool all_below(const Net<T>& n, T s) {
#if defined(LIMITRAY_AVX512)
  if constexpr (std::is_same_v<T, float>) {
    return _mm512_cmp_ps_mask(__m512(n.part[0]), _mm512_set1_ps(s), _CMP_LT_OQ) == 0xFFFF;
  } else {
    return _mm512_cmp_pd_mask(__m512d(n.part[0]), _mm512_set1_pd(s), _CMP_LT_OQ) == 0xFF &&
           _mm512_cmp_pd_mask(__m512d(n.part[1]), _mm512_set1_pd(s), _CMP_LT_OQ) == 0xFF;
  }
#else
  using Mask = decltype(n.part[0] < s);
  Mask not_below[Net<T>::parts];
  for (int i = 0; i < Net<T>::parts; ++i) not_below[i] = ~(n.part[i] < s);
  return none<T>(not_below);
#endif
}

/// Largest value over the rows, by column.
template <class T>
Quad<T> max_rows(const Net<T>& n) {
  if constexpr (Net<T>::parts == 4) {
    return max(max(n.part[0], n.part[1]), max(n.part[2], n.part[3]));
  } else if constexpr (Net<T>::parts == 2) {
    const auto m = max(n.part[0], n.part[1]);
    return max(Quad<T>(__builtin_shufflevector(m, m, 0, 1, 2, 3)),
               Quad<T>(__builtin_shufflevector(m, m, 4, 5, 6, 7)));
  } else {
    const auto p = n.part[0];
    using Half = Simd<T, 8>;
    const auto m = max(Half(__builtin_shufflevector(p, p, 0, 1, 2, 3, 4, 5, 6, 7)),
                       Half(__builtin_shufflevector(p, p, 8, 9, 10, 11, 12, 13, 14, 15)));
    return max(Quad<T>(__builtin_shufflevector(m, m, 0, 1, 2, 3)),
               Quad<T>(__builtin_shufflevector(m, m, 4, 5, 6, 7)));
  }
}
/// Sum over the rows, by column.
template <class T>
Quad<T> sum_rows(const Net<T>& n) {
  if constexpr (Net<T>::parts == 4) {
    return (n.part[0] + n.part[1]) + (n.part[2] + n.part[3]);
  } else if constexpr (Net<T>::parts == 2) {
    const auto m = n.part[0] + n.part[1];
    return __builtin_shufflevector(m, m, 0, 1, 2, 3) + __builtin_shufflevector(m, m, 4, 5, 6, 7);
  } else {
    const auto p = n.part[0];
    const auto m = __builtin_shufflevector(p, p, 0, 1, 2, 3, 4, 5, 6, 7) +
                   __builtin_shufflevector(p, p, 8, 9, 10, 11, 12, 13, 14, 15);
    return __builtin_shufflevector(m, m, 0, 1, 2, 3) + __builtin_shufflevector(m, m, 4, 5, 6, 7);
  }
}
/// Largest of the 16 values.
template <class T>
T max_value(const Net<T>& n) {
  const Quad<T> q = max_rows(n);
  const Quad<T> h = max(q, Quad<T>(__builtin_shufflevector(q, q, 2, 3, 0, 1)));
  return h[0] > h[1] ? h[0] : h[1];
}

/// Smallest of the 16 values.
template <class T>
T min_value(const Net<T>& n) {
  return -max_value(T(-1) * n);
}

/// Lane (row j, column i) of the result is value (j, column[i]) of n.
template <int c0, int c1, int c2, int c3, class T>
Net<T> permute_columns(const Net<T>& n) {
  Net<T> r;
  for (int k = 0; k < Net<T>::parts; ++k) {
    const auto p = n.part[k];
    if constexpr (Net<T>::lanes == 4) {
      r.part[k] = __builtin_shufflevector(p, p, c0, c1, c2, c3);
    } else if constexpr (Net<T>::lanes == 8) {
      r.part[k] = __builtin_shufflevector(p, p, c0, c1, c2, c3, 4 + c0, 4 + c1, 4 + c2, 4 + c3);
    } else {
      r.part[k] =
          __builtin_shufflevector(p, p, c0, c1, c2, c3, 4 + c0, 4 + c1, 4 + c2, 4 + c3, 8 + c0,
                                  8 + c1, 8 + c2, 8 + c3, 12 + c0, 12 + c1, 12 + c2, 12 + c3);
    }
  }
  return r;
}
/// Lane (row j, column i) of the result is value (row[j], i) of n.
template <int r0, int r1, int r2, int r3, class T>
Net<T> permute_rows(const Net<T>& n) {
  constexpr int row[4] = {r0, r1, r2, r3};
  Net<T> r;
  if constexpr (Net<T>::lanes == 4) {
    for (int j = 0; j < 4; ++j) r.part[j] = n.part[row[j]];
  } else if constexpr (Net<T>::lanes == 8) {
    r.part[0] = __builtin_shufflevector(n.part[0], n.part[1], 4 * r0, 4 * r0 + 1, 4 * r0 + 2,
                                        4 * r0 + 3, 4 * r1, 4 * r1 + 1, 4 * r1 + 2, 4 * r1 + 3);
    r.part[1] = __builtin_shufflevector(n.part[0], n.part[1], 4 * r2, 4 * r2 + 1, 4 * r2 + 2,
                                        4 * r2 + 3, 4 * r3, 4 * r3 + 1, 4 * r3 + 2, 4 * r3 + 3);
  } else {
    const auto p = n.part[0];
    r.part[0] =
        __builtin_shufflevector(p, p, 4 * r0, 4 * r0 + 1, 4 * r0 + 2, 4 * r0 + 3, 4 * r1,
                                4 * r1 + 1, 4 * r1 + 2, 4 * r1 + 3, 4 * r2, 4 * r2 + 1, 4 * r2 + 2,
                                4 * r2 + 3, 4 * r3, 4 * r3 + 1, 4 * r3 + 2, 4 * r3 + 3);
  }
  return r;
}

/// A quad in the low lanes of a wider vector, the others undefined: free, where GCC's own widening
/// goes through memory.
template <class Part, class Q>
Part widen(Q q) {
#if defined(LIMITRAY_AVX512)
  if constexpr (sizeof(Part) == 64 && sizeof(Q) == 16)
    return Part(_mm512_castps128_ps512(__m128(q)));
  if constexpr (sizeof(Part) == 64 && sizeof(Q) == 32)
    return Part(_mm512_castpd256_pd512(__m256d(q)));
#endif
#if defined(LIMITRAY_AVX2)
  if constexpr (sizeof(Part) == 32 && sizeof(Q) == 16)
    return Part(_mm256_castps128_ps256(__m128(q)));
#endif
  Part p{};
  std::memcpy(&p, &q, sizeof(q));
  return p;
}

/// Lane (j, i) is q[i]: weights of s repeated in each row.
template <class T>
Net<T> along_rows(Quad<T> q) {
  Net<T> r;
  const auto w = widen<typename Net<T>::Part>(q);
  for (int k = 0; k < Net<T>::parts; ++k) {
    if constexpr (Net<T>::lanes == 4) {
      r.part[k] = w;
    } else if constexpr (Net<T>::lanes == 8) {
      r.part[k] = __builtin_shufflevector(w, w, 0, 1, 2, 3, 0, 1, 2, 3);
    } else {
      r.part[k] = __builtin_shufflevector(w, w, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
    }
  }
  return r;
}
/// Lane (j, i) is q[j]: weights of t repeated in each column.
template <class T>
Net<T> along_columns(Quad<T> q) {
  Net<T> r;
  const auto w = widen<typename Net<T>::Part>(q);
  if constexpr (Net<T>::lanes == 4) {
    r.part[0] = __builtin_shufflevector(w, w, 0, 0, 0, 0);
    r.part[1] = __builtin_shufflevector(w, w, 1, 1, 1, 1);
    r.part[2] = __builtin_shufflevector(w, w, 2, 2, 2, 2);
    r.part[3] = __builtin_shufflevector(w, w, 3, 3, 3, 3);
  } else if constexpr (Net<T>::lanes == 8) {
    r.part[0] = __builtin_shufflevector(w, w, 0, 0, 0, 0, 1, 1, 1, 1);
    r.part[1] = __builtin_shufflevector(w, w, 2, 2, 2, 2, 3, 3, 3, 3);
  } else {
    r.part[0] = __builtin_shufflevector(w, w, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  }
  return r;
}
/// q[k] at the interior point beside corner k (lanes 5, 6, 10, 9), 0 elsewhere.
template <class T>
Net<T> at_interior(Quad<T> q) {
  using Part = typename Net<T>::Part;
  const Part w = widen<Part>(q), zero{};
  Net<T> r;
  if constexpr (Net<T>::lanes == 4) {
    r.part[0] = r.part[3] = zero;
    r.part[1] = __builtin_shufflevector(w, zero, 4, 0, 1, 4);
    r.part[2] = __builtin_shufflevector(w, zero, 4, 3, 2, 4);
  } else if constexpr (Net<T>::lanes == 8) {
    r.part[0] = __builtin_shufflevector(w, zero, 8, 8, 8, 8, 8, 0, 1, 8);
    r.part[1] = __builtin_shufflevector(w, zero, 8, 3, 2, 8, 8, 8, 8, 8);
  } else {
    r.part[0] = __builtin_shufflevector(w, zero, 16, 16, 16, 16, 16, 0, 1, 16, 16, 3, 2, 16, 16, 16,
                                        16, 16);
  }
  return r;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

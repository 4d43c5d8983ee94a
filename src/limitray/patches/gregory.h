// Stage: patches. The bump that turns a Bezier patch into a Gregory patch (see patch_buffer.h):
//
//   g_k(s,t) = B(a) B(b) (a-b)/(a+b),   B(x) = 3 x (1-x)^2,   a, b: distances from corner k.
//
// Longchamp-Gregory patches as used by Loop, Schaefer, Ni, Castano 2009, written as "Bezier plus
// bump": the bump is antisymmetric in (a,b), at most 0.0667, and its derivatives at most 4/3.
#pragma once

#include "limitray/math/bezier.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// sup |dg/da| over the unit square (reached at a = 0, b = 1/3); also sup |d(B(a)B(b))/da|.
/// tests/cpp/kernel_gregory_test.cpp checks both by dense sampling.
template <class T>
inline constexpr T bump_slope = T(4.0 / 3.0);

/// Above sup |g|, 0.0667, with room for the rounding of what it multiplies.
template <class T>
inline constexpr T bump_height = T(0.067);
/// sup |g_aa|/2 + |g_ab| + |g_bb|/2 over the unit square (reached at a = 0, b -> 0: 18 + 9).
template <class T>
inline constexpr T bump_curvature = T(27);
/// sup |g_aa| + |g_ab|, and |g_bb| + |g_ab| (reached at the same place: 36 + 9).
template <class T>
inline constexpr T bump_slope_change = T(45);
/// Size of a subdomain below which the bumps' tangent planes lose less than frozen blends.
template <class T>
inline constexpr T tangent_plane_size = T(1.0 / 32);

/// Largest move of a net's interior by the whole bump: 0.0667 < 1/15 + rounding of each |bump|.
template <class T>
T bump_reach(const Quad<T>& bump) {
  return bump_height<T> * sum(abs(bump));
}

/// Distances a, b from the four corners.
template <class T>
struct CornerDistances {
  Quad<T> a, b;
};
template <class T>
CornerDistances<T> corner_distances(T s, T t) {
  return {quad<T>(s, 1 - s, 1 - s, s), quad<T>(t, t, 1 - t, 1 - t)};
}

/// Weights of the four bumps at (s,t) and their derivatives by s and t.
template <class T>
struct BumpWeights {
  Quad<T> g, g_s, g_t;
};
template <class T>
BumpWeights<T> bump_weights(T s, T t) {
  const auto [a, b] = corner_distances(s, t);
  // At a = b = 0 all three are 0: the ratios are kept finite there.
  const Quad<T> sum = max(a + b, Quad<T>{} + std::numeric_limits<T>::min());
  const Quad<T> wa = a / sum, wb = b / sum, w = wa - wb;
  const Quad<T> na = 1 - a, nb = 1 - b;
  const Quad<T> squares = na * na * nb * nb;
  // d/da of a b squares w, by the product rule; dw/da = 2 b / (a+b)^2.
  const Quad<T> da = b * w * na * (1 - 3 * a) * nb * nb + 2 * squares * a * wb * wb;
  const Quad<T> db = a * w * nb * (1 - 3 * b) * na * na - 2 * squares * b * wa * wa;
  const Quad<T> sign_s{1, -1, -1, 1}, sign_t{1, 1, -1, -1};
  return {9 * a * b * squares * w, 9 * da * sign_s, 9 * db * sign_t};
}

/// S7: the blend (a-b)/(a+b) on a subdomain is frozen at `mid`; what is lost is at most
/// `deviation[k] * |bump[k]|`.
template <class T>
struct FrozenBlend {
  Quad<T> mid, deviation;
};
/// Largest B(x) = 3 x (1-x)^2 for x in [lo, hi]: its peak is 4/9 at x = 1/3.
template <class T>
Quad<T> peak_weight(const Quad<T>& lo, const Quad<T>& hi) {
  const Quad<T> third = Quad<T>{} + T(1.0 / 3.0);
  const Quad<T> x = lo > third ? lo : (hi < third ? hi : third);
  return 3 * x * (1 - x) * (1 - x);
}
/// For the subdomain [s0, s0+ds] x [t0, t0+dt], ds, dt > 0.
template <class T>
FrozenBlend<T> freeze_blend(T s0, T t0, T ds, T dt) {
  const T s1 = s0 + ds, t1 = t0 + dt;
  const auto [a_lo, b_lo] =
      CornerDistances<T>{quad<T>(s0, 1 - s1, 1 - s1, s0), quad<T>(t0, t0, 1 - t1, 1 - t1)};
  const auto [a_hi, b_hi] =
      CornerDistances<T>{quad<T>(s1, 1 - s0, 1 - s0, s1), quad<T>(t1, t1, 1 - t0, 1 - t0)};
  // (a-b)/(a+b) grows with a and falls with b; both sums are positive.
  const Quad<T> lo = (a_lo - b_hi) / (a_lo + b_hi), hi = (a_hi - b_lo) / (a_hi + b_lo);
  // 32 u of slack cover the rounding of lo, hi and mid (8 u) and of the peak weights (12 u).
  const Quad<T> half = T(0.5) * (hi - lo) + 16 * std::numeric_limits<T>::epsilon();
  return {T(0.5) * (hi + lo), half * peak_weight<T>(a_lo, a_hi) * peak_weight<T>(b_lo, b_hi)};
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

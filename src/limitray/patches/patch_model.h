// Stage: patches. Comes in: a patch. Goes out: its first order model (see patch_buffer.h).
#pragma once

#include "limitray/patches/gregory.h"
#include "limitray/patches/patch_values.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// What a PatchModel holds, before it is packed.
template <class V>
struct ModelValues {
  struct Axis {
    V p, p_u, p_v, d_u, d_v;
  } axis[3];
  V below, above, curvature;
};

/// A cubic and its derivative at the middle.
template <class V>
V middle(V a, V b, V c, V d) {
  return Element<V>(0.125) * ((a + d) + 3 * (b + c));
}
template <class V>
V middle_slope(V a, V b, V c, V d) {
  return Element<V>(0.75) * ((c + d) - (a + b));
}

/// Adds the second differences of a row, for its three first differences.
template <class V>
void add_second(ValueRange<V>& range, const V* d, int stride) {
  range.add(d[stride] - d[0]);
  range.add(d[2 * stride] - d[stride]);
}

/// Bounds are over the control values of the derivative nets, which contain the derivatives; they
/// carry 16 u times the derivatives for the rounding of the model and of its projection. `bumps` is
/// the sum of |bump|. Returns the bound on the second derivatives.
template <class V>
[[gnu::always_inline]] inline V model_axis(const V (&p)[16], V bumps,
                                           typename ModelValues<V>::Axis& a) {
  using T = Element<V>;
  constexpr T u = std::numeric_limits<T>::epsilon() / 2;
  V row[4], row_u[4];
  for (int j = 0; j < 4; ++j) {
    const V* r = p + 4 * j;
    row[j] = middle(r[0], r[1], r[2], r[3]);
    row_u[j] = middle_slope(r[0], r[1], r[2], r[3]);
  }
  a.p = middle(row[0], row[1], row[2], row[3]);
  a.p_u = middle(row_u[0], row_u[1], row_u[2], row_u[3]);
  a.p_v = middle_slope(row[0], row[1], row[2], row[3]);

  V du[12], dv[12];  // du[3*j+i], dv[4*j+i]: a third of the derivative nets
  for (int k = 0; k < 12; ++k) {
    du[k] = p[k + k / 3 + 1] - p[k + k / 3];
    dv[k] = p[k + 4] - p[k];
  }
  ValueRange<V> range_u(du[0]), range_v(dv[0]);
  for (int k = 1; k < 12; ++k) range_u.add(du[k]), range_v.add(dv[k]);
  const auto stray = [&](const ValueRange<V>& d, V slope) {
    const V most = max(V(3 * d.hi - slope), V(slope - 3 * d.lo)) + bump_slope<T> * bumps;
    return most + 16 * u * (abs(slope) + most);
  };
  a.d_u = stray(range_u, a.p_u);
  a.d_v = stray(range_v, a.p_v);

  // Second derivatives: 6, 9 and 6 times the second differences.
  ValueRange<V> uu(du[1] - du[0]), uv(dv[1] - dv[0]), vv(dv[4] - dv[0]);
  for (int j = 0; j < 4; ++j) add_second(uu, du + 3 * j, 1), add_second(vv, dv + j, 4);
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) uv.add(dv[4 * j + i + 1] - dv[4 * j + i]);
  const V curvature =
      3 * uu.magnitude() + 9 * uv.magnitude() + 3 * vv.magnitude() + bump_curvature<T> * bumps;
  return (1 + 16 * u) * curvature + 64 * u * (a.d_u + a.d_v);
}

/// Heights over the tangent plane at the middle: N . (control values - p), N = p_u x p_v.
///
/// Rounding: N is off by 3 u |p_u|_1 |p_v|_1, differences, products and sums add 5 u of
/// |N| |S - p|_1, which the derivatives bound: no control value is farther from the middle than
/// |p_u| + d_u + |p_v| + d_v.
template <class V>
[[gnu::always_inline]] inline void set_heights(const PatchValues<V>& patch, ModelValues<V>& m) {
  using T = Element<V>;
  constexpr T u = std::numeric_limits<T>::epsilon() / 2;
  const auto& a = m.axis;
  V n[3], slack{}, reach{}, size_u{}, size_v{};
  for (int i = 0; i < 3; ++i) {
    const auto &j = a[(i + 1) % 3], &k = a[(i + 2) % 3];
    n[i] = j.p_u * k.p_v - k.p_u * j.p_v;
    slack += abs(n[i]) * (bump_height<T> * patch.bumps[i]);
    size_u += abs(a[i].p_u), size_v += abs(a[i].p_v);
    reach += abs(a[i].p_u) + a[i].d_u + abs(a[i].p_v) + a[i].d_v;
  }
  const auto height = [&](int k) {
    return V(n[0] * (patch.c[0][k] - a[0].p) + n[1] * (patch.c[1][k] - a[1].p) +
             n[2] * (patch.c[2][k] - a[2].p));
  };
  ValueRange<V> heights(height(0));
  for (int k = 1; k < 16; ++k) heights.add(height(k));
  slack += 16 * u * (size_u * size_v * reach + slack);
  m.below = heights.lo - slack, m.above = heights.hi + slack;
}

template <class V>
void make_patch_model(const PatchValues<V>& patch, ModelValues<V>& m) {
  const V x = model_axis(patch.c[0], patch.bumps[0], m.axis[0]);
  const V y = model_axis(patch.c[1], patch.bumps[1], m.axis[1]);
  const V z = model_axis(patch.c[2], patch.bumps[2], m.axis[2]);
  m.curvature = max(max(x, y), z);
  set_heights(patch, m);
}
template <class T>
PatchModel<T> make_patch_model(const PatchNet<T>& net, const PatchBump<T>* bump) {
  ModelValues<T> m;
  make_patch_model(values_of(net, bump), m);
  PatchModel<T> packed;
  for (int i = 0; i < 3; ++i) {
    const auto& a = m.axis[i];
    packed.axis[i] = {a.p, a.p_u, a.p_v, HalfBound<T>(a.d_u), HalfBound<T>(a.d_v)};
  }
  packed.below = m.below, packed.above = m.above;
  packed.curvature = m.curvature;
  return packed;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

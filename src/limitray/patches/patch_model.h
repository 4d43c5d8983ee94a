// Stage: patches. Comes in: a patch. Goes out: its first order model (see patch_buffer.h).
#pragma once

#include "limitray/patches/gregory.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Heights over the tangent plane at the middle: N . (control values - p), N = p_u x p_v.
///
/// Rounding: N is off by 3 u |p_u|_1 |p_v|_1, differences, products and sums add 5 u of
/// |N| |S - p|_1, which the derivatives bound: no control value is farther from the middle than
/// |p_u| + d_u + |p_v| + d_v.
template <class T>
void set_heights(const PatchNet<T>& net, const PatchBump<T>* bump, PatchModel<T>& m) {
  constexpr T u = std::numeric_limits<T>::epsilon() / 2;
  const auto& a = m.axis;
  Net<T> height{};
  T slack = 0, reach = 0, size_u = 0, size_v = 0;
  for (int i = 0; i < 3; ++i) {
    const auto &j = a[(i + 1) % 3], &k = a[(i + 2) % 3];
    const T n = j.p_u * k.p_v - k.p_u * j.p_v;
    height = height + n * (load_net(net.c[i]) - a[i].p);
    if (bump) slack += std::abs(n) * bump_reach<T>(load_quad(bump->c[i]));
    size_u += std::abs(a[i].p_u), size_v += std::abs(a[i].p_v);
    reach += std::abs(a[i].p_u) + a[i].d_u.value() + std::abs(a[i].p_v) + a[i].d_v.value();
  }
  slack += 16 * u * (size_u * size_v * reach + slack);
  m.above = max_value(height) + slack, m.below = min_value(height) - slack;
}

/// Bounds are over the control values of the derivative nets, which contain the derivatives; they
/// carry 16 u times the derivatives for the rounding of the model and of its projection.
template <class T>
PatchModel<T> make_patch_model(const PatchNet<T>& net, const PatchBump<T>* bump) {
  constexpr T u = std::numeric_limits<T>::epsilon() / 2;
  PatchModel<T> m;
  m.curvature = 0;
  const Quad<T> value{T(0.125), T(0.375), T(0.375), T(0.125)};  // weights at 1/2
  const Quad<T> slope{T(-0.75), T(-0.75), T(0.75), T(0.75)};
  for (int i = 0; i < 3; ++i) {
    const Net<T> n = load_net(net.c[i]);
    const Quad<T> row = sum_rows(n * along_columns<T>(value));
    const Quad<T> row_v = sum_rows(n * along_columns<T>(slope));
    typename PatchModel<T>::Axis& a = m.axis[i];
    a.p = sum(Quad<T>(row * value));
    a.p_u = sum(Quad<T>(row * slope));
    a.p_v = sum(Quad<T>(row_v * value));
    const Net<T> du = difference_u(n), dv = difference_v(n);
    const T bumps = bump ? sum(abs(load_quad(bump->c[i]))) : T(0);
    const T d_u = max_value(abs(T(3) * du - a.p_u)) + bump_slope<T> * bumps;
    const T d_v = max_value(abs(T(3) * dv - a.p_v)) + bump_slope<T> * bumps;
    a.d_u = HalfBound<T>(d_u + 16 * u * (std::abs(a.p_u) + d_u));
    a.d_v = HalfBound<T>(d_v + 16 * u * (std::abs(a.p_v) + d_v));
    // Second derivatives: 6, 9 and 6 times the second differences.
    const T curvature = 3 * max_value(abs(second_difference_u(n))) +
                        9 * max_value(abs(difference_u(dv))) +
                        3 * max_value(abs(second_difference_v(n))) + bump_curvature<T> * bumps;
    m.curvature = std::max(m.curvature, (1 + 16 * u) * curvature + 64 * u * (d_u + d_v));
  }
  set_heights(net, bump, m);
  return m;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

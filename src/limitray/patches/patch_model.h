// Stage: patches. Comes in: a patch. Goes out: its first order model (see patch_buffer.h).
#pragma once

#include "limitray/patches/gregory.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

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
    a.d_u = max_value(abs(T(3) * du - a.p_u)) + bump_slope<T> * bumps;
    a.d_v = max_value(abs(T(3) * dv - a.p_v)) + bump_slope<T> * bumps;
    a.d_u += 16 * u * (std::abs(a.p_u) + a.d_u);
    a.d_v += 16 * u * (std::abs(a.p_v) + a.d_v);
    // Second derivatives: 6, 9 and 6 times the second differences.
    const T curvature = 3 * max_value(abs(second_difference_u(n))) +
                        9 * max_value(abs(difference_u(dv))) +
                        3 * max_value(abs(second_difference_v(n))) + bump_curvature<T> * bumps;
    m.curvature = std::max(m.curvature, (1 + 16 * u) * curvature + 64 * u * (a.d_u + a.d_v));
  }
  return m;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection. Comes in: the patch and parameters of a hit. Goes out: position,
// derivatives, normal and the bound on t, all from the patch itself.
#pragma once

#include "limitray/intersect/intersect_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Position (relative to the mesh's centre) and derivatives by the patch parameters.
template <class T>
struct SurfacePoint {
  Vec3<T> p, p_s, p_t;
};
template <class T>
SurfacePoint<T> evaluate_patch(const PatchNet<T>& net, const PatchBump<T>* bump, T s, T t) {
  const Quad<T> bs = bernstein(s), ds = bernstein_derivative(s);
  const Net<T> bt = along_columns<T>(bernstein(t)), dt = along_columns<T>(bernstein_derivative(t));
  const BumpWeights<T> w = bump ? bump_weights(s, t) : BumpWeights<T>{};
  SurfacePoint<T> r;
  for (int i = 0; i < 3; ++i) {
    const Net<T> n = load_net(net.c[i]);
    const Quad<T> row = sum_rows(n * bt), row_t = sum_rows(n * dt);
    const Quad<T> h = bump ? load_quad(bump->c[i]) : Quad<T>{};
    const Quad<T> q = sum4(Quad<T>(row * bs + w.g * h), Quad<T>(row * ds + w.g_s * h),
                           Quad<T>(row_t * bs + w.g_t * h), Quad<T>{});
    r.p[i] = q[0], r.p_s[i] = q[1], r.p_t[i] = q[2];
  }
  return r;
}

/// Unit normal p_s x p_t, in double: a product of four lengths leaves the range of a float. Where
/// the derivatives vanish or are parallel (a degenerate corner), the normal a little towards the
/// middle of the patch; 0 if the patch has none.
template <class T>
Vec3<T> unit_normal(const PatchNet<T>& net, const PatchBump<T>* bump, T s, T t,
                    const SurfacePoint<T>& at) {
  SurfacePoint<T> p = at;
  for (T step = T(1.0 / 1024);; step *= 4) {
    const Vec3d p_s(p.p_s), p_t(p.p_t), n = cross(p_s, p_t);
    const double l = length(n);
    if (l > 64 * double(std::numeric_limits<T>::epsilon()) * length(p_s) * length(p_t))
      return Vec3<T>((1 / l) * n);
    if (step > 1) return {};
    p = evaluate_patch(net, bump, s + (T(0.5) - s) * step, t + (T(0.5) - t) * step);
  }
}

/// Bound on |t - t of the surface's own hit|, in units of t, beside PatchRoot::spread: the depth's
/// rounding and that of the last Newton step (taken blindly when it ends within eps_x, eps_y).
template <class T>
double t_rounding(const PatchModel<T>& model, const PatchRay<T>& ray) {
  const ProjectedModel<T> m = project(model, ray);
  return double(m.eps_z + std::min(m.eps_x, m.eps_y)) * ray.t_scale;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

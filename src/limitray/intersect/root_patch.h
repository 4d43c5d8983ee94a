// Stage: intersection, S1 and S2. A patch in the frame of a ray: x = y = 0 is the ray, z the depth
// along it. Everything later (splits, recovered subpatches, Newton steps) is computed from this.
#pragma once

#include "limitray/intersect/ray.h"
#include "limitray/math/lanes.h"
#include "limitray/patches/gregory.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// A patch's first order model in the frame of a ray: values at its middle, derivatives, how far
/// the derivatives stray (|x_u - x_u(middle)| <= dx_u), and the bounds on all rounding. V is a
/// number, or one for each of several rays (math/lanes.h).
template <class V>
struct ProjectedModel {
  V x, y, z;
  V x_u, x_v, y_u, y_v;
  V dx_u, dx_v, dy_u, dy_v;
  V z_slope;  // bound on |z_u| + |z_v|
  V eps_x, eps_y, eps_z;
};
/// Charges the rounding of everything computed from the patch: the local frame (2 u), then either
/// evaluation (37 u max|net|) or recovery and the splits after it (14 u + 48 u), together at most
/// 64 u. No control value is farther from the middle than the derivatives reach. docs/accuracy.md,
/// section 2.
template <class Axis, class Ray>
[[gnu::always_inline]] inline auto project(const Axis& ax, const Axis& ay, const Axis& az,
                                           const Ray& r) {
  using V = std::remove_cvref_t<decltype(az.p)>;
  const V depth = az.p - r.org_z;
  const V sx = abs(r.shear_x), sy = abs(r.shear_y);
  const V c = V{} + 64 * unit_roundoff<Element<V>>;
  ProjectedModel<V> p;
  p.x = ax.p - r.org_x + r.shear_x * depth;
  p.y = ay.p - r.org_y + r.shear_y * depth;
  p.z = r.sign_z * depth;
  p.x_u = ax.p_u + r.shear_x * az.p_u, p.x_v = ax.p_v + r.shear_x * az.p_v;
  p.y_u = ay.p_u + r.shear_y * az.p_u, p.y_v = ay.p_v + r.shear_y * az.p_v;
  p.dx_u = ax.d_u + sx * az.d_u, p.dx_v = ax.d_v + sx * az.d_v;
  p.dy_u = ay.d_u + sy * az.d_u, p.dy_v = ay.d_v + sy * az.d_v;
  p.z_slope = abs(az.p_u) + az.d_u + abs(az.p_v) + az.d_v;
  p.eps_x = r.eps + c * (abs(p.x) + abs(p.x_u) + p.dx_u + abs(p.x_v) + p.dx_v);
  p.eps_y = r.eps + c * (abs(p.y) + abs(p.y_u) + p.dy_u + abs(p.y_v) + p.dy_v);
  p.eps_z = r.eps_z + c * (abs(p.z) + p.z_slope);
  return p;
}
template <class T>
[[gnu::always_inline]] inline ProjectedModel<T> project(const PatchModel<T>& m,
                                                        const PatchRay<T>& r) {
  return project(m.axis[r.axis_x], m.axis[r.axis_y], m.axis[r.axis_z], r);
}

template <class T>
struct RootPatch {
  Net<T> x, y, z;
  Quad<T> bump_x, bump_y, bump_z;  // zero for a Bezier patch
  bool gregory;
  T eps_x, eps_y, eps_z;  // bound on all rounding of x, y, z anywhere on the patch
};

/// S1: the control values of a patch in the frame of the ray. `bump` is null for a Bezier patch,
/// `m` its model in the same frame.
template <class T>
[[gnu::always_inline]] inline RootPatch<T> to_ray_frame(const PatchNet<T>& net,
                                                        const PatchBump<T>* bump,
                                                        const PatchRay<T>& r,
                                                        const ProjectedModel<T>& m) {
  RootPatch<T> p;
  const Net<T> depth = load_net(net.c[r.axis_z]) - r.org_z;
  p.x = load_net(net.c[r.axis_x]) - r.org_x + r.shear_x * depth;
  p.y = load_net(net.c[r.axis_y]) - r.org_y + r.shear_y * depth;
  p.z = r.sign_z * depth;
  p.gregory = bump != nullptr;
  if (bump) {
    const Quad<T> bump_depth = load_quad(bump->c[r.axis_z]);
    p.bump_x = load_quad(bump->c[r.axis_x]) + r.shear_x * bump_depth;
    p.bump_y = load_quad(bump->c[r.axis_y]) + r.shear_y * bump_depth;
    p.bump_z = r.sign_z * bump_depth;
  } else {
    p.bump_x = p.bump_y = p.bump_z = Quad<T>{};
  }
  p.eps_x = m.eps_x, p.eps_y = m.eps_y, p.eps_z = m.eps_z;
  return p;
}

/// S2 on one component: no point of a net, each moved by at most `slack`, reaches 0.
template <class T>
bool misses_zero(const Net<T>& n, T slack) {
  return all_above(n, slack) || all_below(n, -slack);
}

/// Largest move of a net's interior by the whole bump: 0.0667 < 1/15 + rounding of each |bump|.
template <class T>
T bump_reach(const Quad<T>& bump) {
  return bump_height<T> * sum(abs(bump));
}

/// S2: whether the ray certainly misses the patch between zmin and zmax.
template <class T>
bool misses(const RootPatch<T>& p, T zmin, T zmax) {
  T dx = p.eps_x, dy = p.eps_y, dz = p.eps_z;
  if (p.gregory) {
    dx += bump_reach<T>(p.bump_x);
    dy += bump_reach<T>(p.bump_y);
    dz += bump_reach<T>(p.bump_z);
  }
  return misses_zero(p.x, dx) || misses_zero(p.y, dy) || all_above(p.z, zmax + dz) ||
         all_below(p.z, zmin - dz);
}

/// Position across the ray and its first derivatives by the patch parameters; the same along it.
template <class V>
struct RaySample {
  V x, y;
  V x_u, y_u;
  V x_v, y_v;
};
template <class V>
struct DepthSample {
  V z, z_u, z_v;
};
/// The surface at (u,v), with the true derivatives of the Gregory blend.
///
/// Rounding: the four weights of a direction are off by 11.5 u in all (running error analysis of
/// `bernstein`), products and 16-term sums add 6 u: 29 u max|net|. The bumps add 8 u max|bump|.
template <class T>
[[gnu::always_inline]] inline RaySample<T> evaluate(const RootPatch<T>& p, T u, T v) {
  const Quad<T> bu = bernstein(u), du = bernstein_derivative(u);
  const Net<T> bv = along_columns<T>(bernstein(v)), dv = along_columns<T>(bernstein_derivative(v));
  const Quad<T> x = sum_rows(p.x * bv), y = sum_rows(p.y * bv);
  const Quad<T> xv = sum_rows(p.x * dv), yv = sum_rows(p.y * dv);
  Quad<T> s[6] = {x * bu, y * bu, x * du, y * du, xv * bu, yv * bu};
  if (p.gregory) {
    const BumpWeights<T> w = bump_weights(u, v);
    s[0] += w.g * p.bump_x, s[1] += w.g * p.bump_y;
    s[2] += w.g_s * p.bump_x, s[3] += w.g_s * p.bump_y;
    s[4] += w.g_t * p.bump_x, s[5] += w.g_t * p.bump_y;
  }
  const Quad<T> a = sum4(s[0], s[1], s[2], s[3]), b = sum4(s[4], s[5], s[4], s[5]);
  return {a[0], a[1], a[2], a[3], b[0], b[1]};
}
template <class T>
[[gnu::always_inline]] inline DepthSample<T> evaluate_depth(const RootPatch<T>& p, T u, T v) {
  const Net<T> bv = along_columns<T>(bernstein(v)), dv = along_columns<T>(bernstein_derivative(v));
  const Quad<T> bu = bernstein(u), z = sum_rows(p.z * bv), zv = sum_rows(p.z * dv);
  Quad<T> s[3] = {z * bu, z * bernstein_derivative(u), zv * bu};
  if (p.gregory) {
    const BumpWeights<T> w = bump_weights(u, v);
    s[0] += w.g * p.bump_z, s[1] += w.g_s * p.bump_z, s[2] += w.g_t * p.bump_z;
  }
  const Quad<T> a = sum4(s[0], s[1], s[2], s[2]);
  return {a[0], a[1], a[2]};
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

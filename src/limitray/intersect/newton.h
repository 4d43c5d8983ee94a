// Stage: intersection, S8. Comes in: a patch in the ray's frame and a domain on which its
// projection may be one-to-one. Goes out: the only hit on it, a proof that there is none, or
// neither.
//
// After Toth 1985, "On Ray Tracing Parametric Surfaces" (interval Newton), with componentwise
// bounds of the derivative from the Bernstein net, and clamped Newton steps instead of shrinking
// intervals. Multiply the projection (x,y) by M, (almost) the inverse of its Jacobian at the
// domain's middle c:
//
//   F = M (x,y),   F(p) - F(q) = (I + G)(p - q),   |G| <= K componentwise on the domain.       (1)
//
// If K.uu < 1, K.vv < 1 and (1 - K.uu)(1 - K.vv) > K.uv K.vu, F is one-to-one (I - K is an
// M-matrix), and |p - q| <= (I - K)^-1 (|F(q)| + e) for each point p of the surface on the ray, e
// the bound on rounding. With q = c: p lies in c - F(c) +- (K (1/2,1/2) size + e) (Krawczyk's
// operator).
//
// When q stands on a border (say u = 1) and F still points outward there, F_u(q) = -rho, then with
// a = q.u - p.u >= 0 and b = |p.v - q.v| (1) gives a + rho <= e_u + K.uu a + K.uv b and
// b (1 - K.vv) <= |F_v| + e_v + K.vu a. Eliminate b: a's factor is positive, so if
//
//   rho > e_u + K.uv (|F_v| + e_v) / (1 - K.vv) (2)
//
// there is no p on the domain: a certain miss. |F_v| counts as 0 if v stands on its border pointing
// outward, too (its rho only helps). What is near zero and not certainly absent by (2) is a hit:
// the shortcut never turns a hit into a miss.
#pragma once

#include "limitray/intersect/root_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// A subdomain in patch parameters, and the nets on it (Gregory blends frozen).
template <class T>
struct SubPatch {
  Net<T> x, y, z;
  T dx, dy, dz;  // S7: how far the frozen blends are from the true ones, rounding included
  T u0, v0, size_u, size_v;
  T bump_gain;  // bound on |d/du| and |d/dv| of what freezing loses, for |bump| = 1
};

enum class NewtonResult { hit, miss, undecided };

template <class T>
struct PatchRoot {
  T u, v, z;
  T radius;      // bound on the parametric distance to the surface's own hit
  T spread = 0;  // bound on the distance in depth, rounding aside
};

/// M, e and K of the head comment.
template <class T>
struct Contraction {
  T m_uu, m_uv, m_vu, m_vv;
  T e_u, e_v;
  T uu, uv, vu, vv, det;  // K, and det(I - K)

  /// M from the Jacobian at the middle, e from the bounds of x and y.
  Contraction(T x_u, T x_v, T y_u, T y_v, T eps_x, T eps_y) {
    const T inverse = 1 / (x_u * y_v - x_v * y_u);
    m_uu = y_v * inverse, m_uv = -x_v * inverse;
    m_vu = -y_u * inverse, m_vv = x_u * inverse;
    e_u = std::abs(m_uu) * eps_x + std::abs(m_uv) * eps_y;
    e_v = std::abs(m_vu) * eps_x + std::abs(m_vv) * eps_y;
  }
  void set(T k_uu, T k_uv, T k_vu, T k_vv) {
    uu = k_uu, uv = k_uv, vu = k_vu, vv = k_vv;
    det = (1 - uu) * (1 - vv) - uv * vu;
  }
  /// False for a singular Jacobian, too (infinities and NaN fail the compares).
  bool one_to_one() const { return uu < T(0.95) && vv < T(0.95) && det > T(0.02); }
  /// Rule (2): out points outward by r_out.
  bool beyond_u(T r_u, T r_v) const { return r_u > e_u + uv * (r_v + e_v) / (1 - vv); }
  bool beyond_v(T r_v, T r_u) const { return r_v > e_v + vu * (r_u + e_u) / (1 - uu); }
  /// Largest component of (I - K)^-1 (|r| + e).
  T radius(T r_u, T r_v) const {
    const T a = r_u + e_u, b = r_v + e_v;
    return std::max((1 - vv) * a + uv * b, vu * a + (1 - uu) * b) / det;
  }
};

template <class T>
struct Interval {
  T lo, hi;
  T clamp(T x) const { return std::min(std::max(x, lo), hi); }
};

/// Clamped Newton steps from (u,v) on the domain, under a contraction. A step whose end is certain
/// to be within `eps` of zero (curvature * step^2) is taken without looking again.
template <class T>
[[gnu::always_inline]] inline NewtonResult newton_steps(const RootPatch<T>& root,
                                                        const Contraction<T>& k, T curvature,
                                                        Interval<T> in_u, Interval<T> in_v, T u,
                                                        T v, PatchRoot<T>& out,
                                                        std::uint32_t& steps) {
  for (int step = 0; step < 8; ++step) {
    const RaySample<T> p = evaluate(root, u, v);
    ++steps;
    const T r_u = k.m_uu * p.x + k.m_uv * p.y, r_v = k.m_vu * p.x + k.m_vv * p.y;
    // Which borders (u,v) stands on with F pointing outward.
    const bool out_u = (u == in_u.lo && r_u > 0) || (u == in_u.hi && r_u < 0);
    const bool out_v = (v == in_v.lo && r_v > 0) || (v == in_v.hi && r_v < 0);
    const T a_u = std::abs(r_u), a_v = std::abs(r_v);
    if (out_u && k.beyond_u(a_u, out_v ? T(0) : a_v)) return NewtonResult::miss;
    if (out_v && k.beyond_v(a_v, out_u ? T(0) : a_u)) return NewtonResult::miss;
    // Where M is large, F may be within its noise e although x and y are not within theirs yet.
    const bool near = std::abs(p.x) <= 4 * root.eps_x && std::abs(p.y) <= 4 * root.eps_y;
    if (near && (out_u || a_u <= k.e_u) && (out_v || a_v <= k.e_v)) {
      out = {u, v, p.z, k.radius(a_u, a_v)};
      return NewtonResult::hit;
    }
    // Newton step, held inside the domain: a clamped direction hands its share to the other.
    const T inverse = 1 / (p.x_u * p.y_v - p.x_v * p.y_u);
    const T du = (p.x_v * p.y - p.y_v * p.x) * inverse, dv = (p.y_u * p.x - p.x_u * p.y) * inverse;
    const T nu = in_u.clamp(u + du), nv = in_v.clamp(v + dv);
    const bool held_u = nu != u + du, held_v = nv != v + dv;
    if (!held_u && !held_v) {
      const T longest = std::max(std::abs(du), std::abs(dv));
      if (curvature * longest * longest <= std::min(root.eps_x, root.eps_y)) {
        out = {nu, nv, p.z + p.z_u * du + p.z_v * dv, k.radius(k.e_u, k.e_v)};
        return NewtonResult::hit;
      }
      u = nu, v = nv;
    } else if (held_u && !held_v) {
      const T f_u = k.m_vu * p.x_u + k.m_vv * p.y_u, f_v = k.m_vu * p.x_v + k.m_vv * p.y_v;
      v = in_v.clamp(v - (r_v + f_u * (nu - u)) / f_v);
      u = nu;
    } else if (held_v && !held_u) {
      const T f_u = k.m_uu * p.x_u + k.m_uv * p.y_u, f_v = k.m_uu * p.x_v + k.m_uv * p.y_v;
      u = in_u.clamp(u - (r_u + f_v * (nv - v)) / f_u);
      v = nv;
    } else {
      u = nu, v = nv;
    }
  }
  return NewtonResult::undecided;
}

/// S8 on a whole patch by its first order model: most rays are decided here, before or after
/// reading the patch itself; reading it counts as a run.
template <class T>
[[gnu::always_inline]] inline NewtonResult newton_on_model(
    const ProjectedModel<T>& m, T curvature, const PatchNet<T>& net, const PatchBump<T>* bump,
    const PatchRay<T>& r, PatchRoot<T>& out, std::uint32_t& runs, std::uint32_t& steps) {
  Contraction<T> k(m.x_u, m.x_v, m.y_u, m.y_v, m.eps_x, m.eps_y);
  const T a_uu = std::abs(k.m_uu), a_uv = std::abs(k.m_uv), a_vu = std::abs(k.m_vu),
          a_vv = std::abs(k.m_vv);
  k.set(a_uu * m.dx_u + a_uv * m.dy_u, a_uu * m.dx_v + a_uv * m.dy_v, a_vu * m.dx_u + a_vv * m.dy_u,
        a_vu * m.dx_v + a_vv * m.dy_v);
  if (!k.one_to_one()) return NewtonResult::undecided;
  // Krawczyk: every hit is in this box around the root of the model.
  const T half = T(0.5);
  const T u = half - (k.m_uu * m.x + k.m_uv * m.y), v = half - (k.m_vu * m.x + k.m_vv * m.y);
  const T reach_u = half * (k.uu + k.uv) + k.e_u, reach_v = half * (k.vu + k.vv) + k.e_v;
  if (u + reach_u < 0 || u - reach_u > 1 || v + reach_v < 0 || v - reach_v > 1)
    return NewtonResult::miss;

  ++runs;
  const RootPatch<T> root = to_ray_frame(net, bump, r, m);
  const Interval<T> unit{0, 1};
  return newton_steps(root, k, 2 * curvature, unit, unit, unit.clamp(u), unit.clamp(v), out, steps);
}

/// S8 on a subpatch, its K from its own net.
template <class T>
NewtonResult newton_on_subpatch(const RootPatch<T>& root, const SubPatch<T>& s, PatchRoot<T>& out,
                                std::uint32_t& runs, std::uint32_t& steps) {
  const T u = s.u0 + T(0.5) * s.size_u, v = s.v0 + T(0.5) * s.size_v;
  const RaySample<T> p = evaluate(root, u, v);
  Contraction<T> k(p.x_u, p.x_v, p.y_u, p.y_v, root.eps_x, root.eps_y);
  const Net<T> xu = difference_u(s.x), xv = difference_v(s.x);
  const Net<T> yu = difference_u(s.y), yv = difference_v(s.y);
  const T nu = 3 / s.size_u, nv = 3 / s.size_v;
  const Quad<T> q = max4(max_rows(abs((k.m_uu * nu) * xu + (k.m_uv * nu) * yu - T(1))),
                         max_rows(abs((k.m_uu * nv) * xv + (k.m_uv * nv) * yv)),
                         max_rows(abs((k.m_vu * nu) * xu + (k.m_vv * nu) * yu)),
                         max_rows(abs((k.m_vu * nv) * xv + (k.m_vv * nv) * yv - T(1))));
  // Each value of the net may be off by eps, its differences by twice that; and the bump's part.
  const T gx = s.bump_gain * sum(abs(root.bump_x)), gy = s.bump_gain * sum(abs(root.bump_y));
  const T g_u = std::abs(k.m_uu) * gx + std::abs(k.m_uv) * gy;
  const T g_v = std::abs(k.m_vu) * gx + std::abs(k.m_vv) * gy;
  k.set(q[0] + 2 * nu * k.e_u + g_u, q[1] + 2 * nv * k.e_u + g_u, q[2] + 2 * nu * k.e_v + g_v,
        q[3] + 2 * nv * k.e_v + g_v);
  ++runs, ++steps;
  if (!k.one_to_one()) return NewtonResult::undecided;
  const Interval<T> in_u{s.u0, s.u0 + s.size_u}, in_v{s.v0, s.v0 + s.size_v};
  const T start_u = u - (k.m_uu * p.x + k.m_uv * p.y), start_v = v - (k.m_vu * p.x + k.m_vv * p.y);
  const T infinity = std::numeric_limits<T>::infinity();
  return newton_steps(root, k, infinity, in_u, in_v, in_u.clamp(start_u), in_v.clamp(start_v), out,
                      steps);
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

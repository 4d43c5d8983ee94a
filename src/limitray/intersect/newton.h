// Stage: intersection, S8. Comes in: a patch in the ray's frame and a subdomain on which its
// projection may be one-to-one. Goes out: the only hit on it, a proof that there is none, or neither.
//
// After Toth 1985, "On Ray Tracing Parametric Surfaces" (interval Newton), with bounds of the
// derivative from the Bernstein net instead of interval arithmetic, and clamped Newton steps instead
// of shrinking intervals. Multiply the projection (x,y) by the inverse of its Jacobian at the centre:
// F = M (x,y), F(p) - F(q) = (I + G)(p - q), and the derivative net bounds G on the subdomain by
// kappa_u, kappa_v (its row sums). If both are below 1, F is one-to-one, and
//
//   a root p and any q in the subdomain satisfy   |p - q|_inf <= (|F(q)|_inf + e) / (1 - kappa).   (1)
//
// When q stands on a border (say u = 1) and F_u(q) = -rho < 0 still points outward, then with
// a = q.u - p.u >= 0, b = |p.v - q.v|:  a + rho <= e_u + kappa_u max(a,b),
// b <= |F_v(q)| + e_v + kappa_v max(a,b). If a >= b, rho <= e_u; else b <= (|F_v| + e_v)/(1 - kappa_v).
// So there is no root, on the subdomain, of the surface itself (not only of its rounded image), if
//
//   rho > e_u + kappa_u (|F_v(q)| + e_v) / (1 - kappa_v),                                          (2)
//
// where |F_v| counts as 0 if v stands on its border pointing outward, too (its rho only helps). What
// is near zero and not certainly absent by (2) is a hit: the shortcut never turns a hit into a miss.
#pragma once

#include "limitray/intersect/root_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// A subdomain in patch parameters, and the nets on it (Gregory blends frozen).
template <class T>
struct SubPatch {
  Net<T> x, y, z;
  T dx, dy, dz;          // S7: how far the frozen blends are from the true ones
  T u0, v0, size_u, size_v;
  T bump_gain;           // bound on |d/du| + |d/dv| of what freezing loses, for |bump| = 1
};

enum class NewtonResult { hit, miss, undecided };

template <class T>
struct PatchRoot {
  T u, v, z;
  T radius;  // bound on the parametric distance to the surface's own hit
};

/// Row sums of G on the subdomain, for M = (m_uu m_uv; m_vu m_vv).
template <class T>
struct Contraction {
  T u, v;
};
template <class T>
Contraction<T> contraction(const RootPatch<T>& root, const SubPatch<T>& s, const T (&m)[4]) {
  const Net<T> xu = difference_u(s.x), xv = difference_v(s.x);
  const Net<T> yu = difference_u(s.y), yv = difference_v(s.y);
  const T nu = 3 / s.size_u, nv = 3 / s.size_v;
  const Quad<T> k = max4(max_rows(abs((m[0] * nu) * xu + (m[1] * nu) * yu - T(1))),
                         max_rows(abs((m[0] * nv) * xv + (m[1] * nv) * yv)),
                         max_rows(abs((m[2] * nu) * xu + (m[3] * nu) * yu)),
                         max_rows(abs((m[2] * nv) * xv + (m[3] * nv) * yv - T(1))));
  Contraction<T> c{k[0] + k[1], k[2] + k[3]};
  if (root.gregory) {
    const T gx = s.bump_gain * sum(abs(root.bump_x)), gy = s.bump_gain * sum(abs(root.bump_y));
    c.u += std::abs(m[0]) * gx + std::abs(m[1]) * gy;
    c.v += std::abs(m[2]) * gx + std::abs(m[3]) * gy;
  }
  return c;
}

/// Rule (2) for one direction: r_out is F's component that points out of the border (0 if none).
template <class T>
bool beyond_border(T r_out, T e_out, T kappa_out, T r_other, T e_other, T kappa_other) {
  return r_out > e_out + kappa_out * (r_other + e_other) / (1 - kappa_other);
}

/// S8 on subpatch `s` of `root`. `steps` counts evaluations.
template <class T>
NewtonResult newton(const RootPatch<T>& root, const SubPatch<T>& s, PatchRoot<T>& out,
                    std::uint32_t& steps) {
  const T u1 = s.u0 + s.size_u, v1 = s.v0 + s.size_v;
  T u = s.u0 + T(0.5) * s.size_u, v = s.v0 + T(0.5) * s.size_v;
  RaySample<T> p = evaluate(root, u, v);
  ++steps;
  const T inverse = 1 / (p.x_u * p.y_v - p.x_v * p.y_u);
  const T m[4] = {p.y_v * inverse, -p.x_v * inverse, -p.y_u * inverse, p.x_u * inverse};
  const T e_u = std::abs(m[0]) * root.eps_x + std::abs(m[1]) * root.eps_y;
  const T e_v = std::abs(m[2]) * root.eps_x + std::abs(m[3]) * root.eps_y;
  Contraction<T> kappa = contraction(root, s, m);
  // Each of the net's values may be off by eps: its differences by twice that.
  kappa.u += 6 * e_u * (1 / s.size_u + 1 / s.size_v);
  kappa.v += 6 * e_v * (1 / s.size_u + 1 / s.size_v);
  if (!(kappa.u < T(0.75) && kappa.v < T(0.75))) return NewtonResult::undecided;

  for (int step = 0; step < 8; ++step) {
    const T r_u = m[0] * p.x + m[1] * p.y, r_v = m[2] * p.x + m[3] * p.y;
    // Which borders (u,v) stands on with F pointing outward.
    const bool out_u = (u == s.u0 && r_u > 0) || (u == u1 && r_u < 0);
    const bool out_v = (v == s.v0 && r_v > 0) || (v == v1 && r_v < 0);
    const T a_u = std::abs(r_u), a_v = std::abs(r_v);
    if (out_u && beyond_border(a_u, e_u, kappa.u, out_v ? T(0) : a_v, e_v, kappa.v))
      return NewtonResult::miss;
    if (out_v && beyond_border(a_v, e_v, kappa.v, out_u ? T(0) : a_u, e_u, kappa.u))
      return NewtonResult::miss;
    if ((out_u || a_u <= e_u) && (out_v || a_v <= e_v)) {
      const T worst = std::max(a_u + e_u, a_v + e_v);
      out = {u, v, p.z, worst / (1 - std::max(kappa.u, kappa.v))};
      return NewtonResult::hit;
    }
    // Newton step, held inside the subdomain: a clamped direction hands its share to the other.
    const T det = p.x_u * p.y_v - p.x_v * p.y_u;
    T du = (p.x_v * p.y - p.y_v * p.x) / det, dv = (p.y_u * p.x - p.x_u * p.y) / det;
    T nu = std::min(std::max(u + du, s.u0), u1), nv = std::min(std::max(v + dv, s.v0), v1);
    if (nu != u + du && nv == v + dv) {
      nv = v - (r_v + (m[2] * p.x_u + m[3] * p.y_u) * (nu - u)) / (m[2] * p.x_v + m[3] * p.y_v);
      nv = std::min(std::max(nv, s.v0), v1);
    } else if (nv != v + dv && nu == u + du) {
      nu = u - (r_u + (m[0] * p.x_v + m[1] * p.y_v) * (nv - v)) / (m[0] * p.x_u + m[1] * p.y_u);
      nu = std::min(std::max(nu, s.u0), u1);
    }
    u = nu, v = nv;
    p = evaluate(root, u, v);
    ++steps;
  }
  return NewtonResult::undecided;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

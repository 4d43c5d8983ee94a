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
//
// `V` is a number, or one number for each of several rays (math/lanes.h); then each ray keeps what
// it has once it is decided, and the steps go on until all are.
#pragma once

#include "limitray/intersect/root_patch.h"
#include "limitray/math/lanes.h"

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

template <class V>
struct PatchRoot {
  V u, v, z;
  V radius;    // bound on the parametric distance to the surface's own hit
  V spread{};  // bound on the distance in depth, rounding aside
};

/// M, e and K of the head comment.
template <class V>
struct Contraction {
  using T = Element<V>;
  V m_uu, m_uv, m_vu, m_vv;
  V e_u, e_v;
  V uu, uv, vu, vv, det;  // K, and det(I - K)
  V by_u, by_v, by_det;   // 1 / (1 - uu), 1 / (1 - vv), 1 / det

  /// M from the Jacobian at the middle, e from the bounds of x and y.
  Contraction(V x_u, V x_v, V y_u, V y_v, V eps_x, V eps_y) {
    const V inverse = T(1) / (x_u * y_v - x_v * y_u);
    m_uu = y_v * inverse, m_uv = -x_v * inverse;
    m_vu = -y_u * inverse, m_vv = x_u * inverse;
    e_u = abs(m_uu) * eps_x + abs(m_uv) * eps_y;
    e_v = abs(m_vu) * eps_x + abs(m_vv) * eps_y;
  }
  void set(V k_uu, V k_uv, V k_vu, V k_vv) {
    uu = k_uu, uv = k_uv, vu = k_vu, vv = k_vv;
    det = (T(1) - uu) * (T(1) - vv) - uv * vu;
    by_u = T(1) / (T(1) - uu), by_v = T(1) / (T(1) - vv), by_det = T(1) / det;
  }
  /// False for a singular Jacobian, too (infinities and NaN fail the compares).
  auto one_to_one() const { return (uu < T(0.95)) & (vv < T(0.95)) & (det > T(0.02)); }
  /// Rule (2): out points outward by r_out.
  auto beyond_u(V r_u, V r_v) const { return r_u > e_u + uv * (r_v + e_v) * by_v; }
  auto beyond_v(V r_v, V r_u) const { return r_v > e_v + vu * (r_u + e_u) * by_u; }
  /// Largest component of (I - K)^-1 (|r| + e).
  V radius(V r_u, V r_v) const {
    const V a = r_u + e_u, b = r_v + e_v;
    return max(V((T(1) - vv) * a + uv * b), V(vu * a + (T(1) - uu) * b)) * by_det;
  }
};

template <class V>
struct Interval {
  V lo, hi;
  V clamp(V x) const { return min(max(x, lo), hi); }
};

/// Which rays are decided, and how.
template <class V>
struct NewtonOutcome {
  MaskOf<V> hit, miss;
};

/// Clamped Newton steps from (u,v) on the domain, under a contraction, for the rays in `active`. A
/// step whose end is certain to be within `eps` of zero (curvature * step^2) is taken without
/// looking again.
template <class Patch, class V>
[[gnu::always_inline]] inline NewtonOutcome<V> newton_steps(
    const Patch& patch, const Contraction<V>& k, V curvature, Interval<V> in_u, Interval<V> in_v,
    V u, V v, MaskOf<V> active, PatchRoot<V>& out, std::uint32_t& steps) {
  using T = Element<V>;
  const MaskOf<V> none = V{} < V{};
  NewtonOutcome<V> outcome{none, none};
  // Where each ray was seen last, and the step that it took from there.
  V u_seen = u, v_seen = v, u_step{}, v_step{};
  V radius{};
  for (int step = 0; step < 8 && any(active); ++step) {
    const RaySample<V> p = evaluate(patch, u, v);
    steps += std::uint32_t(count(active));
    const V r_u = k.m_uu * p.x + k.m_uv * p.y, r_v = k.m_vu * p.x + k.m_vv * p.y;
    // Which borders (u,v) stands on with F pointing outward.
    const auto out_u = ((u == in_u.lo) & (r_u > V{})) | ((u == in_u.hi) & (r_u < V{}));
    const auto out_v = ((v == in_v.lo) & (r_v > V{})) | ((v == in_v.hi) & (r_v < V{}));
    const V a_u = abs(r_u), a_v = abs(r_v);
    const auto miss = (out_u & k.beyond_u(a_u, select(out_v, V{}, a_v))) |
                      (out_v & k.beyond_v(a_v, select(out_u, V{}, a_u)));
    // Where M is large, F may be within its noise e although x and y are not within theirs yet.
    const auto near = (abs(p.x) <= T(4) * patch.eps_x) & (abs(p.y) <= T(4) * patch.eps_y);
    const auto there = near & (out_u | (a_u <= k.e_u)) & (out_v | (a_v <= k.e_v));
    outcome.miss |= active & miss;
    const MaskOf<V> arrives = active & there & (miss == none);
    outcome.hit |= arrives;
    u_seen = select(active, u, u_seen), v_seen = select(active, v, v_seen);
    radius = select(arrives, k.radius(a_u, a_v), radius);
    active &= (outcome.miss | outcome.hit) == none;
    if (!any(active)) break;
    // Newton step, held inside the domain.
    const V inverse = T(1) / (p.x_u * p.y_v - p.x_v * p.y_u);
    const V du = (p.x_v * p.y - p.y_v * p.x) * inverse, dv = (p.y_u * p.x - p.x_u * p.y) * inverse;
    const V nu = in_u.clamp(u + du), nv = in_v.clamp(v + dv);
    const MaskOf<V> held_u = nu != u + du, held_v = nv != v + dv;
    const V longest = max(abs(du), abs(dv));
    const MaskOf<V> blind = active & (held_u == none) & (held_v == none) &
                            (curvature * longest * longest <= min(patch.eps_x, patch.eps_y));
    outcome.hit |= blind;
    u_step = select(blind, du, u_step), v_step = select(blind, dv, v_step);
    radius = select(blind, k.radius(k.e_u, k.e_v), radius);
    active &= blind == none;
    V next_u = nu, next_v = nv;
    if (any(active & (held_u != held_v))) {
      // A clamped direction hands its share to the other.
      const V f_uu = k.m_uu * p.x_u + k.m_uv * p.y_u, f_uv = k.m_uu * p.x_v + k.m_uv * p.y_v;
      const V f_vu = k.m_vu * p.x_u + k.m_vv * p.y_u, f_vv = k.m_vu * p.x_v + k.m_vv * p.y_v;
      const V slid_u = in_u.clamp(u - (r_u + f_uv * (nv - v)) / f_uu);
      const V slid_v = in_v.clamp(v - (r_v + f_vu * (nu - u)) / f_vv);
      next_u = select(held_v & (held_u == none), slid_u, nu);
      next_v = select(held_u & (held_v == none), slid_v, nv);
    }
    u = next_u, v = next_v;
  }
  const DepthSample<V> d = evaluate_depth(patch, u_seen, v_seen);
  out = {u_seen + u_step, v_seen + v_step, d.z + d.z_u * u_step + d.z_v * v_step, radius, V{}};
  return outcome;
}

/// S8 on whole patches by their first order models, before reading the patches themselves.
template <class V>
struct ModelTest {
  using T = Element<V>;
  Contraction<V> k;
  V u, v;                   // the model's own root
  V reach_u, reach_v;       // if decided, a hit is no farther from it
  MaskOf<V> decided, miss;  // `decided`: at most one hit, which newton_steps finds

  explicit ModelTest(const ProjectedModel<V>& m) : k(m.x_u, m.x_v, m.y_u, m.y_v, m.eps_x, m.eps_y) {
    const T half = T(0.5);
    u = half - (k.m_uu * m.x + k.m_uv * m.y), v = half - (k.m_vu * m.x + k.m_vv * m.y);
    const V a_uu = abs(k.m_uu), a_uv = abs(k.m_uv), a_vu = abs(k.m_vu), a_vv = abs(k.m_vv);
    set(a_uu * m.dx_u + a_uv * m.dy_u, a_uu * m.dx_v + a_uv * m.dy_v, a_vu * m.dx_u + a_vv * m.dy_u,
        a_vu * m.dx_v + a_vv * m.dy_v);
  }
  /// Decides by this K.
  void set(V k_uu, V k_uv, V k_vu, V k_vv) {
    k.set(k_uu, k_uv, k_vu, k_vv);
    decided = k.one_to_one();
    // Krawczyk: every hit is in this box around the root of the model.
    reach_u = T(0.5) * (k.uu + k.uv) + k.e_u, reach_v = T(0.5) * (k.vu + k.vv) + k.e_v;
    miss = decided & ((u + reach_u < T(0)) | (u - reach_u > T(1)) | (v + reach_v < T(0)) |
                      (v - reach_v > T(1)));
  }
};
/// The patch's hit, for the rays in `active`, whose patches the model did not decide to be missed.
template <class Patch, class V>
[[gnu::always_inline]] inline NewtonOutcome<V> newton_on_patch(const Patch& patch,
                                                               const ModelTest<V>& test,
                                                               V curvature, MaskOf<V> active,
                                                               PatchRoot<V>& out,
                                                               std::uint32_t& steps) {
  using T = Element<V>;
  const Interval<V> unit{V{}, V{} + T(1)};
  return newton_steps(patch, test.k, V(T(2) * curvature), unit, unit, unit.clamp(test.u),
                      unit.clamp(test.v), active, out, steps);
}

inline NewtonResult result_of(bool hit, bool miss) {
  return hit ? NewtonResult::hit : miss ? NewtonResult::miss : NewtonResult::undecided;
}
/// Both for one ray; reading the patch counts as a run.
template <class T>
[[gnu::always_inline]] inline NewtonResult newton_on_model(
    const ProjectedModel<T>& m, T curvature, const PatchNet<T>& net, const PatchBump<T>* bump,
    const PatchRay<T>& r, PatchRoot<T>& out, std::uint32_t& runs, std::uint32_t& steps) {
  const ModelTest<T> test(m);
  if (!test.decided) return NewtonResult::undecided;
  if (test.miss) return NewtonResult::miss;
  ++runs;
  const RootPatch<T> root = to_ray_frame(net, bump, r, m);
  const NewtonOutcome<T> o = newton_on_patch(root, test, curvature, true, out, steps);
  return result_of(o.hit, o.miss);
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
  const NewtonOutcome<T> o = newton_steps(root, k, infinity, in_u, in_v, in_u.clamp(start_u),
                                          in_v.clamp(start_v), true, out, steps);
  return result_of(o.hit, o.miss);
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection, the heart. Comes in: a patch and a ray (S1). Goes out: the points where they
// meet, nearest first as far as the order is known. docs/algorithm.md tells the steps.
//
// Binder and Keller 2015, "Stackless Ray Tracing of Patches from Feature-Adaptive Subdivision on
// GPUs", section 2: bisection without a stack, two bit trails, control values recovered from the
// surface. Ours differs in that the bounds are derived (docs/accuracy.md), and in S8.
#pragma once

#include <cstdint>
#include <type_traits>

#include "limitray/intersect/depth_cluster.h"
#include "limitray/intersect/domain.h"
#include "limitray/intersect/newton.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Work done by one or many patch tests.
struct PatchCounters {
  std::uint32_t patch_tests = 0, early_outs = 0, splits = 0, backtracks = 0, newton_runs = 0,
                newton_steps = 0, unresolved = 0;
  std::uint32_t before_ray = 0;  // `splits` when the ray began
};

/// Deepest level a direction is split to: 2^-level is then a few roundings of a parameter.
template <class T>
inline constexpr int max_level = std::is_same_v<T, float> ? 22 : 48;
/// Splits after which a patch counts as unresolved: never reached by a surface that is no curve
/// along the ray.
inline constexpr std::uint32_t max_splits = 1u << 16;
/// The same for further patches of a ray that has done that many: time is bounded a ray, not a
/// patch.
inline constexpr std::uint32_t max_splits_of_rest = 1u << 10;

/// The local frame: x and y are mixed by a 2x2 map built from the patch's own projected tangents,
/// so that x follows u and y follows v. Edge-on, where they are (almost) parallel, a rotation by
/// the longer one. The bounds grow by the map's row sums.
template <class T>
void to_local_frame(RootPatch<T>& p, const ProjectedModel<T>& t) {
  const T det = t.x_u * t.y_v - t.x_v * t.y_u;
  const T lu = t.x_u * t.x_u + t.y_u * t.y_u, lv = t.x_v * t.x_v + t.y_v * t.y_v;
  const T longest = std::sqrt(std::max(lu, lv));
  if (!(longest > 0)) return;
  T m[4];
  if (std::abs(det) > T(1.0 / 8) * std::max(lu, lv)) {
    const T s = longest / det;  // keeps the patch's size, roughly
    m[0] = t.y_v * s, m[1] = -t.x_v * s, m[2] = -t.y_u * s, m[3] = t.x_u * s;
  } else {
    const T a = (lu > lv ? t.x_u : t.x_v) / longest, b = (lu > lv ? t.y_u : t.y_v) / longest;
    m[0] = a, m[1] = b, m[2] = -b, m[3] = a;
  }
  const Net<T> x = p.x;
  p.x = m[0] * x + m[1] * p.y;
  p.y = m[2] * x + m[3] * p.y;
  const Quad<T> bump_x = p.bump_x;
  p.bump_x = m[0] * bump_x + m[1] * p.bump_y;
  p.bump_y = m[2] * bump_x + m[3] * p.bump_y;
  const T eps_x = p.eps_x;
  p.eps_x = (std::abs(m[0]) * eps_x + std::abs(m[1]) * p.eps_y) * T(1.0001);
  p.eps_y = (std::abs(m[2]) * eps_x + std::abs(m[3]) * p.eps_y) * T(1.0001);
}

/// 2^-level.
template <class T>
T interval_size(int level) {
  return T(1) / T(std::uint64_t(1) << level);
}

/// S7 on a small subdomain: the net of the bumps' tangent planes at its middle, w there. A plane is
/// reproduced exactly; what it loses is at most `lost` times each |bump| and is added to `slack`.
template <class T>
Net<T> tangent_planes(const BumpWeights<T>& w, const Quad<T>& bump, T su, T sv, T lost, T& slack) {
  const Quad<T> q = sum4(Quad<T>(w.g * bump), Quad<T>(su * w.g_s * bump),
                         Quad<T>(sv * w.g_t * bump), Quad<T>(lost * abs(bump)));
  const Quad<T> ramp{T(-0.5), T(-1.0 / 6), T(1.0 / 6), T(0.5)};
  slack += q[3];
  return along_rows<T>(q[0] + q[1] * ramp) + along_columns<T>(q[2] * ramp);
}

/// S6 and S7: control values of the subpatch on [u0, u0+su] x [v0, v0+sv], from the root patch.
template <class T>
SubPatch<T> recover(const RootPatch<T>& root, T u0, T v0, T su, T sv) {
  SubPatch<T> s;
  s.u0 = u0, s.v0 = v0, s.size_u = su, s.size_v = sv;
  s.dx = root.eps_x, s.dy = root.eps_y, s.dz = root.eps_z, s.bump_gain = bump_slope<T>;
  const Restriction<T> ru = restriction(u0, u0 + su), rv = restriction(v0, v0 + sv);
  if (!root.gregory) {
    s.x = restrict_uv(root.x, ru, rv);
    s.y = restrict_uv(root.y, ru, rv);
    s.z = restrict_uv(root.z, ru, rv);
    return s;
  }
  const T size = std::max(su, sv);
  if (size <= tangent_plane_size<T>) {
    const BumpWeights<T> w = bump_weights(u0 + su / 2, v0 + sv / 2);
    const T lost = bump_curvature<T> * (size / 2) * (size / 2);
    s.x = restrict_uv(root.x, ru, rv) + tangent_planes(w, root.bump_x, su, sv, lost, s.dx);
    s.y = restrict_uv(root.y, ru, rv) + tangent_planes(w, root.bump_y, su, sv, lost, s.dy);
    s.z = restrict_uv(root.z, ru, rv) + tangent_planes(w, root.bump_z, su, sv, lost, s.dz);
    s.bump_gain = bump_slope_change<T> * (size / 2);
    return s;
  }
  const FrozenBlend<T> f = freeze_blend(u0, v0, su, sv);
  s.x = restrict_uv(root.x + at_interior<T>(f.mid * root.bump_x), ru, rv);
  s.y = restrict_uv(root.y + at_interior<T>(f.mid * root.bump_y), ru, rv);
  s.z = restrict_uv(root.z + at_interior<T>(f.mid * root.bump_z), ru, rv);
  s.dx += sum(f.deviation * abs(root.bump_x));
  s.dy += sum(f.deviation * abs(root.bump_y));
  s.dz += sum(f.deviation * abs(root.bump_z));
  const Quad<T> c = abs(f.mid);
  const T worst = std::max(std::max(c[0], c[1]), std::max(c[2], c[3]));
  s.bump_gain += 2 * worst * bump_slope<T>;
  return s;
}
template <class T, class Index, class Trail>
SubPatch<T> recover(const RootPatch<T>& root, const Domain<Index, Trail>& d) {
  const T su = interval_size<T>(d.level_u), sv = interval_size<T>(d.level_v);
  return recover(root, T(d.index_u) * su, T(d.index_v) * sv, su, sv);
}

/// Size below which Bezier subpatches are recovered instead of split, so that the rounding of at
/// most 16 splits adds up (3 u each).
template <class T>
inline constexpr T split_size = T(1.0 / 256);

/// S3: both halves of a subpatch. A Bezier subpatch is split by de Casteljau; a Gregory one is
/// recovered anew, with tighter blends.
template <class T>
void split(const RootPatch<T>& root, const SubPatch<T>& s, bool across_u, SubPatch<T> (&child)[2]) {
  const T su = across_u ? s.size_u / 2 : s.size_u, sv = across_u ? s.size_v : s.size_v / 2;
  const T u1 = across_u ? s.u0 + su : s.u0, v1 = across_u ? s.v0 : s.v0 + sv;
  if (root.gregory || std::min(s.size_u, s.size_v) <= split_size<T>) {
    child[0] = recover(root, s.u0, s.v0, su, sv);
    child[1] = recover(root, u1, v1, su, sv);
    return;
  }
  child[0] = child[1] = s;
  child[0].size_u = child[1].size_u = su, child[0].size_v = child[1].size_v = sv;
  child[1].u0 = u1, child[1].v0 = v1;
  const auto halves = [&](const Net<T>& n, Net<T>& low, Net<T>& high) {
    if (across_u) {
      const Spread<T> p = spread_columns(n);
      low = restrict_u(p, low_half<T>()), high = restrict_u(p, high_half<T>());
    } else {
      const Spread<T> p = spread_rows(n);
      low = restrict_v(p, low_half<T>()), high = restrict_v(p, high_half<T>());
    }
  };
  halves(s.x, child[0].x, child[1].x);
  halves(s.y, child[0].y, child[1].y);
  halves(s.z, child[0].z, child[1].z);
}

/// The longer one of a subpatch's mean projected tangents, (x,y), and the tangents by u and v along
/// it. Near a silhouette the two are parallel, and the surface lies along it.
template <class T>
struct LongTangent {
  T x, y, by_u, by_v;

  explicit LongTangent(const SubPatch<T>& s) {
    const Quad<T> t = sum4(sum_rows(difference_u(s.x)), sum_rows(difference_u(s.y)),
                           sum_rows(difference_v(s.x)), sum_rows(difference_v(s.y)));
    const bool u_longer = t[0] * t[0] + t[1] * t[1] > t[2] * t[2] + t[3] * t[3];
    x = u_longer ? t[0] : t[2], y = u_longer ? t[1] : t[3];
    by_u = t[0] * x + t[1] * y, by_v = t[2] * x + t[3] * y;
  }
};
/// S2 across the long tangent: there the hull of a subpatch near a silhouette is thin.
template <class T>
bool misses_across(const SubPatch<T>& s) {
  const LongTangent<T> t(s);
  return misses_zero(t.x * s.y - t.y * s.x, std::abs(t.y) * s.dx + std::abs(t.x) * s.dy);
}
/// S3: whether the second half is the nearer one. Near a silhouette the ray meets a subpatch along
/// a curve by_u du + by_v dv = 0; the halves are ordered by depth along it.
template <class T>
bool second_is_nearer(const SubPatch<T>& s, bool across_u) {
  const LongTangent<T> t(s);
  const T z_u = sum(sum_rows(difference_u(s.z))), z_v = sum(sum_rows(difference_v(s.z)));
  const T slope = z_u * t.by_v - z_v * t.by_u;  // by u, times by_v; by v, times -by_u
  return across_u ? slope * t.by_v < 0 : slope * t.by_u > 0;
}
/// S2 for a subpatch.
template <class T>
bool misses(const SubPatch<T>& s, T zmin, T zmax) {
  return misses_zero(s.x, s.dx) || misses_zero(s.y, s.dy) || all_above(s.z, zmax + s.dz) ||
         all_below(s.z, zmin - s.dz) || misses_across(s);
}
/// S3: whether the next split is across u: the direction along which the control values are farther
/// apart, in eps of their component, so that no subpatch gets long and thin, even where all of an
/// edge is one point or a derivative vanishes along it. What freezing a Gregory blend loses falls
/// with the longer side of the domain: where that is most of the box, this side is split.
template <class T, class D>
bool splits_across_u(const RootPatch<T>& root, const SubPatch<T>& s, const D& d) {
  if (d.level_u == max_level<T> || d.level_v == max_level<T>) return d.level_v == max_level<T>;
  const T nx = 1 / root.eps_x, ny = 1 / root.eps_y, nz = 1 / root.eps_z;
  const auto largest = [&](const Net<T>& x, const Net<T>& y, const Net<T>& z) {
    return max_value(max(max(abs(nx * x), abs(ny * y)), abs(nz * z)));
  };
  const T along_u = largest(difference_u(s.x), difference_u(s.y), difference_u(s.z));
  const T along_v = largest(difference_v(s.x), difference_v(s.y), difference_v(s.z));
  if (root.gregory) {
    const T slack = std::max(std::max(s.dx * nx, s.dy * ny), s.dz * nz) - 1;
    if (slack > std::max(along_u, along_v)) return s.size_u >= s.size_v;
  }
  return along_u >= along_v;
}

/// S4: the box of the subpatch, slack included, is as small as the bounds allow to tell: within 3
/// eps in each component.
template <class T>
bool is_point(const RootPatch<T>& root, const SubPatch<T>& s) {
  const auto within = [](const Net<T>& n, T e) { return all_below(n, e) && all_above(n, -e); };
  const T z = s.z.part[0][0];
  return within(s.x, 3 * root.eps_x - s.dx) && within(s.y, 3 * root.eps_y - s.dy) &&
         within(s.z - z, 3 * root.eps_z - s.dz);
}

/// Meets `ray` with a patch. `zmax` is the far end of the ray, lowered by `on_hit` as it likes:
/// on_hit(const PatchRoot<T>&, T& zmax) returns true to end the search.
///
/// This is the reference: bisection, with S8 on the subpatches where `use_newton`.
template <class T, bool use_newton, class OnHit>
[[gnu::noinline]] void bisect_patch(const PatchNet<T>& net, const PatchBump<T>* bump,
                                    const ProjectedModel<T>& model, const PatchRay<T>& ray, T& zmax,
                                    OnHit&& on_hit, PatchCounters& count) {
  RootPatch<T> root = to_ray_frame(net, bump, ray, model);  // S1
  if (misses(root, ray.zmin, zmax)) {                       // S2: sign test
    ++count.early_outs;
    return;
  }
  to_local_frame(root, model);
  if (misses(root, ray.zmin, zmax)) {  // S2 in the local frame
    ++count.early_outs;
    return;
  }

  std::conditional_t<std::is_same_v<T, float>, Domain<std::uint32_t, std::uint64_t>,
                     Domain<std::uint64_t, TrailOf128>>
      domain;
  SubPatch<T> sub{root.x,
                  root.y,
                  root.z,
                  root.eps_x + bump_reach<T>(root.bump_x),
                  root.eps_y + bump_reach<T>(root.bump_y),
                  root.eps_z + bump_reach<T>(root.bump_z),
                  0,
                  0,
                  1,
                  1,
                  bump_slope<T>};
  DepthCluster<T> cluster;
  const std::uint32_t done_by_ray = std::min(max_splits, count.splits - count.before_ray);
  const std::uint32_t last_split =
      count.splits + std::max(max_splits - done_by_ray, max_splits_of_rest);
  while (true) {
    bool done = false;  // with this subdomain
    // The whole patch was tried by its model; two splits later it pays to try again.
    if (use_newton && domain.splits() > 0 && domain.splits() % 2 == 0) {
      PatchRoot<T> r{};
      const NewtonResult result =
          newton_on_subpatch(root, sub, r, count.newton_runs, count.newton_steps);  // S8
      done = result != NewtonResult::undecided;
      r.spread = r.radius * model.z_slope;
      if (result == NewtonResult::hit && on_hit(r, zmax)) return;
    }
    const int shallower = std::min(domain.level_u, domain.level_v);
    const bool at_end = !done && (shallower == max_level<T> || is_point(root, sub));
    if (!done && (at_end || cluster.is_open())) done = cluster.absorb(sub, at_end);
    if (!done && at_end) {  // S4: terminate
      const T u = sub.u0 + sub.size_u / 2, v = sub.v0 + sub.size_v / 2;
      const T z = evaluate_depth(root, u, v).z;
      // A point before the ray's start is no hit, and cannot stand for a cluster that reaches past
      // it.
      if (z > ray.z_start) {
        if (cluster.report(on_hit, zmax)) return;
        cluster.start({u, v, z, 0}, sub);
      }
      done = true;
    }
    if (!done && count.splits == last_split) {
      ++count.unresolved;
      cluster.report(on_hit, zmax);
      return;
    }
    if (!done) {  // S3: split
      ++count.splits;
      SubPatch<T> child[2];
      const bool across_u = splits_across_u(root, sub, domain);
      split(root, sub, across_u, child);
      const bool hit0 = !misses(child[0], ray.zmin, zmax), hit1 = !misses(child[1], ray.zmin, zmax);
      if (hit0 || hit1) {
        // The nearer child first; its sibling goes into the trail.
        const bool second = hit0 && hit1 ? second_is_nearer(sub, across_u) : hit1;
        domain.descend(across_u, second, hit0 && hit1);
        sub = child[second];
        continue;
      }
    }
    do {  // S5: next subdomain
      if (!domain.next()) {
        cluster.report(on_hit, zmax);
        return;
      }
      ++count.backtracks;
      sub = recover(root, domain);  // S6, S7
    } while (misses(sub, ray.zmin, zmax));
  }
}

/// Meets `ray` with a patch as above: S8 on the whole patch by its model first, where `use_newton`.
template <class T, bool use_newton, class OnHit>
[[gnu::always_inline]] inline void intersect_patch(const PatchNet<T>& net, const PatchBump<T>* bump,
                                                   const PatchModel<T>& model,
                                                   const PatchRay<T>& ray, T& zmax, OnHit&& on_hit,
                                                   PatchCounters& count) {
  ++count.patch_tests;
  const ProjectedModel<T> m = project(model, ray);
  if constexpr (use_newton) {
    if (m.misses(ray.zmin, zmax)) return;
    PatchRoot<T> r{};
    const NewtonResult result = newton_on_model(m, model.curvature, net, bump, ray, r,
                                                count.newton_runs, count.newton_steps);
    r.spread = r.radius * m.z_slope;
    if (result == NewtonResult::hit) on_hit(r, zmax);
    if (result != NewtonResult::undecided) return;
  }
  bisect_patch<T, use_newton>(net, bump, m, ray, zmax, on_hit, count);
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection, S2 and S8 for several rays at once. Comes in: a ray in each lane, and the
// patch at which it stands. Goes out: who meets his patch, who does not, who is left to bisection.
#pragma once

#include "limitray/intersect/intersect_patch.h"
#include "limitray/intersect/lane_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// K of part of a patch from its net: it knows what the bounds of a model do not, how the
/// derivatives of two components vary together. `parts` is 1 / size of the part.
struct NetContraction {
  Lanes uu{}, uv{}, vu{}, vv{};

  NetContraction(const LanePatch& p, const LaneNet& n, float parts, const Contraction<Lanes>& k) {
    const float scale = 3 * parts;
    const Lanes m_uu = scale * k.m_uu, m_uv = scale * k.m_uv;
    const Lanes m_vu = scale * k.m_vu, m_vv = scale * k.m_vv;
    for (int i = 0; i < 16; ++i) {
      if (i % 4 < 3) {
        const Lanes dx = n.x[i + 1] - n.x[i], dy = n.y[i + 1] - n.y[i];
        uu = max(uu, abs(Lanes(m_uu * dx + m_uv * dy - 1.0f)));
        vu = max(vu, abs(Lanes(m_vu * dx + m_vv * dy)));
      }
      if (i < 12) {
        const Lanes dx = n.x[i + 4] - n.x[i], dy = n.y[i + 4] - n.y[i];
        uv = max(uv, abs(Lanes(m_uu * dx + m_uv * dy)));
        vv = max(vv, abs(Lanes(m_vu * dx + m_vv * dy - 1.0f)));
      }
    }
    // Each value of the net may be off by eps, its differences by twice that; and the bumps' part.
    Lanes more_u = 2 * scale * k.e_u, more_v = 2 * scale * k.e_v;
    if (p.any_bump) {
      const Lanes x = bump_slope<float> * sum_abs(p.bump_x);
      const Lanes y = bump_slope<float> * sum_abs(p.bump_y);
      more_u += abs(k.m_uu) * x + abs(k.m_uv) * y;
      more_v += abs(k.m_vu) * x + abs(k.m_vv) * y;
    }
    uu += more_u, uv += more_u, vu += more_v, vv += more_v;
  }
};
/// Decides the patches in `undecided` once more, by the K of their own nets. The others keep
/// theirs, so that no ray's hit depends on its neighbours.
inline void tighten(const LanePatch& p, LaneMask undecided, ModelTest<Lanes>& test) {
  const Contraction<Lanes>& k = test.k;
  const NetContraction net(p, p, 1, k);
  const auto either = [&](Lanes model, Lanes by_net) {
    return select(undecided, min(model, by_net), model);
  };
  test.set(either(k.uu, net.uu), either(k.uv, net.uv), either(k.vu, net.vu), either(k.vv, net.vv));
}

/// S2 for each lane on part of its patch: in the frame of the ray and in the local frame F.
inline LaneMask misses(const LanePatch& p, const LaneNet& n, const Contraction<Lanes>& k) {
  const auto beyond = [](Lanes lo, Lanes hi, Lanes e) { return (lo > e) | (hi < -e); };
  Lanes x_lo = n.x[0], x_hi = x_lo, y_lo = n.y[0], y_hi = y_lo;
  Lanes u_lo = k.m_uu * x_lo + k.m_uv * y_lo, u_hi = u_lo;
  Lanes v_lo = k.m_vu * x_lo + k.m_vv * y_lo, v_hi = v_lo;
  for (int i = 1; i < 16; ++i) {
    const Lanes f_u = k.m_uu * n.x[i] + k.m_uv * n.y[i], f_v = k.m_vu * n.x[i] + k.m_vv * n.y[i];
    x_lo = min(x_lo, n.x[i]), x_hi = max(x_hi, n.x[i]);
    y_lo = min(y_lo, n.y[i]), y_hi = max(y_hi, n.y[i]);
    u_lo = min(u_lo, f_u), u_hi = max(u_hi, f_u);
    v_lo = min(v_lo, f_v), v_hi = max(v_hi, f_v);
  }
  Lanes e_x = p.eps_x, e_y = p.eps_y, e_u = k.e_u, e_v = k.e_v;
  if (p.any_bump) {
    const Lanes x = bump_height<float> * sum_abs(p.bump_x),
                y = bump_height<float> * sum_abs(p.bump_y);
    e_x += x, e_u += abs(k.m_uu) * x + abs(k.m_uv) * y;
    e_y += y, e_v += abs(k.m_vu) * x + abs(k.m_vv) * y;
  }
  return beyond(x_lo, x_hi, e_x) | beyond(y_lo, y_hi, e_y) | beyond(u_lo, u_hi, e_u) |
         beyond(v_lo, v_hi, e_v);
}

/// What the models say, one bit a lane: no hit between zmin and zmax; at most one hit.
struct LaneVerdict {
  unsigned missed, decided;
};
inline LaneVerdict test_models(const LanePatches& p) {
  const LaneFrames frames(p);
  const LaneModels m = project(p, frames);
  const ModelTest<Lanes> test(m.projected);
  return {p.waiting & bits_of(test.miss | m.projected.misses(frames.zmin, frames.zmax)),
          p.waiting & bits_of(test.decided)};
}

/// One bit a lane; who is in neither is undecided. `u`, `v`, `z`, `spread`: PatchRoot's, for `met`.
struct LaneOutcome {
  unsigned met = 0, missed = 0;
  alignas(Lanes) float u[lane_count], v[lane_count], z[lane_count], spread[lane_count];

  PatchRoot<float> root(int lane) const { return {u[lane], v[lane], z[lane], 0, spread[lane]}; }
  void set(const NewtonOutcome<Lanes>& o, const PatchRoot<Lanes>& root, Lanes z_slope) {
    met = bits_of(o.hit), missed |= bits_of(o.miss);
    store_lanes(u, root.u), store_lanes(v, root.v), store_lanes(z, root.z);
    store_lanes(spread, root.radius * z_slope);
  }
};

/// S8 on whole patches, and on parts of them.
class LaneSolver {
 public:
  explicit LaneSolver(const LanePatches& p)
      : waiting_(p.waiting), frames_(p), m_(project(p, frames_)) {
    to_ray_frame(p, frames_, m_.projected, patch_);
  }

  LaneOutcome solve(PatchCounters& count) const {
    LaneOutcome out;
    ModelTest<Lanes> test(m_.projected);
    if (const unsigned undecided = waiting_ & ~bits_of(test.decided)) {
      tighten(patch_, mask_of(undecided), test);
      const unsigned culled =
          undecided & ~bits_of(test.miss) & bits_of(misses(patch_, patch_, test.k));
      count.early_outs += std::uint32_t(std::popcount(culled));
      out.missed = culled | (waiting_ & bits_of(test.miss));
    }
    const unsigned decided = waiting_ & bits_of(test.decided) & ~out.missed;
    count.newton_runs += std::uint32_t(std::popcount(decided));
    PatchRoot<Lanes> root;
    const NewtonOutcome<Lanes> o =
        newton_on_patch(patch_, test, m_.curvature, mask_of(decided), root, count.newton_steps);
    out.set(o, root, m_.projected.z_slope);
    return out;
  }

  /// S3: the same on a quarter, for the rays in `waiting`: bit 0 of `quarter` is its half of u.
  LaneOutcome solve_quarter(int quarter, unsigned waiting, PatchCounters& count) const {
    const float u0 = quarter & 1 ? 0.5f : 0.0f, v0 = quarter & 2 ? 0.5f : 0.0f;
    const Lanes u = Lanes{} + (u0 + 0.25f), v = Lanes{} + (v0 + 0.25f);
    LaneNet net;
    take_quarter(patch_.x, quarter, net.x);
    take_quarter(patch_.y, quarter, net.y);
    take_quarter(patch_.z, quarter, net.z);
    const RaySample<Lanes> p = evaluate(patch_, u, v);
    Contraction<Lanes> k(p.x_u, p.x_v, p.y_u, p.y_v, patch_.eps_x, patch_.eps_y);
    const NetContraction bounds(patch_, net, 2, k);
    k.set(bounds.uu, bounds.uv, bounds.vu, bounds.vv);

    LaneOutcome out;
    out.missed = waiting & bits_of(misses(patch_, net, k) |
                                   misses_plane(net, p, evaluate_depth(patch_, u, v)));
    const unsigned decided = waiting & bits_of(k.one_to_one()) & ~out.missed;
    if (!decided) return out;
    count.newton_runs += std::uint32_t(std::popcount(decided));
    const Interval<Lanes> in_u{Lanes{} + u0, Lanes{} + (u0 + 0.5f)};
    const Interval<Lanes> in_v{Lanes{} + v0, Lanes{} + (v0 + 0.5f)};
    PatchRoot<Lanes> root;
    const NewtonOutcome<Lanes> o = newton_steps(patch_, k, Lanes(2.0f * m_.curvature), in_u, in_v,
                                                in_u.clamp(u - (k.m_uu * p.x + k.m_uv * p.y)),
                                                in_v.clamp(v - (k.m_vu * p.x + k.m_vv * p.y)),
                                                mask_of(decided), root, count.newton_steps);
    out.set(o, root, m_.projected.z_slope);
    return out;
  }

 private:
  /// S2: whether the ray, where it passes the net's depths, is above or below the net as seen along
  /// the tangent plane at (p, d). Any direction n would do: with that one the net is thin.
  LaneMask misses_plane(const LaneNet& n, const RaySample<Lanes>& p,
                        const DepthSample<Lanes>& d) const {
    const Lanes n_x = p.y_u * d.z_v - d.z_u * p.y_v, n_y = d.z_u * p.x_v - p.x_u * d.z_v;
    const Lanes n_z = p.x_u * p.y_v - p.x_v * p.y_u;
    Lanes lo = n_x * n.x[0] + n_y * n.y[0] + n_z * n.z[0], hi = lo, z_lo = n.z[0], z_hi = z_lo;
    for (int i = 1; i < 16; ++i) {
      const Lanes h = n_x * n.x[i] + n_y * n.y[i] + n_z * n.z[i];
      lo = min(lo, h), hi = max(hi, h);
      z_lo = min(z_lo, n.z[i]), z_hi = max(z_hi, n.z[i]);
    }
    Lanes e_x = patch_.eps_x, e_y = patch_.eps_y, e_z = m_.projected.eps_z;
    if (patch_.any_bump) {
      e_x += bump_height<float> * sum_abs(patch_.bump_x),
          e_y += bump_height<float> * sum_abs(patch_.bump_y);
      e_z += bump_height<float> * sum_abs(patch_.bump_z);
    }
    // Each eps is at least 64 u of its component: rounding of the products and sums is in 1.5.
    const Lanes e = 1.5f * (abs(n_x) * e_x + abs(n_y) * e_y + abs(n_z) * e_z);
    const Lanes from = max(frames_.zmin, Lanes(z_lo - e_z)),
                to = min(frames_.zmax, Lanes(z_hi + e_z));
    const Lanes a = n_z * from, b = n_z * to;
    return (from > to) | (min(a, b) > hi + e) | (max(a, b) < lo - e);
  }

  unsigned waiting_;
  LaneFrames frames_;
  LaneModels m_;
  LanePatch patch_;
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection, S2 and S8 for several rays at once. Comes in: a ray in each lane, and the
// patch at which it stands. Goes out: who meets his patch, who does not, who is left to bisection.
#pragma once

#include "limitray/intersect/intersect_patch.h"
#include "limitray/intersect/lane_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Decides the patches in `undecided` once more, by the K of their own nets: it knows what the
/// bounds of the model do not, how the derivatives of two components vary together. The others keep
/// theirs, so that no ray's hit depends on its neighbours.
inline void tighten(const LanePatch& p, LaneMask undecided, ModelTest<Lanes>& test) {
  const Contraction<Lanes>& k = test.k;
  const Lanes uu = 3.0f * k.m_uu, uv = 3.0f * k.m_uv, vu = 3.0f * k.m_vu, vv = 3.0f * k.m_vv;
  Lanes k_uu{}, k_uv{}, k_vu{}, k_vv{};
  for (int i = 0; i < 16; ++i) {
    if (i % 4 < 3) {
      const Lanes dx = p.x[i + 1] - p.x[i], dy = p.y[i + 1] - p.y[i];
      k_uu = max(k_uu, abs(Lanes(uu * dx + uv * dy - 1.0f)));
      k_vu = max(k_vu, abs(Lanes(vu * dx + vv * dy)));
    }
    if (i < 12) {
      const Lanes dx = p.x[i + 4] - p.x[i], dy = p.y[i + 4] - p.y[i];
      k_uv = max(k_uv, abs(Lanes(uu * dx + uv * dy)));
      k_vv = max(k_vv, abs(Lanes(vu * dx + vv * dy - 1.0f)));
    }
  }
  // Each value of the net may be off by eps, its differences by twice that; and the bumps' part.
  Lanes more_u = 6.0f * k.e_u, more_v = 6.0f * k.e_v;
  if (p.any_bump) {
    const Lanes x = bump_slope<float> * sum_abs(p.bump_x),
                y = bump_slope<float> * sum_abs(p.bump_y);
    more_u += abs(k.m_uu) * x + abs(k.m_uv) * y;
    more_v += abs(k.m_vu) * x + abs(k.m_vv) * y;
  }
  const auto either = [&](Lanes model, Lanes net) {
    return select(undecided, min(model, net), model);
  };
  test.set(either(k.uu, k_uu + more_u), either(k.uv, k_uv + more_u), either(k.vu, k_vu + more_v),
           either(k.vv, k_vv + more_v));
}

/// S2 for each lane: in the frame of the ray and in the local frame F.
inline LaneMask misses(const LanePatch& p, const Contraction<Lanes>& k) {
  const auto beyond = [](Lanes lo, Lanes hi, Lanes e) { return (lo > e) | (hi < -e); };
  Lanes x_lo = p.x[0], x_hi = x_lo, y_lo = p.y[0], y_hi = y_lo;
  Lanes u_lo = k.m_uu * x_lo + k.m_uv * y_lo, u_hi = u_lo;
  Lanes v_lo = k.m_vu * x_lo + k.m_vv * y_lo, v_hi = v_lo;
  for (int i = 1; i < 16; ++i) {
    const Lanes f_u = k.m_uu * p.x[i] + k.m_uv * p.y[i], f_v = k.m_vu * p.x[i] + k.m_vv * p.y[i];
    x_lo = min(x_lo, p.x[i]), x_hi = max(x_hi, p.x[i]);
    y_lo = min(y_lo, p.y[i]), y_hi = max(y_hi, p.y[i]);
    u_lo = min(u_lo, f_u), u_hi = max(u_hi, f_u);
    v_lo = min(v_lo, f_v), v_hi = max(v_hi, f_v);
  }
  Lanes e_x = p.eps_x, e_y = p.eps_y, e_u = k.e_u, e_v = k.e_v;
  if (p.any_bump) {
    const Lanes x = 0.067f * sum_abs(p.bump_x), y = 0.067f * sum_abs(p.bump_y);
    e_x += x, e_u += abs(k.m_uu) * x + abs(k.m_uv) * y;
    e_y += y, e_v += abs(k.m_vu) * x + abs(k.m_vv) * y;
  }
  return beyond(x_lo, x_hi, e_x) | beyond(y_lo, y_hi, e_y) | beyond(u_lo, u_hi, e_u) |
         beyond(v_lo, v_hi, e_v);
}

/// The patches at which rays stand.
struct LanePatches {
  const PatchModel<float>* models[lane_count];
  const PatchNet<float>* nets[lane_count];
  const PatchBump<float>* bumps[lane_count];  // null for a Bezier patch
  const PatchRay<float>* rays[lane_count];
  bool any_bump = false;

  void set(int lane, const PatchModel<float>* model, const PatchNet<float>* net,
           const PatchBump<float>* bump, const PatchRay<float>* ray) {
    models[lane] = model, nets[lane] = net, bumps[lane] = bump, rays[lane] = ray;
    any_bump |= bump != nullptr;
  }
};
/// One bit a lane; who is in neither is undecided. `u`, `v`, `z`, `spread`: PatchRoot's, for `met`.
struct LaneOutcome {
  unsigned met = 0, missed = 0;
  alignas(Lanes) float u[lane_count], v[lane_count], z[lane_count], spread[lane_count];
};

/// S8 on whole patches, for the rays in `waiting`; `frames` are those of `p.rays`.
inline LaneOutcome newton_on_models(const LanePatches& p, const LaneFrames& frames,
                                    unsigned waiting, PatchCounters& count) {
  LaneOutcome out;
  count.patch_tests += std::uint32_t(std::popcount(waiting));
  const LaneModels m = project(p.models, frames);
  ModelTest<Lanes> test(m.projected);
  out.missed = waiting & bits_of(test.miss);
  if (waiting == out.missed) return out;

  LanePatch patch;
  to_ray_frame(p.nets, p.rays, frames, m.projected, patch);
  if (p.any_bump) bumps_to_ray_frame(p.bumps, p.rays, frames, patch);
  if (const unsigned undecided = waiting & ~bits_of(test.decided)) {
    tighten(patch, mask_of(undecided), test);
    const unsigned culled = undecided & ~bits_of(test.miss) & bits_of(misses(patch, test.k));
    count.early_outs += std::uint32_t(std::popcount(culled));
    out.missed = culled | (waiting & bits_of(test.miss));
  }
  const unsigned decided = waiting & bits_of(test.decided) & ~out.missed;
  count.newton_runs += std::uint32_t(std::popcount(decided));
  PatchRoot<Lanes> root;
  const NewtonOutcome<Lanes> o =
      newton_on_patch(patch, test, m.curvature, mask_of(decided), root, count.newton_steps);
  out.met = bits_of(o.hit), out.missed |= bits_of(o.miss);
  store_lanes(out.u, root.u), store_lanes(out.v, root.v), store_lanes(out.z, root.z);
  store_lanes(out.spread, root.radius * m.projected.z_slope);
  return out;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

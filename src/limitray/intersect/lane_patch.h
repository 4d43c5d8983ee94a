// Stage: intersection, S1 and S8 for several rays at once. Comes in: a ray in each lane, and a
// patch for each. Goes out: their models and nets in the frames of their rays, lane by lane.
//
// The formulas are those of root_patch.h: `project` is the very same, `evaluate` sums the weighted
// control values by rows, then columns.
#pragma once

#include "limitray/intersect/root_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// PatchRay's frame, one for each lane.
struct LaneFrames {
  Lanes org_x, org_y, org_z, shear_x, shear_y, sign_z, eps, eps_z;
  LaneMask axis_z;

  void set(int lane, const PatchRay<float>& r) {
    org_x[lane] = r.org_x, org_y[lane] = r.org_y, org_z[lane] = r.org_z;
    shear_x[lane] = r.shear_x, shear_y[lane] = r.shear_y, sign_z[lane] = r.sign_z;
    eps[lane] = r.eps, eps_z[lane] = r.eps_z;
    axis_z[lane] = r.axis_z;
  }
};

/// The models of the lanes' patches in their frames, and their curvatures.
struct LaneModels {
  ProjectedModel<Lanes> projected;
  Lanes curvature;
};
inline LaneModels project(const PatchModel<float>* const (&models)[lane_count],
                          const LaneFrames& frames) {
  const float* rows[lane_count];
  for (int j = 0; j < lane_count; ++j) rows[j] = &models[j]->axis[0].p;
  Lanes m[16];
  load_by_lane(rows, m);
  struct Axis {
    Lanes p, p_u, p_v, d_u, d_v;
  };
  // Components in the order of each ray's axes.
  const LaneMask z_is_0 = frames.axis_z == 0, z_is_1 = frames.axis_z == 1;
  const auto axis = [&](int if_0, int if_1, int if_2) {
    const auto pick = [&](int k) {
      return select(z_is_0, m[5 * if_0 + k], select(z_is_1, m[5 * if_1 + k], m[5 * if_2 + k]));
    };
    return Axis{pick(0), pick(1), pick(2), pick(3), pick(4)};
  };
  return {project(axis(1, 2, 0), axis(2, 0, 1), axis(0, 1, 2), frames), m[15]};
}

/// A patch in each lane, in the frame of its ray. The bumps are zero for Bezier patches, and say
/// nothing if there is no other.
struct LanePatch {
  Lanes x[16], y[16], z[16];
  Lanes eps_x, eps_y;
  bool any_bump = false;
  Lanes bump_x[4], bump_y[4], bump_z[4];
};
inline void to_ray_frame(const PatchNet<float>* const (&nets)[lane_count],
                         const PatchRay<float>* const (&rays)[lane_count], const LaneFrames& frames,
                         const ProjectedModel<Lanes>& m, LanePatch& p) {
  const float *x[lane_count], *y[lane_count], *z[lane_count];
  for (int j = 0; j < lane_count; ++j) {
    x[j] = nets[j]->c[rays[j]->axis_x];
    y[j] = nets[j]->c[rays[j]->axis_y];
    z[j] = nets[j]->c[rays[j]->axis_z];
  }
  load_by_lane(x, p.x);
  load_by_lane(y, p.y);
  load_by_lane(z, p.z);
  for (int i = 0; i < 16; ++i) {
    const Lanes depth = p.z[i] - frames.org_z;
    p.x[i] = p.x[i] - frames.org_x + frames.shear_x * depth;
    p.y[i] = p.y[i] - frames.org_y + frames.shear_y * depth;
    p.z[i] = frames.sign_z * depth;
  }
  p.eps_x = m.eps_x, p.eps_y = m.eps_y;
}
/// The same for the bumps; null for a Bezier patch.
inline void bumps_to_ray_frame(const PatchBump<float>* const (&bumps)[lane_count],
                               const PatchRay<float>* const (&rays)[lane_count],
                               const LaneFrames& frames, LanePatch& p) {
  p.any_bump = true;
  for (int k = 0; k < 4; ++k) {
    alignas(Lanes) float x[lane_count], y[lane_count], z[lane_count];
    for (int j = 0; j < lane_count; ++j) {
      const auto at = [&](int axis) { return bumps[j] ? bumps[j]->c[axis][k] : 0.0f; };
      x[j] = at(rays[j]->axis_x), y[j] = at(rays[j]->axis_y), z[j] = at(rays[j]->axis_z);
    }
    const Lanes depth = load_lanes(z);
    p.bump_x[k] = load_lanes(x) + frames.shear_x * depth;
    p.bump_y[k] = load_lanes(y) + frames.shear_y * depth;
    p.bump_z[k] = frames.sign_z * depth;
  }
}
inline Lanes sum_abs(const Lanes (&bump)[4]) {
  return abs(bump[0]) + abs(bump[1]) + abs(bump[2]) + abs(bump[3]);
}

/// `bernstein` and `bernstein_derivative` for each lane.
struct LaneWeights {
  Lanes value[4], slope[4];

  explicit LaneWeights(Lanes u) {
    constexpr float c[4][4] = {{0.125f, -0.75f, 1.5f, -1},
                               {0.375f, -0.75f, -1.5f, 3},
                               {0.375f, 0.75f, -1.5f, -3},
                               {0.125f, 0.75f, 1.5f, 1}};
    const Lanes r = u - 0.5f;
    for (int i = 0; i < 4; ++i) {
      value[i] = c[i][0] + r * (c[i][1] + r * (c[i][2] + r * c[i][3]));
      slope[i] = c[i][1] + r * (2 * c[i][2] + r * (3 * c[i][3]));
    }
  }
};
[[gnu::always_inline]] inline Lanes weighted(const Lanes (&w)[4], Lanes a, Lanes b, Lanes c,
                                             Lanes d) {
  return w[0] * a + w[1] * b + (w[2] * c + w[3] * d);
}
/// One component at (u,v), and its derivatives.
[[gnu::always_inline]] inline void evaluate(const Lanes (&n)[16], const LaneWeights& u,
                                            const LaneWeights& v, Lanes& p, Lanes& p_u,
                                            Lanes& p_v) {
  Lanes row[4], row_u[4];
  for (int j = 0; j < 4; ++j) {
    row[j] = weighted(u.value, n[4 * j], n[4 * j + 1], n[4 * j + 2], n[4 * j + 3]);
    row_u[j] = weighted(u.slope, n[4 * j], n[4 * j + 1], n[4 * j + 2], n[4 * j + 3]);
  }
  p = weighted(v.value, row[0], row[1], row[2], row[3]);
  p_u = weighted(v.value, row_u[0], row_u[1], row_u[2], row_u[3]);
  p_v = weighted(v.slope, row[0], row[1], row[2], row[3]);
}
/// `bump_weights` for each lane: one corner after the other.
struct LaneBumpWeights {
  Lanes g[4], g_s[4], g_t[4];

  LaneBumpWeights(Lanes s, Lanes t) {
    for (int k = 0; k < 4; ++k) {
      const bool right = k == 1 || k == 2, upper = k >= 2;
      const Lanes a = right ? 1.0f - s : s, b = upper ? 1.0f - t : t;
      const Lanes sum = max(Lanes(a + b), Lanes(Lanes{} + std::numeric_limits<float>::min()));
      const Lanes wa = a / sum, wb = b / sum, w = wa - wb, na = 1.0f - a, nb = 1.0f - b;
      const Lanes squares = na * na * nb * nb;
      const Lanes da = b * w * na * (1.0f - 3.0f * a) * nb * nb + 2.0f * squares * a * wb * wb;
      const Lanes db = a * w * nb * (1.0f - 3.0f * b) * na * na - 2.0f * squares * b * wa * wa;
      g[k] = 9.0f * a * b * squares * w;
      g_s[k] = (right ? -9.0f : 9.0f) * da, g_t[k] = (upper ? -9.0f : 9.0f) * db;
    }
  }
};
/// Adds the bumps of one component.
inline void add_bumps(const Lanes (&bump)[4], const LaneBumpWeights& w, Lanes& p, Lanes& p_u,
                      Lanes& p_v) {
  p += weighted(w.g, bump[0], bump[1], bump[2], bump[3]);
  p_u += weighted(w.g_s, bump[0], bump[1], bump[2], bump[3]);
  p_v += weighted(w.g_t, bump[0], bump[1], bump[2], bump[3]);
}

/// Rounding as in root_patch.h: sums of four products twice are no less exact than one of 16.
[[gnu::always_inline]] inline RaySample<Lanes> evaluate(const LanePatch& p, Lanes u, Lanes v) {
  const LaneWeights w_u(u), w_v(v);
  RaySample<Lanes> s;
  evaluate(p.x, w_u, w_v, s.x, s.x_u, s.x_v);
  evaluate(p.y, w_u, w_v, s.y, s.y_u, s.y_v);
  if (p.any_bump) {
    const LaneBumpWeights w(u, v);
    add_bumps(p.bump_x, w, s.x, s.x_u, s.x_v);
    add_bumps(p.bump_y, w, s.y, s.y_u, s.y_v);
  }
  return s;
}
[[gnu::always_inline]] inline DepthSample<Lanes> evaluate_depth(const LanePatch& p, Lanes u,
                                                                Lanes v) {
  DepthSample<Lanes> s;
  evaluate(p.z, LaneWeights(u), LaneWeights(v), s.z, s.z_u, s.z_v);
  if (p.any_bump) add_bumps(p.bump_z, LaneBumpWeights(u, v), s.z, s.z_u, s.z_v);
  return s;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

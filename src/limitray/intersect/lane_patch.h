// Stage: intersection, S1 and S8 for several rays at once. Comes in: a ray in each lane, and a
// patch for each. Goes out: their models and nets in the frames of their rays, lane by lane.
//
// The formulas are those of root_patch.h: `project` is the very same, `evaluate` sums the weighted
// control values by rows, then columns.
#pragma once

#include "limitray/intersect/kernels.h"
#include "limitray/intersect/root_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// The axis along which a ray's direction is longest, and the signs of the direction.
struct RayKind {
  static constexpr int count = 24;
  int axis_z;
  unsigned signs;  // one bit an axis along which the ray goes down

  explicit RayKind(int number) : axis_z(number / 8), signs(unsigned(number) % 8) {}
  int axis_x() const { return (axis_z + 1) % 3; }
  int axis_y() const { return (axis_z + 2) % 3; }
  float sign_z() const { return signs >> axis_z & 1 ? -1.0f : 1.0f; }
};

/// What the lanes read of a PatchRay, beside its kind.
struct alignas(32) LaneRay {
  float org_x, org_y, org_z, shear_x, shear_y, eps, zmin, zmax;
};

/// A ray and a patch whose box it meets: its place among the LaneRays, its RayKind's number, and
/// the patch's place in the mesh.
struct Meeting {
  std::uint32_t ray : 24, kind : 8;
  std::uint32_t leaf;
};
static_assert(sizeof(Meeting) == 8);

/// Meetings, one in each lane.
struct LanePatches {
  const LaneRay* rays;
  unsigned waiting;  // the lanes that have a meeting, one bit a lane
  bool one_kind;     // all rays are of one kind
  bool same;         // and at one patch
  Meeting of[lane_count];
  const GeometryView<float>* mesh[lane_count];

  /// mesh_of(ray) is the mesh that a ray meets.
  template <class MeshOf>
  LanePatches(const LaneRay* r, const Meeting* m, int count, MeshOf&& mesh_of)
      : rays(r), waiting((1u << count) - 1) {
    std::uint32_t kinds = 0, leaves = 0;
    bool meshes = true;
    for (int j = 0; j < lane_count; ++j) {
      // A lane without a ray repeats another one's meeting; nobody looks at what comes out.
      of[j] = m[j < count ? j : 0];
      mesh[j] = mesh_of(of[j].ray);
      kinds |= of[j].kind ^ of[0].kind, leaves |= of[j].leaf ^ of[0].leaf;
      meshes &= mesh[j] == mesh[0];
    }
    one_kind = kinds == 0, same = meshes && (kinds | leaves) == 0;
  }
  RayKind kind(int lane) const { return RayKind(of[lane].kind); }
  const PatchModel<float>& model(int lane) const { return mesh[lane]->models[of[lane].leaf]; }
  const PatchNet<float>& net(int lane) const { return mesh[lane]->nets[of[lane].leaf]; }
  /// Null for a Bezier patch.
  const PatchBump<float>* bump(int lane) const { return bump_of(*mesh[lane], of[lane].leaf); }
};

/// PatchRay's frame, one for each lane.
struct LaneFrames {
  Lanes org_x, org_y, org_z, shear_x, shear_y, sign_z, zmin, zmax, eps, eps_z;

  explicit LaneFrames(const LanePatches& p) {
    const float* rows[lane_count];
    for (int j = 0; j < lane_count; ++j) rows[j] = &p.rays[p.of[j].ray].org_x;
    Lanes m[8];
    load_by_lane(rows, m);
    org_x = m[0], org_y = m[1], org_z = m[2], shear_x = m[3], shear_y = m[4];
    eps = eps_z = m[5];  // eps_z is no larger
    zmin = m[6], zmax = m[7];
    sign_z = p.one_kind ? p.kind(0).sign_z() - Lanes{} : signs_z(p);
  }

 private:
  [[gnu::noinline]] static Lanes signs_z(const LanePatches& p) {
    unsigned down = 0;
    for (int j = 0; j < lane_count; ++j) down |= unsigned(p.kind(j).sign_z() < 0) << j;
    return select(mask_of(down), Lanes{} - 1.0f, Lanes{} + 1.0f);
  }
};

/// Values of the lanes' patches, lane by lane; `same` if all are one patch.
inline void load_values(const float* const (&rows)[lane_count], bool same, Lanes (&out)[16]) {
  if (!same) return load_by_lane(rows, out);
  for (int i = 0; i < 16; ++i) out[i] = rows[0][i] - Lanes{};
}

/// The models of the lanes' patches in their frames, and their curvatures.
struct LaneModels {
  ProjectedModel<Lanes> projected;
  Lanes curvature;
};
/// A RayKind's number whose axes x, y, z are 0, 1, 2.
inline constexpr int axes_in_order = 16;
/// Brings the axes of models whose rays are of several kinds into that order, lane by lane.
[[gnu::noinline]] inline void order_axes(const LanePatches& p, Lanes (&m)[16]) {
  unsigned is_0 = 0, is_1 = 0;
  for (int j = 0; j < lane_count; ++j) {
    is_0 |= unsigned(p.kind(j).axis_z == 0) << j;
    is_1 |= unsigned(p.kind(j).axis_z == 1) << j;
  }
  const LaneMask z_is_0 = mask_of(is_0), z_is_1 = mask_of(is_1);
  for (int k = 0; k < 4; ++k) {
    const Lanes a = m[k], b = m[4 + k], c = m[8 + k];
    m[k] = select(z_is_0, b, select(z_is_1, c, a));
    m[4 + k] = select(z_is_0, c, select(z_is_1, a, b));
    m[8 + k] = select(z_is_0, a, select(z_is_1, b, c));
  }
}
inline LaneModels project(const LanePatches& p, const LaneFrames& frames) {
  const float* rows[lane_count];
  for (int j = 0; j < lane_count; ++j) rows[j] = &p.model(j).axis[0].p;
  Lanes m[16];
  load_values(rows, p.same, m);
  const auto axis = [&](int a) {
    // Two HalfBounds: the low half and the high half of a word.
    const LaneBits d = LaneBits(m[4 * a + 3]);
    return ModelAxis<Lanes>{m[4 * a], m[4 * a + 1], m[4 * a + 2], Lanes(d << 16),
                            Lanes(d & 0xFFFF0000u)};
  };
  if (!p.one_kind) order_axes(p, m);
  const RayKind k = p.one_kind ? p.kind(0) : RayKind(axes_in_order);
  return {project(axis(k.axis_x()), axis(k.axis_y()), axis(k.axis_z), m[12], m[13], frames), m[15]};
}

/// Control values in each lane.
struct LaneNet {
  Lanes x[16], y[16], z[16];
};
/// A patch in each lane, in the frame of its ray. The bumps are zero for Bezier patches, and say
/// nothing if there is no other.
struct LanePatch : LaneNet {
  Lanes eps_x, eps_y;
  bool any_bump = false;
  Lanes bump_x[4], bump_y[4], bump_z[4];
};
inline void bumps_to_ray_frame(const LanePatches& lanes, const LaneFrames& f, LanePatch& p) {
  const PatchBump<float>* bumps[lane_count];
  for (int j = 0; j < lane_count; ++j) {
    bumps[j] = lanes.bump(j);
    p.any_bump |= bumps[j] != nullptr;
  }
  if (!p.any_bump) return;
  for (int k = 0; k < 4; ++k) {
    alignas(Lanes) float x[lane_count], y[lane_count], z[lane_count];
    for (int j = 0; j < lane_count; ++j) {
      const auto at = [&](int axis) { return bumps[j] ? bumps[j]->c[axis][k] : 0.0f; };
      const RayKind kind = lanes.kind(j);
      x[j] = at(kind.axis_x()), y[j] = at(kind.axis_y()), z[j] = at(kind.axis_z);
    }
    const Lanes depth = load_lanes(z);
    p.bump_x[k] = load_lanes(x) + f.shear_x * depth;
    p.bump_y[k] = load_lanes(y) + f.shear_y * depth;
    p.bump_z[k] = f.sign_z * depth;
  }
}
inline void to_ray_frame(const LanePatches& lanes, const LaneFrames& f,
                         const ProjectedModel<Lanes>& m, LanePatch& p) {
  const float *x[lane_count], *y[lane_count], *z[lane_count];
  const auto set_rows = [&](auto&& kind_of) {
    for (int j = 0; j < lane_count; ++j) {
      const PatchNet<float>& net = lanes.net(j);
      const RayKind kind = kind_of(j);
      x[j] = net.c[kind.axis_x()], y[j] = net.c[kind.axis_y()], z[j] = net.c[kind.axis_z];
    }
  };
  if (lanes.one_kind)
    set_rows([kind = lanes.kind(0)](int) { return kind; });
  else
    set_rows([&](int j) { return lanes.kind(j); });
  load_values(x, lanes.same, p.x);
  load_values(y, lanes.same, p.y);
  load_values(z, lanes.same, p.z);
  for (int i = 0; i < 16; ++i) {
    const Lanes depth = p.z[i] - f.org_z;
    p.x[i] = p.x[i] - f.org_x + f.shear_x * depth;
    p.y[i] = p.y[i] - f.org_y + f.shear_y * depth;
    p.z[i] = f.sign_z * depth;
  }
  p.eps_x = m.eps_x, p.eps_y = m.eps_y;
  bumps_to_ray_frame(lanes, f, p);
}

/// S3: half of a net, by de Casteljau; `step` is 1 across u, 4 across v.
inline void take_half(const Lanes (&n)[16], int step, bool high, Lanes (&out)[16]) {
  for (int row = 0; row < 4; ++row) {
    const auto at = [&](int k) { return row * (5 - step) + (high ? 3 - k : k) * step; };
    const Lanes a = 0.5f * (n[at(0)] + n[at(1)]), b = 0.5f * (n[at(1)] + n[at(2)]);
    const Lanes c = 0.5f * (n[at(2)] + n[at(3)]), d = 0.5f * (a + b), e = 0.5f * (b + c);
    out[at(0)] = n[at(0)], out[at(1)] = a, out[at(2)] = d, out[at(3)] = 0.5f * (d + e);
  }
}
/// Bit 0 of `quarter` is its half of u, bit 1 that of v.
inline void take_quarter(const Lanes (&n)[16], int quarter, Lanes (&out)[16]) {
  Lanes half[16];
  take_half(n, 1, quarter & 1, half);
  take_half(half, 4, quarter & 2, out);
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

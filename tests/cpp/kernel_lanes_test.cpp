// Several rays side by side (math/lanes.h, lane_patch.h, lane_newton.h) against one ray alone, and
// against known points: what a lane says of its ray is what the ray would hear by itself.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <tuple>
#include <vector>

#include "../support/trace_patch.h"
#include "limitray/intersect/lane_newton.h"

namespace limitray {
namespace {

using test::Real;

TEST(LanesTest, LoadByLaneTransposes) {
  float values[lane_count][16];
  const float* rows[lane_count];
  for (int j = 0; j < lane_count; ++j)
    for (int i = 0; i < 16; ++i) values[j][i] = float(100 * j + i), rows[j] = values[j];
  Lanes by_lane[16];
  load_by_lane(rows, by_lane);
  for (int j = 0; j < lane_count; ++j)
    for (int i = 0; i < 16; ++i) ASSERT_EQ(lane_of(by_lane[i], j), values[j][i]) << j << " " << i;
}

TEST(LanesTest, MasksAndBits) {
  for (unsigned bits = 0; bits < 1u << lane_count; bits = 3 * bits + 1)
    ASSERT_EQ(bits_of(mask_of(bits)), bits);
  EXPECT_FALSE(any(mask_of(0)));
  EXPECT_EQ(count(mask_of(5)), 2);
  EXPECT_EQ(bits_of(false), 0u);
  EXPECT_EQ(bits_of(true), 1u);
}

/// Rays of all kinds: aimed at the unit ball, past it, far, along an axis, not finite.
ObjectRay any_ray(test::Generator& g, int kind) {
  ObjectRay r;
  r.org = std::pow(10, test::uniform(g, -1, 4)) * test::random_direction(g);
  r.dir = std::pow(10, test::uniform(g, -3, 3)) *
          (test::uniform(g, 0, 1.5) * test::random_direction(g) - r.org);
  if (kind % 5 == 1) r.dir = {0, 0, 0}, r.dir[kind % 3] = kind % 2 ? 1 : -1;
  if (kind % 7 == 1) r.org[kind % 3] = 0;
  if (kind % 11 == 1) r.dir[kind % 3] = std::numeric_limits<double>::quiet_NaN();
  if (kind % 13 == 1) r.org[kind % 3] = std::numeric_limits<double>::infinity();
  if (kind % 17 == 1) r.dir = {0, 0, 0};
  if (kind % 4 == 1) r.tnear = test::uniform(g, 0, 0.5), r.tfar = test::uniform(g, 0, 2);
  return r;
}

TEST(LanesTest, FramesAreThoseOfOneRay) {
  constexpr int n = lane_count / 2;
  test::Generator g{3};
  int met = 0;
  for (int round = 0; round < 2000 / test::rounds_divisor; ++round) {
    ObjectRay rays[n];
    HalfLanes org[3], dir[3], tnear, tfar;
    for (int j = 0; j < n; ++j) {
      rays[j] = any_ray(g, n * round + j);
      for (int i = 0; i < 3; ++i) org[i][j] = rays[j].org[i], dir[i][j] = rays[j].dir[i];
      tnear[j] = rays[j].tnear, tfar[j] = rays[j].tfar;
    }
    const RayFrame<HalfLanes, float> f(org, dir, tnear, tfar, test::extent_of(1));
    for (int j = 0; j < n; ++j) {
      PatchRay<float> alone, beside;
      const bool meets = make_patch_ray(rays[j], test::extent_of(1), alone);
      ASSERT_EQ(bool(bits_of(f.meets) >> j & 1), meets) << round << " " << j;
      if (!meets) continue;
      ++met;
      f.store(j, beside);
      // The compiler may fuse other multiplications and additions.
      const auto same = [](double a, double b) {
        EXPECT_LE(std::abs(a - b), 1e-6 * (std::abs(a) + 1)) << a << " " << b;
      };
      EXPECT_EQ(alone.axis_z, beside.axis_z);
      same(alone.org_x, beside.org_x), same(alone.org_y, beside.org_y);
      same(alone.org_z, beside.org_z), same(alone.shear_x, beside.shear_x);
      same(alone.shear_y, beside.shear_y), same(alone.sign_z, beside.sign_z);
      same(alone.eps / beside.eps, 1), same(alone.eps_z / beside.eps_z, 1);
      same(alone.zmin / beside.zmin, 1), same(alone.zmax / beside.zmax, 1);
      same(alone.t_scale / beside.t_scale, 1), same(alone.z_scale / beside.z_scale, 1);
      same(alone.t_origin / (1 + alone.t_origin), beside.t_origin / (1 + alone.t_origin));
    }
  }
  EXPECT_GT(met, 500 / test::rounds_divisor);
}

/// A patch in each lane and a ray aimed at a point of it.
struct Scenario {
  std::vector<test::RoundedPatch<float>> patch;
  PatchModel<float> model[lane_count];
  PatchRay<float> ray[lane_count];
  ObjectRay object_ray[lane_count];
  double u[lane_count], v[lane_count], t[lane_count];
  LanePatches patches;
  LaneFrames frames{};

  Scenario(test::Generator& g, test::Shape shape) {
    patch.reserve(lane_count);
    for (int j = 0; j < lane_count; ++j) {
      const test::Patch p = test::random_patch(g, shape, g() % 2);
      patch.emplace_back(p);
      u[j] = g() % 4 ? test::uniform(g, 0, 1) : double(g() % 2);
      v[j] = g() % 4 ? test::uniform(g, 0, 1) : double(g() % 2);
      const Vec3<Real> point = test::reference_point(p, u[j], v[j]);
      const Vec3d target{double(point.x), double(point.y), double(point.z)};
      t[j] = test::uniform(g, 0.5, 2);
      object_ray[j].dir = 4.0 * test::random_direction(g);
      object_ray[j].org = target - t[j] * object_ray[j].dir;
      const double radius = test::radius_of(p);
      EXPECT_TRUE(make_patch_ray(object_ray[j], test::extent_of(radius), ray[j]));
      const PatchBump<float>* bump = patch.back().bump_or_null();
      model[j] = make_patch_model(patch[j].net, bump);
      patches.set(j, &model[j], &patch[j].net, bump, &ray[j]);
      frames.set(j, ray[j]);
    }
  }
};

TEST(LanesTest, ValuesAreThoseOfOneRay) {
  test::Generator g{11};
  for (int round = 0; round < 400 / test::rounds_divisor; ++round) {
    const auto s = std::make_unique<Scenario>(g, test::all_shapes[round % 8]);
    const LaneModels m = project(s->patches.models, s->frames);
    LanePatch lanes;
    to_ray_frame(s->patches.nets, s->patches.rays, s->frames, m.projected, lanes);
    if (s->patches.any_bump)
      bumps_to_ray_frame(s->patches.bumps, s->patches.rays, s->frames, lanes);
    Lanes u, v;
    for (int j = 0; j < lane_count; ++j) u[j] = float(s->u[j]), v[j] = float(s->v[j]);
    const RaySample<Lanes> across = evaluate(lanes, u, v);
    const DepthSample<Lanes> along = evaluate_depth(lanes, u, v);
    for (int j = 0; j < lane_count; ++j) {
      const ProjectedModel<float> one = project(s->model[j], s->ray[j]);
      const RootPatch<float> root =
          to_ray_frame(s->patch[j].net, s->patches.bumps[j], s->ray[j], one);
      EXPECT_LE(std::abs(lane_of(m.projected.x, j) - one.x), one.eps_x);
      EXPECT_LE(std::abs(lane_of(m.projected.y, j) - one.y), one.eps_y);
      EXPECT_NEAR(lane_of(m.projected.eps_x, j) / one.eps_x, 1, 1e-5);
      EXPECT_NEAR(lane_of(m.projected.eps_z, j) / one.eps_z, 1, 1e-5);
      const RaySample<float> a = evaluate(root, u[j], v[j]);
      const DepthSample<float> d = evaluate_depth(root, u[j], v[j]);
      // Both are within eps of the exact values; derivatives within as many roundings of theirs.
      EXPECT_LE(std::abs(lane_of(across.x, j) - a.x), 2 * one.eps_x);
      EXPECT_LE(std::abs(lane_of(across.y, j) - a.y), 2 * one.eps_y);
      EXPECT_LE(std::abs(lane_of(along.z, j) - d.z), 2 * one.eps_z);
      for (const auto& [lane, alone, eps] :
           {std::tuple{across.x_u, a.x_u, one.eps_x}, std::tuple{across.x_v, a.x_v, one.eps_x},
            std::tuple{across.y_u, a.y_u, one.eps_y}, std::tuple{across.y_v, a.y_v, one.eps_y},
            std::tuple{along.z_u, d.z_u, one.eps_z}, std::tuple{along.z_v, d.z_v, one.eps_z}})
        EXPECT_LE(std::abs(lane_of(lane, j) - alone), 16 * eps);
    }
  }
}

TEST(LanesTest, AimedRaysAreNeverMissedAndOtherLanesDoNotMatter) {
  test::Generator g{17};
  int met = 0, undecided = 0;
  for (int round = 0; round < 4000 / test::rounds_divisor; ++round) {
    const test::Shape shape = test::surface_shapes[round % 6];
    const auto s = std::make_unique<Scenario>(g, shape);
    const unsigned all = (1u << lane_count) - 1, some = unsigned(g()) & all;
    PatchCounters count;
    const LaneOutcome o = newton_on_models(s->patches, s->frames, all, count);
    EXPECT_EQ(count.patch_tests, unsigned(lane_count));
    ASSERT_EQ(o.missed, 0u) << "round " << round << ", " << test::name_of(shape);
    if (shape == test::Shape::smooth || shape == test::Shape::flat)
      met += std::popcount(o.met), undecided += std::popcount(all & ~o.met);
    const LaneOutcome part = newton_on_models(s->patches, s->frames, some, count);
    ASSERT_EQ(part.met, o.met & some);
    for (int j = 0; j < lane_count; ++j) {
      if (!(o.met >> j & 1)) continue;
      // At most one hit is on the patch: the point that was aimed at.
      const double z = (s->t[j] - s->ray[j].t_origin) * s->ray[j].z_scale;
      const ProjectedModel<float> m = project(s->model[j], s->ray[j]);
      EXPECT_LE(std::abs(o.z[j] - z), o.spread[j] + m.eps_z + std::min(m.eps_x, m.eps_y)) << j;
      if (!(some >> j & 1)) continue;
      EXPECT_EQ(part.u[j], o.u[j]);
      EXPECT_EQ(part.v[j], o.v[j]);
      EXPECT_EQ(part.z[j], o.z[j]);
      EXPECT_EQ(part.spread[j], o.spread[j]);
    }
  }
  EXPECT_GT(4 * met, undecided) << "many are decided";
}

}  // namespace
}  // namespace limitray

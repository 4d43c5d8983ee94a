// Several rays side by side (math/lanes.h, ray_space.h, lane_patch.h, lane_newton.h) against one
// ray alone, and against known points: what a lane says of its ray is what the ray would hear by
// itself.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <tuple>
#include <vector>

#include "../support/trace_patch.h"
#include "limitray/intersect/lane_newton.h"
#include "limitray/intersect/ray_space.h"

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

TEST(LanesTest, EightValuesAreTransposedThereAndBack) {
  float values[lane_count][8], back[lane_count][8];
  const float* rows[lane_count];
  float* written[lane_count];
  for (int j = 0; j < lane_count; ++j) {
    for (int i = 0; i < 8; ++i) values[j][i] = float(100 * j + i);
    rows[j] = values[j], written[j] = back[j];
  }
  Lanes by_lane[8];
  load_by_lane(rows, by_lane);
  for (int j = 0; j < lane_count; ++j)
    for (int i = 0; i < 8; ++i) ASSERT_EQ(lane_of(by_lane[i], j), values[j][i]) << j << " " << i;
  store_by_lane(by_lane, written);
  for (int j = 0; j < lane_count; ++j)
    for (int i = 0; i < 8; ++i) ASSERT_EQ(back[j][i], values[j][i]) << j << " " << i;
}

TEST(LanesTest, DoublesAreJoinedAndHalved) {
  Lanes v;
  for (int j = 0; j < lane_count; ++j) v[j] = float(j) + 0.5f;
  const Lanes same = join(half_of(v, false), half_of(v, true));
  for (int j = 0; j < lane_count; ++j) ASSERT_EQ(lane_of(same, j), lane_of(v, j));
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

/// The frames of two halves of `rays`, as rays of a batch get them.
LaneFrameMaker frames_of(const ObjectRay (&rays)[lane_count]) {
  const auto frame = [&](int first) {
    alignas(HalfLanes) double values[8][lane_count / 2];
    for (int j = 0; j < lane_count / 2; ++j) {
      const ObjectRay& r = rays[first + j];
      for (int i = 0; i < 3; ++i) values[i][j] = r.org[i], values[3 + i][j] = r.dir[i];
      values[6][j] = r.tnear, values[7][j] = r.tfar;
    }
    HalfLanes v[8];
    std::memcpy(v, values, sizeof(v));
    return RayFrame<HalfLanes, float>({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, v[6], v[7],
                                      test::extent_of(1));
  };
  return {frame(0), frame(lane_count / 2)};
}

TEST(LanesTest, FramesAreThoseOfOneRay) {
  test::Generator g{3};
  int met = 0;
  const auto space = std::make_unique<RaySpace>();
  for (int round = 0; round < 1000 / test::rounds_divisor; ++round) {
    ObjectRay rays[lane_count];
    RayId ids[lane_count];
    for (int j = 0; j < lane_count; ++j)
      rays[j] = any_ray(g, lane_count * round + j), ids[j] = 7 + j;
    const int here = 1 + int(g() % lane_count);
    space->count = 0;
    space->add(frames_of(rays), ids, here, 3);
    int k = 0;
    for (int j = 0; j < here; ++j) {
      PatchRay<float> alone;
      if (!make_patch_ray(rays[j], test::extent_of(1), alone)) continue;
      ++met;
      ASSERT_LT(k, space->count);
      ASSERT_EQ(space->stream_ids[k], ids[j]);
      ASSERT_EQ(space->instances[k], 3u);
      const LaneRay& lane = space->rays[k];
      const RayDepth<float>& depth = space->depths[k];
      const BoxRay &box = space->boxes[k], box_alone = make_box_ray(alone);
      const RayKind kind(space->kinds[k]);
      // The compiler may fuse other multiplications and additions.
      const auto same = [](double a, double b) {
        EXPECT_LE(std::abs(a - b), 1e-6 * (std::abs(a) + 1)) << a << " " << b;
      };
      EXPECT_EQ(kind.axis_x(), alone.axis_x);
      EXPECT_EQ(kind.axis_y(), alone.axis_y);
      EXPECT_EQ(kind.axis_z, alone.axis_z);
      EXPECT_EQ(kind.sign_z(), alone.sign_z);
      EXPECT_EQ(kind.signs, box_alone.signs());
      EXPECT_EQ(kind.signs, box.signs());
      same(alone.org_x, lane.org_x), same(alone.org_y, lane.org_y), same(alone.org_z, lane.org_z);
      same(alone.shear_x, lane.shear_x), same(alone.shear_y, lane.shear_y);
      same(alone.eps / lane.eps, 1), same(alone.eps_z / depth.eps_z, 1);
      same(alone.zmin / lane.zmin, 1), same(alone.zmax / lane.zmax, 1);
      same(alone.t_scale / depth.t_scale, 1), same(alone.z_scale / depth.z_scale, 1);
      same(alone.t_origin / (1 + alone.t_origin), depth.t_origin / (1 + alone.t_origin));
      for (int i = 0; i < 3; ++i) {
        same(box_alone.inv[i] / box.inv[i], 1);
        same(box_alone.org_inv[i] / box.inv[i], box.org_inv[i] / box.inv[i]);
      }
      EXPECT_EQ(box.zmin, lane.zmin);
      EXPECT_EQ(box.zmax, lane.zmax);
      ++k;
    }
    ASSERT_EQ(k, space->count);
  }
  EXPECT_GT(met, 500 / test::rounds_divisor);
}

TEST(LanesTest, RaysAreSortedBySigns) {
  test::Generator g{5};
  const auto space = std::make_unique<RaySpace>();
  space->count = 1000;
  for (int k = 0; k < space->count; ++k) space->kinds[k] = std::uint8_t(g() % RayKind::count);
  space->sort_by_signs(100);
  EXPECT_EQ(space->signs_begin[0], 0);
  EXPECT_EQ(space->signs_begin[RaySpace::octants], 900);
  for (unsigned signs = 0; signs < RaySpace::octants; ++signs)
    for (int k = space->signs_begin[signs]; k < space->signs_begin[signs + 1]; ++k) {
      ASSERT_GE(space->by_signs[k], 100u);
      ASSERT_EQ(RayKind(space->kinds[space->by_signs[k]]).signs, signs);
      if (k > space->signs_begin[signs]) {
        ASSERT_LT(space->by_signs[k - 1], space->by_signs[k]);
      }
    }
}

/// A direction of one kind.
Vec3d direction_of(test::Generator& g, RayKind kind) {
  Vec3d d = test::random_direction(g);
  for (int i = 0; i < 3; ++i)
    if (std::abs(d[i]) > std::abs(d[kind.axis_z])) std::swap(d[i], d[kind.axis_z]);
  for (int i = 0; i < 3; ++i) d[i] = kind.signs >> i & 1 ? -std::abs(d[i]) : std::abs(d[i]);
  return d;
}

/// A patch in each lane, or one for all, and a ray aimed at a point of it; rays of one kind or of
/// several.
struct Scenario {
  bool same, one_kind;
  std::uint8_t kinds[lane_count];
  std::vector<test::RoundedPatch<float>> patch;
  std::vector<PatchNet<float>> nets;
  std::vector<PatchBump<float>> bumps;
  std::vector<PatchInfo> infos;
  std::vector<PatchModel<float>> models;
  PatchRay<float> ray[lane_count];
  LaneRay lane_ray[lane_count];
  ObjectRay object_ray[lane_count];
  double u[lane_count], v[lane_count], t[lane_count];
  Meeting meetings[lane_count];
  GeometryView<float> mesh{};

  Scenario(test::Generator& g, test::Shape shape, bool one_patch)
      : same(one_patch), one_kind(same || g() % 2) {
    std::vector<test::Patch> exact;
    for (int j = 0; j < lane_count; ++j) {
      kinds[j] = one_kind && j > 0 ? kinds[0] : std::uint8_t(g() % RayKind::count);
      if (j == 0 || !same) exact.push_back(test::random_patch(g, shape, g() % 2));
      add_ray(g, exact.back(), j);
    }
    for (const test::Patch& p : exact) add_patch(p);
    mesh.nets = nets.data(), mesh.bumps = bumps.data(), mesh.infos = infos.data();
    mesh.models = models.data();
  }
  void add_ray(test::Generator& g, const test::Patch& p, int j) {
    u[j] = g() % 4 ? test::uniform(g, 0, 1) : double(g() % 2);
    v[j] = g() % 4 ? test::uniform(g, 0, 1) : double(g() % 2);
    const Vec3<Real> point = test::reference_point(p, u[j], v[j]);
    const Vec3d target{double(point.x), double(point.y), double(point.z)};
    t[j] = test::uniform(g, 0.5, 2);
    object_ray[j].dir = 4.0 * direction_of(g, RayKind(kinds[j]));
    object_ray[j].org = target - t[j] * object_ray[j].dir;
    PatchRay<float>& r = ray[j];
    EXPECT_TRUE(make_patch_ray(object_ray[j], test::extent_of(test::radius_of(p)), r));
    lane_ray[j] = {r.org_x, r.org_y, r.org_z, r.shear_x, r.shear_y, r.eps, r.zmin, r.zmax};
    meetings[j] = {std::uint32_t(j), kinds[j], same ? 0 : std::uint32_t(j)};
  }
  void add_patch(const test::Patch& p) {
    patch.emplace_back(p);
    const PatchBump<float>* bump = patch.back().bump_or_null();
    nets.push_back(patch.back().net), infos.push_back({});
    if (bump) infos.back().bump = std::uint32_t(bumps.size()), bumps.push_back(*bump);
    models.push_back(make_patch_model(nets.back(), bump));
  }
  LanePatches lanes(int count = lane_count) const {
    return {lane_ray, meetings, count, [this](std::uint32_t) { return &mesh; }};
  }
  std::uint32_t leaf(int j) const { return meetings[j].leaf; }
  ProjectedModel<float> model(int j) const { return project(models[leaf(j)], ray[j]); }
  /// Whether a root in lane j is the point that was aimed at.
  void expect_target(const LaneOutcome& o, int j) const {
    const double z = (t[j] - ray[j].t_origin) * ray[j].z_scale;
    const ProjectedModel<float> m = model(j);
    EXPECT_LE(std::abs(o.z[j] - z), o.spread[j] + m.eps_z + std::min(m.eps_x, m.eps_y)) << j;
  }
};

TEST(LanesTest, OneAmongTheLanesIsEnoughToDiffer) {
  test::Generator g{7};
  auto s = std::make_unique<Scenario>(g, test::Shape::smooth, true);
  ASSERT_TRUE(s->lanes().same && s->lanes().one_kind);
  s->meetings[1].leaf = 5;
  EXPECT_FALSE(s->lanes().same);
  EXPECT_TRUE(s->lanes().one_kind);
  s->meetings[1].leaf = 0, s->meetings[1].kind = (s->kinds[0] + 1) % RayKind::count;
  EXPECT_FALSE(s->lanes().same || s->lanes().one_kind);
  EXPECT_TRUE(s->lanes(1).same) << "lanes without a ray repeat another one";
}

TEST(LanesTest, ValuesAreThoseOfOneRay) {
  test::Generator g{11};
  for (int round = 0; round < 400 / test::rounds_divisor; ++round) {
    const auto s = std::make_unique<Scenario>(g, test::all_shapes[round % 8], round % 3 == 0);
    const LanePatches patches = s->lanes();
    ASSERT_EQ(patches.same, s->same);
    ASSERT_TRUE(patches.one_kind || !s->one_kind);
    const LaneFrames frames(patches);
    const LaneModels m = project(patches, frames);
    LanePatch lanes;
    to_ray_frame(patches, frames, m.projected, lanes);
    Lanes u, v;
    for (int j = 0; j < lane_count; ++j) u[j] = float(s->u[j]), v[j] = float(s->v[j]);
    const RaySample<Lanes> across = evaluate(lanes, u, v);
    const DepthSample<Lanes> along = evaluate_depth(lanes, u, v);
    for (int j = 0; j < lane_count; ++j) {
      const ProjectedModel<float> one = s->model(j);
      const RootPatch<float> root =
          to_ray_frame(s->nets[s->leaf(j)], bump_of(s->mesh, s->leaf(j)), s->ray[j], one);
      EXPECT_LE(std::abs(lane_of(m.projected.x, j) - one.x), one.eps_x);
      EXPECT_LE(std::abs(lane_of(m.projected.y, j) - one.y), one.eps_y);
      EXPECT_NEAR(lane_of(m.projected.eps_x, j) / one.eps_x, 1, 1e-5);
      EXPECT_GE(lane_of(m.projected.eps_z, j) / one.eps_z, 1 - 1e-5);
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

TEST(LanesTest, QuartersAreTheSameSurface) {
  test::Generator g{13};
  for (int round = 0; round < 200 / test::rounds_divisor; ++round) {
    const auto s = std::make_unique<Scenario>(g, test::surface_shapes[round % 6], false);
    const LaneFrames frames(s->lanes());
    LanePatch whole;
    to_ray_frame(s->lanes(), frames, project(s->lanes(), frames).projected, whole);
    whole.any_bump = false;
    for (int quarter = 0; quarter < 4; ++quarter) {
      LanePatch part = whole;
      take_quarter(whole.x, quarter, part.x);
      take_quarter(whole.y, quarter, part.y);
      take_quarter(whole.z, quarter, part.z);
      const Lanes u = Lanes{} + float(test::uniform(g, 0, 1));
      const Lanes v = Lanes{} + float(test::uniform(g, 0, 1));
      const Lanes u_whole = 0.5f * u + (quarter & 1 ? 0.5f : 0.0f);
      const Lanes v_whole = 0.5f * v + (quarter & 2 ? 0.5f : 0.0f);
      const RaySample<Lanes> a = evaluate(part, u, v), b = evaluate(whole, u_whole, v_whole);
      const DepthSample<Lanes> c = evaluate_depth(part, u, v);
      const DepthSample<Lanes> d = evaluate_depth(whole, u_whole, v_whole);
      for (int j = 0; j < lane_count; ++j) {
        const ProjectedModel<float> m = s->model(j);
        ASSERT_LE(std::abs(lane_of(a.x, j) - lane_of(b.x, j)), 2 * m.eps_x);
        ASSERT_LE(std::abs(lane_of(a.y, j) - lane_of(b.y, j)), 2 * m.eps_y);
        ASSERT_LE(std::abs(lane_of(c.z, j) - lane_of(d.z, j)), 2 * m.eps_z);
      }
    }
  }
}

/// The same lanes of two outcomes.
void expect_same(const LaneOutcome& a, const LaneOutcome& b, int j) {
  EXPECT_EQ(a.u[j], b.u[j]);
  EXPECT_EQ(a.v[j], b.v[j]);
  EXPECT_EQ(a.z[j], b.z[j]);
  EXPECT_EQ(a.spread[j], b.spread[j]);
}

TEST(LanesTest, AimedRaysAreNeverMissedAndOtherLanesDoNotMatter) {
  test::Generator g{17};
  int met = 0, undecided = 0;
  for (int round = 0; round < 4000 / test::rounds_divisor; ++round) {
    const test::Shape shape = test::surface_shapes[round % 6];
    const auto s = std::make_unique<Scenario>(g, shape, round % 3 == 0);
    const LanePatches all = s->lanes(), some = s->lanes(1 + int(g() % lane_count));
    PatchCounters count;
    ASSERT_EQ(test_models(all).missed, 0u) << "round " << round << ", " << test::name_of(shape);
    ASSERT_EQ(test_models(some).decided, test_models(all).decided & some.waiting);
    const LaneOutcome o = LaneSolver(all).solve(count);
    ASSERT_EQ(o.missed, 0u) << "round " << round << ", " << test::name_of(shape);
    if (shape == test::Shape::smooth || shape == test::Shape::flat)
      met += std::popcount(o.met), undecided += std::popcount(all.waiting & ~o.met);
    const LaneOutcome part = LaneSolver(some).solve(count);
    ASSERT_EQ(part.met, o.met & some.waiting);
    for (int j = 0; j < lane_count; ++j) {
      // At most one hit is on the patch: the point that was aimed at.
      if (o.met >> j & 1) s->expect_target(o, j);
      if (part.met >> j & 1) expect_same(part, o, j);
    }
  }
  EXPECT_GT(4 * met, undecided) << "many are decided";
}

TEST(LanesTest, AimedRaysAreNotMissedByTheirQuarter) {
  test::Generator g{19};
  int met = 0, total = 0;
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    const test::Shape shape = test::surface_shapes[round % 6];
    const auto s = std::make_unique<Scenario>(g, shape, false);
    const LaneSolver solver(s->lanes());
    PatchCounters count;
    for (int quarter = 0; quarter < 4; ++quarter) {
      const LaneOutcome o = solver.solve_quarter(quarter, s->lanes().waiting, count);
      EXPECT_EQ(o.met & o.missed, 0u);
      for (int j = 0; j < lane_count; ++j) {
        if ((s->u[j] > 0.5) != bool(quarter & 1) || (s->v[j] > 0.5) != bool(quarter & 2)) continue;
        ASSERT_FALSE(o.missed >> j & 1) << round << " " << j << " " << test::name_of(shape);
        if (o.met >> j & 1) s->expect_target(o, j);
        if (shape == test::Shape::smooth) met += o.met >> j & 1, ++total;
      }
    }
  }
  EXPECT_GT(4 * met, total) << "many are decided";
}

// What the model says of depth: a ray that ends before its target, or begins behind it, misses; one
// that comes up to it does not.
TEST(LanesTest, HeightsOverTheTangentPlaneHoldTheSurface) {
  test::Generator g{23};
  int culled = 0, rays = 0;
  for (int round = 0; round < 2000 / test::rounds_divisor; ++round) {
    const test::Shape shape = test::surface_shapes[round % 6];
    const auto s = std::make_unique<Scenario>(g, shape, false);
    for (int j = 0; j < lane_count; ++j) {
      const ProjectedModel<float> m = s->model(j);
      const float z = float((s->t[j] - s->ray[j].t_origin) * s->ray[j].z_scale);
      const float e = m.eps_z + 4 * unit_roundoff<float> * std::abs(z);
      const float far = 100;
      ASSERT_FALSE(m.misses(z - e, z + e)) << round << " " << j << " " << test::name_of(shape);
      ASSERT_FALSE(m.misses(-far, z + e));
      ASSERT_FALSE(m.misses(z - e, far));
      if (shape != test::Shape::flat) continue;
      rays += 2;
      culled += m.misses(z + 0.2f, far) + m.misses(-far, z - 0.2f);
    }
  }
  EXPECT_GT(2 * culled, rays) << "a flat patch is culled by its plane";
}

}  // namespace
}  // namespace limitray

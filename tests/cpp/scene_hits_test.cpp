// Every hit, on every cage (and some rays on the optional models): it lies on the ray and on the
// true limit surface, evaluated in double by code that shares nothing with the tracer; aimed rays
// hit, rays past the box miss, closed surfaces are crossed an even number of times, and float
// agrees with double.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "../support/cast.h"
#include "../support/random_patches.h"
#include "../support/surface_targets.h"
#include "cage_files.h"
#include "limitray/cage/limit.h"
#include "limitray/cage/obj.h"
#include "limitray/patches/gregory_error.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

using test::Hits;
using test::Rays;
using test::SurfaceTargets;
using test::Target;
using test::TargetKind;

constexpr int isolation_level = 4;
constexpr std::size_t most_faces = 5000;  // of the optional models that are traced

class SceneHitsTest : public testing::TestWithParam<std::filesystem::path> {
 protected:
  test::Generator generator{31};
  ControlCage cage = read_obj(GetParam());
  Scene scene{1};
  std::unique_ptr<SurfaceTargets> targets;
  Vec3d center;
  double radius = 0;
  bool is_model = false;  // one of many: fewer rays

  void SetUp() override {
    is_model = GetParam().parent_path() != LIMITRAY_TEST_CAGES;
    if (cage.face_count() > most_faces) GTEST_SKIP() << cage.face_count() << " faces";
    scene.add_mesh(cage, {isolation_level});
    PatchBuffer<double> patches = Refiner(cage, {isolation_level}).make_patches(cage.points);
    if (patches.size() == 0) GTEST_SKIP() << "no surface";
    radius = patches.radius, center = patches.origin;
    targets = std::make_unique<SurfaceTargets>(std::move(patches));
  }

  /// A point of the surface, not on its boundary.
  Target inner_target(int i) {
    if (test::is_closed(cage)) return targets->pick(TargetKind(i % test::target_kinds), generator);
    const Target corner = targets->pick(TargetKind::patch_corner, generator);
    return i % 2 && corner.smooth ? corner : targets->pick(TargetKind::interior, generator);
  }
  template <class T>
  Rays<T> aimed_rays(int n) {
    Rays<T> rays;
    for (int i = 0; i < (is_model ? n / 4 : n); ++i)
      rays.aim(center + 4 * radius * test::random_direction(generator), inner_target(i).point);
    return rays;
  }
  bool is_gregory(std::uint32_t patch) const {
    return targets->patches().infos[patch].bump != no_bump;
  }

  template <class T>
  void expect_aimed_rays_hit(int n);
  template <class T>
  void expect_hits_on_the_limit(int n);
};

template <class T>
void SceneHitsTest::expect_aimed_rays_hit(int n) {
  const Rays<T> rays = aimed_rays<T>(n);
  const Hits<T> hits = cast(scene, rays);
  // The ray as rounded may pass a silhouette, or meet the surface later where it is steep.
  int beyond = 0;
  for (std::size_t i = 0; i < rays.size(); ++i)
    beyond += !(hits.t[i] <= 1 + hits.t_error[i] + T(1e-3));
  EXPECT_LE(beyond, n / 200);
  EXPECT_EQ(scene.statistics().unresolved, 0u);
}

TEST_P(SceneHitsTest, AimedRaysHit) {
  expect_aimed_rays_hit<float>(1000);
  expect_aimed_rays_hit<double>(500);
}

template <class T>
void SceneHitsTest::expect_hits_on_the_limit(int n) {
  const LimitEvaluator limit(cage);
  const auto [lo, hi] = scene.bounds();
  const double side = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
  const double gregory = 3 * gregory_error(cage, isolation_level) * side;
  const Rays<T> rays = aimed_rays<T>(n);
  const Hits<T> hits = cast(scene, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!hits.hit(i)) continue;
    // Where the hit is uncertain in depth (a silhouette) the surface is met elsewhere on the ray.
    if (double(hits.t_error[i]) * length(rays.dir(i)) > 1e-4 * radius) continue;
    const LimitSample s =
        limit.evaluate(std::int32_t(hits.primitive_id[i]), std::int32_t(hits.sub_quad[i]),
                       double(hits.uv[2 * i]), double(hits.uv[2 * i + 1]));
    // Along the rim of back_to_back one derivative vanishes: the surface has an edge, no normal.
    if (std::min(length(s.dp_du), length(s.dp_dv)) < 1e-5 * radius) continue;
    const Vec3d off = s.point - rays.at(i, double(hits.t[i]));
    // docs/accuracy.md, section 4, of control values up to 2 R from a ray; t itself is rounded.
    const double u = std::numeric_limits<T>::epsilon() / 2;
    const double rounding = 70 * 400 * u * radius;
    if (is_gregory(hits.patch_id[i]))
      ASSERT_LE(std::abs(dot(off, s.normal)), gregory + rounding) << i;
    else
      ASSERT_LE(length(off), rounding) << i;
  }
}

TEST_P(SceneHitsTest, HitsLieOnRayAndLimitSurface) {
  expect_hits_on_the_limit<float>(300);
  expect_hits_on_the_limit<double>(300);
}

TEST_P(SceneHitsTest, FloatAgreesWithDouble) {
  Rays<float> rays;
  Rays<double> exact;
  std::vector<bool> is_smooth;  // no sharp edge that the ray may pass within the bounds
  for (int i = 0; i < (is_model ? 500 : 2000); ++i) {
    const Target target = inner_target(i);
    rays.aim(center + 4 * radius * test::random_direction(generator), target.point);
    exact.add(rays.org(std::size_t(i)), rays.dir(std::size_t(i)));
    is_smooth.push_back(target.smooth);
  }
  const Hits<float> f = cast(scene, rays);
  const Hits<double> d = cast(scene, exact);
  int grazed = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    // Float never passes what double meets; it may report what the ray passes within its eps.
    ASSERT_TRUE(!d.hit(i) || f.t[i] - f.t_error[i] <= d.t[i] + d.t_error[i]) << i;
    grazed += is_smooth[i] && f.hit(i) && !(f.t[i] + f.t_error[i] >= d.t[i] - d.t_error[i]);
  }
  EXPECT_LE(grazed, 3);
}

// Points inside a patch: both find the same face, but where a silhouette is near.
TEST_P(SceneHitsTest, FloatAndDoubleNameTheSameFace) {
  if (is_model || GetParam().stem() == "back_to_back") GTEST_SKIP() << "faces may coincide";
  Rays<float> rays;
  Rays<double> exact;
  for (int i = 0; i < 1000; ++i) {
    rays.aim(center + 4 * radius * test::random_direction(generator),
             targets->pick(TargetKind::interior, generator).point);
    exact.add(rays.org(std::size_t(i)), rays.dir(std::size_t(i)));
  }
  const Hits<float> f = cast(scene, rays);
  const Hits<double> d = cast(scene, exact);
  int different = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    different += f.primitive_id[i] != d.primitive_id[i] || f.sub_quad[i] != d.sub_quad[i] ||
                 f.patch_id[i] != d.patch_id[i];
  }
  EXPECT_LE(different, 10);
}

TEST_P(SceneHitsTest, RaysPastTheBoxMiss) {
  const auto [lo, hi] = scene.bounds();
  Rays<float> rays;
  for (int i = 0; i < 300; ++i) {
    // Through a point beyond one side of the box, and along that side.
    const int axis = i % 3;
    const bool up = i % 2;
    Vec3d p = center, d = test::random_direction(generator);
    p[axis] = (up ? hi[axis] : lo[axis]) + (up ? 1e-3 : -1e-3) * radius;
    d[axis] = 0;
    rays.add(p - 3 * radius * d, d);
  }
  const Hits<float> hits = cast(scene, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) EXPECT_FALSE(hits.hit(i)) << i;
}

TEST_P(SceneHitsTest, ClosedSurfacesAreCrossedAnEvenNumberOfTimes) {
  if (!test::is_closed(cage)) GTEST_SKIP() << "not closed";
  Rays<double> rays;
  for (int i = 0; i < 1000; ++i) {
    const Vec3d d = test::random_direction(generator);
    rays.add(center + 0.5 * radius * test::random_direction(generator) - 5 * radius * d, d);
  }
  int odd = 0;
  for (const std::uint32_t n : test::count(scene, rays)) odd += int(n & 1);
  EXPECT_EQ(odd, 0);
}

INSTANTIATE_TEST_SUITE_P(Cages, SceneHitsTest, testing::ValuesIn(test::cage_files()),
                         [](const auto& i) { return test::test_name(i.param); });
INSTANTIATE_TEST_SUITE_P(Models, SceneHitsTest, testing::ValuesIn(test::model_files()),
                         [](const auto& i) {
                           return test::test_name(i.param) + "_" + std::to_string(i.index);
                         });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SceneHitsTest);

}  // namespace
}  // namespace limitray

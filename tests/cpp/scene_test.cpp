// What a scene promises, on one or two cages: intervals, misses, hostile rays, threads and order,
// instances, moved points, scale and place.
#include "limitray/scene.h"

#include <gtest/gtest.h>

#include "../support/cast.h"
#include "../support/random_patches.h"
#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/intersect/ray_order.h"

namespace limitray {
namespace {

using test::Hits;
using test::Rays;

ControlCage cage(const std::string& name) { return read_obj(test::cage_file(name)); }

/// n rays from around `center` to points near it; some miss.
template <class T>
Rays<T> random_rays(std::size_t n, const Vec3d& center = {}, double radius = 1.5) {
  test::Generator g{77};
  Rays<T> rays;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3d to = center + radius * test::uniform(g, 0, 1) * test::random_direction(g);
    rays.aim(center + 5 * radius * test::random_direction(g), to);
  }
  return rays;
}

template <class T>
class SceneTest : public testing::Test {};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(SceneTest, Types);

TYPED_TEST(SceneTest, SameBitsForAnyNumberOfThreadsAndOrder) {
  using T = TypeParam;
  const Rays<T> rays = random_rays<T>(5000);
  Rays<T> reversed;
  for (std::size_t i = rays.size(); i-- > 0;) reversed.add(rays.org(i), rays.dir(i));
  Scene one(1);
  one.add_mesh(cage("cube_seams"));
  const Hits<T> expected = cast(one, rays);
  for (const int threads : {1, 2, 3}) {
    Scene scene(threads);
    scene.add_mesh(cage("cube_seams"));
    EXPECT_TRUE(cast(scene, rays) == expected) << threads << " threads";
    const Hits<T> back = cast(scene, reversed);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const std::size_t k = rays.size() - 1 - i;
      ASSERT_EQ(back.t[k], expected.t[i]);
      ASSERT_EQ(back.patch_id[k], expected.patch_id[i]);
      ASSERT_EQ(back.uv[2 * k], expected.uv[2 * i]);
    }
  }
}

// Rays are sorted part by part (max_sorted_rays): each gets its own answers, tnear and tfar.
TYPED_TEST(SceneTest, ABatchOfSeveralPartsIsItsRays) {
  using T = TypeParam;
  constexpr std::size_t n = max_sorted_rays + 1000, step = 1056;
  const Rays<T> rays = random_rays<T>(n);
  test::Generator g{78};
  std::vector<T> tnear(n), tfar(n);
  for (std::size_t i = 0; i < n; ++i)
    tnear[i] = T(test::uniform(g, 0, 1)), tfar[i] = T(i % 16 == 0 ? test::uniform(g, 0, 2) : 1e-3);
  Scene scene(2);
  scene.add_mesh(cage("cube_seams"));
  std::vector<T> t(n), normal(3 * n);
  std::vector<std::uint32_t> face(n);
  std::vector<std::uint8_t> occluded(n);
  HitArrays<T> out;
  out.t = t.data(), out.normal = normal.data(), out.primitive_id = face.data();
  const RayBatch<T> batch{rays.values, tnear, tfar};
  scene.cast_rays<T>(batch, out);
  scene.test_occlusions<T>(batch, occluded.data());
  std::size_t hits = 0;
  for (std::size_t i = 0; i < n; i += step) {
    Rays<T> one;
    one.add(rays.org(i), rays.dir(i));
    const Hits<T> expected = cast(scene, one, tnear[i], tfar[i]);
    ASSERT_EQ(t[i], expected.t[0]) << i;
    ASSERT_EQ(face[i], expected.primitive_id[0]);
    for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(normal[3 * i + c], expected.normal[c]);
    ASSERT_EQ(occluded[i] != 0, expected.hit(0));
    hits += expected.hit(0);
  }
  EXPECT_GT(hits, 200u);
  EXPECT_LT(hits, 800u);
}

TEST(SceneListTest, ABatchOfSeveralPartsIsItsRays) {
  constexpr std::size_t n = max_sorted_rays + 1000, step = 3008;
  const Rays<double> rays = random_rays<double>(n);
  Scene scene(2);
  scene.add_mesh(cage("cube_seams"), {2});
  const double near = 0;
  std::vector<double> far(n, 1e-3);  // most rays end before they meet anything
  for (std::size_t i = 0; i < n; i += 16) far[i] = 10;
  const RayBatch<double> batch{rays.values, {&near, 1}, far};
  const IntersectionList all = scene.list_intersections(batch);
  std::vector<std::uint32_t> counts(n);
  scene.count_intersections(batch, counts.data());
  ASSERT_EQ(all.offsets.size(), n + 1);
  for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(all.offsets[i + 1] - all.offsets[i], counts[i]);
  std::size_t hits = 0;
  for (std::size_t i = 0; i < n; i += step) {
    const std::span<const double> row(&rays.values[6 * i], 6);
    const IntersectionList one = scene.list_intersections({row, {&near, 1}, {&far[i], 1}});
    ASSERT_EQ(one.t.size(), counts[i]) << i;
    for (std::size_t k = 0; k < one.t.size(); ++k) ASSERT_EQ(one.t[k], all.t[all.offsets[i] + k]);
    hits += counts[i];
  }
  EXPECT_GT(hits, 200u);
}

/// Many instances that overlap: a ray visits a dozen, and thousands of rays share them.
void add_crowd(Scene& scene) {
  const std::uint32_t id = scene.add_mesh(cage("pole_12"), {3});
  test::Generator g{12};
  for (int k = 1; k < 60; ++k) {
    Affine a;
    const double angle = test::uniform(g, 0, 6.3), size = test::uniform(g, 0.3, 1);
    a.linear = {Vec3d{size * std::cos(angle), -size * std::sin(angle), 0},
                Vec3d{0.3 * size, size * std::cos(angle), size * std::sin(angle)},
                Vec3d{0, -size * std::sin(angle), size * std::cos(angle)}};
    a.offset = test::random_direction(g);
    scene.add_instance(id, a);
  }
}

// Rays wait for others to fill a register, across instances; what they meet must not depend on it.
TEST(SceneInstancesTest, SameBitsForAnyNumberOfThreadsAndOrder) {
  const Rays<float> rays = random_rays<float>(60000);
  Rays<float> reversed, few;
  for (std::size_t i = rays.size(); i-- > 0;) reversed.add(rays.org(i), rays.dir(i));
  for (std::size_t i = 0; i < 500; ++i) few.add(rays.org(i), rays.dir(i));
  Scene one(1), three(3);
  add_crowd(one), add_crowd(three);
  const Hits<float> expected = cast(one, rays);
  EXPECT_GT(one.statistics().splits, 1000u) << "many are undecided at first";
  EXPECT_TRUE(cast(three, rays) == expected);
  const Hits<float> back = cast(one, reversed), part = cast(one, few);
  const auto same = [&](const Hits<float>& h, std::size_t k, std::size_t i) {
    ASSERT_EQ(h.t[k], expected.t[i]);
    ASSERT_EQ(h.t_error[k], expected.t_error[i]);
    ASSERT_EQ(h.patch_id[k], expected.patch_id[i]);
    ASSERT_EQ(h.geometry_id[k], expected.geometry_id[i]);
    ASSERT_EQ(h.uv[2 * k], expected.uv[2 * i]);
  };
  for (std::size_t i = 0; i < rays.size(); ++i) same(back, rays.size() - 1 - i, i);
  for (std::size_t i = 0; i < few.size(); ++i) same(part, i, i);
  // The same hits as in double, where rays come one by one.
  Rays<double> exact;
  for (std::size_t i = 0; i < 2000; ++i) exact.add(rays.org(i), rays.dir(i));
  const Hits<double> d = cast(one, exact);
  for (std::size_t i = 0; i < exact.size(); ++i) {
    ASSERT_TRUE(expected.hit(i) || !d.hit(i)) << i;
    if (d.hit(i)) {
      ASSERT_LE(expected.t[i] - expected.t_error[i], d.t[i] + d.t_error[i]) << i;
    }
  }
}

TYPED_TEST(SceneTest, NearIsExclusiveAndFarInclusive) {
  using T = TypeParam;
  Scene scene(1);
  scene.add_mesh(cage("cube"));
  test::Generator g{5};
  Rays<T> rays;
  for (int i = 0; i < 500; ++i)
    rays.aim(std::pow(10.0, test::uniform(g, 0.5, 3)) * test::random_direction(g),
             0.3 * test::random_direction(g));
  const Hits<T> first = cast(scene, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Rays<T> one;
    one.add(rays.org(i), rays.dir(i));
    const T t = first.t[i], inf = std::numeric_limits<T>::infinity();
    EXPECT_EQ(cast<T>(scene, one, 0, t).t[0], t) << "tfar is inclusive";
    EXPECT_FALSE(cast<T>(scene, one, 0, std::nextafter(t, T(0))).t[0] < inf);
    const T second = cast<T>(scene, one, t, inf).t[0];
    EXPECT_GT(second, t) << "tnear is exclusive";
    EXPECT_LT(second, inf) << "the far side is there";
    EXPECT_FALSE(cast<T>(scene, one, t, t).t[0] < inf) << "an empty interval";
  }
}

TYPED_TEST(SceneTest, RaysThatAreNoneMiss) {
  using T = TypeParam;
  Scene scene(1);
  scene.add_mesh(cage("cube"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  Rays<T> rays;
  rays.add({0, 0, -3}, {0, 0, 0});
  for (const double bad : {nan, inf, -inf})
    for (int i = 0; i < 3; ++i) {
      Vec3d org{0, 0, -3}, dir{0, 0, 1};
      org[i] = bad;
      rays.add(org, {0, 0, 1});
      dir[i] = bad;
      rays.add({0, 0, -3}, dir);
    }
  rays.add({nan, nan, nan}, {nan, nan, nan});
  const Hits<T> hits = cast(scene, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(hits.t[i], std::numeric_limits<T>::infinity()) << i;
    EXPECT_EQ(hits.t_error[i], 0);
    EXPECT_EQ(hits.geometry_id[i], invalid_id);
    EXPECT_EQ(hits.primitive_id[i], invalid_id);
    EXPECT_EQ(hits.patch_id[i], invalid_id);
    EXPECT_EQ(hits.uv[2 * i], 0);
    EXPECT_EQ(hits.normal[3 * i + 2], 0);
  }
}

TYPED_TEST(SceneTest, ShortLongAndFarRaysHitTheSamePoint) {
  using T = TypeParam;
  Scene scene(1);
  scene.add_mesh(cage("cube"));
  Rays<T> unit;
  unit.add({0.25, 0.125, -4}, {0, 0, 1});
  const double z = -4 + double(cast(scene, unit).t[0]);
  for (const double length : {1e-30, 1e-3, 1e3, 1e30})
    for (const double distance : {4.0, 4096.0}) {
      Rays<T> ray;
      ray.add({0.25, 0.125, -distance}, {0, 0, length});
      const Hits<T> h = cast(scene, ray);
      ASSERT_TRUE(h.hit(0)) << length << " " << distance;
      EXPECT_NEAR(double(h.point[2]), z, 1e-5) << "the point is exact however far the ray began";
      EXPECT_NEAR(double(h.t[0]) * length / (distance + z), 1, 1e-6);
    }
}

TYPED_TEST(SceneTest, EmptyScenesAndBatches) {
  using T = TypeParam;
  Scene scene(1);
  const Rays<T> one = random_rays<T>(1), none;
  EXPECT_FALSE(cast(scene, one).hit(0)) << "no mesh";
  scene.add_mesh(ControlCage{});
  EXPECT_FALSE(cast(scene, one).hit(0)) << "a mesh without faces";
  scene.add_mesh(cage("cube"));
  EXPECT_TRUE(cast(scene, none).t.empty()) << "no rays";
  Rays<T> to_cube;
  to_cube.add({0, 0, -3}, {0, 0, 1});
  EXPECT_EQ(cast(scene, to_cube).geometry_id[0], 1u);
}

TYPED_TEST(SceneTest, OcclusionAgreesWithTheClosestHit) {
  using T = TypeParam;
  Scene scene(2);
  scene.add_mesh(cage("torus_creases"));
  const Rays<T> rays = random_rays<T>(20000);
  const Hits<T> hits = cast(scene, rays);
  std::vector<std::uint8_t> occluded(rays.size());
  const T tnear = 0, tfar = std::numeric_limits<T>::infinity();
  scene.test_occlusions<T>({rays.values, {&tnear, 1}, {&tfar, 1}}, occluded.data());
  for (std::size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(occluded[i] != 0, hits.hit(i)) << i;
}

TYPED_TEST(SceneTest, InstancesAreThePlacedMesh) {
  using T = TypeParam;
  // Turned, scaled and mirrored: the determinant is negative.
  Affine place;
  place.linear = {Vec3d{0, -1.5, 0}, Vec3d{-1.5, 0, 0}, Vec3d{0, 0, 1.5}};
  place.linear[0] = {0, 1.5, 0}, place.linear[1] = {1.5, 0, 0};
  place.offset = {0.5, -2, 1};
  ControlCage moved = cage("star_prism");
  for (Vec3d& p : moved.points) p = place.point(p);

  Scene instanced(1), direct(1);
  instanced.add_mesh(cage("cube"));
  const std::uint32_t star = instanced.add_mesh(cage("star_prism"), {4, place});
  direct.add_mesh(moved, {4});
  const Rays<T> rays = random_rays<T>(20000, place.offset, 1.0);
  const Hits<T> a = cast(instanced, rays), b = cast(direct, rays);
  int compared = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!b.hit(i) || !a.hit(i) || a.geometry_id[i] != star) continue;
    ++compared;
    ASSERT_NEAR(a.t[i], b.t[i], a.t_error[i] + b.t_error[i]) << i;
    EXPECT_EQ(a.primitive_id[i], b.primitive_id[i]);
    // The mirrored winding faces the other way: normals go with the placed faces.
    const Vec3d na{double(a.normal[3 * i]), double(a.normal[3 * i + 1]),
                   double(a.normal[3 * i + 2])};
    const Vec3d nb{double(b.normal[3 * i]), double(b.normal[3 * i + 1]),
                   double(b.normal[3 * i + 2])};
    EXPECT_NEAR(std::abs(dot(na, nb)), 1, 1e-3);
    EXPECT_NEAR(double(a.dp_du[3 * i]), double(b.dp_du[3 * i]), 1e-2);
  }
  EXPECT_GT(compared, 5000);
}

TYPED_TEST(SceneTest, MovedPointsEqualAFreshScene) {
  using T = TypeParam;
  ControlCage bent = cage("pole_8");
  for (Vec3d& p : bent.points) p.x += 0.3 * p.y * p.y, p.z *= 1.4;
  Scene moved(1), fresh(1);
  moved.add_mesh(cage("pole_8"), {4});
  const Rays<T> rays = random_rays<T>(3000);
  cast(moved, rays);  // makes the double path's patches, too
  moved.update_points(0, bent.points);
  fresh.add_mesh(bent, {4});
  const Hits<T> a = cast(moved, rays), b = cast(fresh, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    // The tree is another one, so that equal hits of neighbours may come in another order.
    ASSERT_EQ(a.hit(i), b.hit(i)) << i;
    if (a.hit(i)) {
      ASSERT_NEAR(a.t[i], b.t[i], a.t_error[i] + b.t_error[i]);
    }
  }
}

/// `points` scaled, then moved.
ControlCage placed(ControlCage c, double size, double offset) {
  for (Vec3d& p : c.points) p = size * p + Vec3d{offset, -offset, offset};
  return c;
}

// A grazing ray enters the surface and soon leaves it; float's bounds may not tell the two hits
// apart. One that starts between them must still find the way out.
TEST(SceneGrazingTest, AStartBetweenTwoHitsFindsTheSecond) {
  Scene scene(1);
  scene.add_mesh(cage("torus"), {4});
  const Hits<double> seen = cast(scene, random_rays<double>(20000));
  test::Generator g{9};
  Rays<float> rays;
  Rays<double> exact;
  for (std::size_t i = 0; i < seen.t.size(); ++i) {
    if (!seen.hit(i)) continue;
    const auto at = [&](const std::vector<double>& v) {
      return Vec3d{v[3 * i], v[3 * i + 1], v[3 * i + 2]};
    };
    const Vec3d along = (1 / length(at(seen.dp_du))) * at(seen.dp_du);
    const Vec3d inside = at(seen.point) - std::pow(10, test::uniform(g, -8, -5)) * at(seen.normal);
    rays.aim(inside - 2.0 * along, inside);
    exact.add(rays.org(rays.size() - 1), rays.dir(rays.size() - 1));
  }
  const double near = 0, far = std::numeric_limits<double>::infinity();
  const IntersectionList all = scene.list_intersections({exact.values, {&near, 1}, {&far, 1}});
  int compared = 0;
  for (std::size_t i = 0; i < rays.size(); ++i)
    for (std::size_t k = all.offsets[i]; k + 1 < all.offsets[i + 1]; ++k) {
      const auto start = static_cast<float>(0.5 * (all.t[k] + all.t[k + 1]));
      if (!(start > all.t[k] && start < all.t[k + 1] && all.t[k + 1] - all.t[k] < 0.02)) continue;
      Rays<float> ray;
      ray.add(rays.org(i), rays.dir(i));
      const Hits<float> h = cast(scene, ray, start);
      ++compared;
      ASSERT_LE(h.t[0] - h.t_error[0], all.t[k + 1]) << i << " from " << start;
    }
  EXPECT_GT(compared, 500);
}

TEST(ScenePlaceTest, HitsScaleAndMoveWithTheMesh) {
  test::Generator g{3};
  Scene reference(1);
  reference.add_mesh(cage("dart_semi"));
  for (const double size : {1.0 / 8192, 8192.0})
    for (const double offset : {0.0, 16384.0}) {
      Scene scene(1);
      scene.add_mesh(placed(cage("dart_semi"), size, offset));
      const Vec3d o{offset, -offset, offset};
      int hits = 0;
      for (int i = 0; i < 2000; ++i) {
        const Vec3d org = 4.0 * test::random_direction(g);
        const Vec3d dir = 0.5 * test::random_direction(g) - org;
        Rays<double> at_home, away;
        at_home.add(org, dir), away.add(o + size * org, size * dir);
        const auto a = cast(reference, at_home), b = cast(scene, away);
        // Adding the offset moves the ray by its rounding.
        const double slack = 1e-9 + 1e-14 * offset / size;
        if (!a.hit(0) || !b.hit(0)) continue;
        ++hits;
        EXPECT_NEAR(a.t[0], b.t[0], 1e3 * slack);
      }
      EXPECT_GT(hits, 500);
    }
}

TEST(SceneTruncateTest, WhatWasAddedLastIsTakenBack) {
  const Rays<float> rays = random_rays<float>(3000);
  Scene scene(1);
  scene.add_mesh(cage("cube_seams"));
  Affine moved;
  moved.offset = {0.7, 0, 0};
  scene.add_instance(0, moved);
  const Hits<float> before = cast(scene, rays);
  scene.add_mesh(cage("pole_12"), {3});
  moved.offset = {0, 0.8, 0};
  scene.add_instance(2, moved);
  scene.add_instance(0, moved);
  const Hits<float> after = cast(scene, rays);
  EXPECT_FALSE(after == before);

  scene.truncate(9);
  EXPECT_EQ(scene.geometry_count(), 5u);
  scene.truncate(2);
  EXPECT_EQ(scene.geometry_count(), 2u);
  EXPECT_EQ(scene.mesh_count(), 1u);
  EXPECT_TRUE(cast(scene, rays) == before);
  EXPECT_EQ(scene.add_mesh(cage("pole_12"), {3}), 2u);
  EXPECT_EQ(scene.mesh_count(), 2u);
  scene.truncate(0);
  EXPECT_EQ(scene.geometry_count(), 0u);
  EXPECT_EQ(scene.mesh_count(), 0u);
  for (const float t : cast(scene, rays).t) ASSERT_FALSE(std::isfinite(t));
}

TEST(SceneErrorsTest, WrongArgumentsAreNamed) {
  Scene scene(1);
  const std::vector<float> five(5), six(6), two(2);
  HitArrays<float> hits;
  EXPECT_THROW(scene.cast_rays<float>({five, six, six}, hits), std::invalid_argument);
  EXPECT_THROW(scene.cast_rays<float>({six, two, {six.data(), 1}}, hits), std::invalid_argument);
  EXPECT_THROW(scene.add_instance(0, Affine{}), std::invalid_argument);
  scene.add_mesh(cage("cube"));
  EXPECT_THROW(scene.update_points(0, {}), std::invalid_argument);
  Affine flat;
  flat.linear[2] = {0, 0, 0};
  EXPECT_THROW(scene.add_instance(0, flat), std::invalid_argument);
  EXPECT_THROW(Scene(-1), std::invalid_argument);
  EXPECT_THROW(Scene(2147483647), std::invalid_argument);
}

TEST(SceneProgressTest, CancelledCallsThrowAndTheSceneWorksAfterwards) {
  Scene scene(1);
  scene.add_mesh(cage("cube"));
  const Rays<float> rays = random_rays<float>(1000);
  std::vector<float> t(rays.size());
  HitArrays<float> out;
  out.t = t.data();
  const float tnear = 0, tfar = std::numeric_limits<float>::infinity();
  Progress progress;
  progress.cancel = true;
  EXPECT_THROW(scene.cast_rays<float>({rays.values, {&tnear, 1}, {&tfar, 1}}, out, &progress),
               Cancelled);
  progress.cancel = false;
  scene.cast_rays<float>({rays.values, {&tnear, 1}, {&tfar, 1}}, out, &progress);
  EXPECT_EQ(progress.done, rays.size());
}

}  // namespace
}  // namespace limitray

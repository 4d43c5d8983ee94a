// Cages and options that no one should use and someone will: refused with a message that names the
// rule, or traced with answers that are numbers in range; and calls that end early leave the scene
// as it was.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "../support/cast.h"
#include "../support/random_patches.h"
#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/memory.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

ControlCage cube() { return read_obj(test::cage_file("cube").string()); }

/// `sides` quads around a vertex, a hill.
ControlCage pole(int sides) {
  ControlCage cage;
  cage.points.push_back({0, 0, 1});
  for (int i = 0; i < 2 * sides; ++i) {
    const double angle = std::numbers::pi * i / sides;
    cage.points.push_back({std::cos(angle), std::sin(angle), i % 2 ? -0.5 : 0.0});
  }
  for (int i = 0; i < sides; ++i) {
    const int next = (2 * i + 2) % (2 * sides);
    cage.face_vertex_counts.push_back(4);
    cage.face_vertex_indices.insert(cage.face_vertex_indices.end(),
                                    {0, 2 * i + 1, 2 * i + 2, next + 1});
  }
  return cage;
}

/// One face with `sides` sides.
ControlCage polygon(int sides) {
  ControlCage cage;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    cage.points.push_back({std::cos(angle), std::sin(angle), 0.1 * (i % 3)});
    cage.face_vertex_indices.push_back(i);
  }
  cage.face_vertex_counts = {sides};
  return cage;
}

ControlCage scaled(ControlCage cage, double factor, Vec3d offset = {}) {
  for (Vec3d& p : cage.points) p = factor * p + offset;
  return cage;
}

/// Rays from around the bounds of a scene through points of the box, none of them parallel.
std::vector<double> rays_through(const std::array<Vec3d, 2>& box, int count) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<double> rays;
  for (int i = 0; i < count; ++i) {
    Vec3d from, to;
    for (int k = 0; k < 3; ++k) {
      const double middle = 0.5 * box[0][k] + 0.5 * box[1][k], half = box[1][k] - middle;
      to[k] = middle + half * (2 * share(random) - 1);
      from[k] = middle + 3 * half * (2 * share(random) - 1);
    }
    const Vec3d direction = to - from;
    rays.insert(rays.end(), {from.x, from.y, from.z, direction.x, direction.y, direction.z});
  }
  return rays;
}

template <class T>
struct Hits {
  std::vector<T> t, t_error, uv, normal, point;
  std::vector<std::uint32_t> face;

  Hits(const Scene& scene, const std::vector<double>& in_double) {
    const std::vector<T> rays(in_double.begin(), in_double.end());
    const std::size_t n = rays.size() / 6;
    t.resize(n), t_error.resize(n), uv.resize(2 * n), normal.resize(3 * n), point.resize(3 * n);
    face.resize(n);
    HitArrays<T> arrays;
    arrays.t = t.data(), arrays.t_error = t_error.data(), arrays.uv = uv.data();
    arrays.normal = normal.data(), arrays.point = point.data(), arrays.primitive_id = face.data();
    const T near = 0, far = std::numeric_limits<T>::infinity();
    scene.cast_rays<T>({rays, {&near, 1}, {&far, 1}}, arrays);
  }
  int count() const {
    return static_cast<int>(
        std::count_if(t.begin(), t.end(), [](T x) { return std::isfinite(x); }));
  }
};

/// Answers are numbers in range, normals unit. Double and float hit alike, but for a few grazing,
/// where the surface is thicker than their bounds.
void expect_sane(const ControlCage& cage, int isolation_level = 3, bool thick = true) {
  Scene scene;
  scene.add_mesh(cage, {isolation_level});
  if (scene.mesh_statistics(0).patches == 0) return;
  const std::vector<double> rays = rays_through(scene.bounds(), 300);
  const auto check = [&]<class T>(const Hits<T>& hits) {
    for (std::size_t i = 0; i < hits.t.size(); ++i) {
      ASSERT_FALSE(std::isnan(hits.t[i]));
      if (!std::isfinite(hits.t[i])) continue;
      ASSERT_LT(hits.face[i], cage.face_count());
      ASSERT_GE(hits.t_error[i], 0);
      double length = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        ASSERT_TRUE(std::isfinite(hits.point[3 * i + k]));
        length += std::pow(static_cast<double>(hits.normal[3 * i + k]), 2);
      }
      ASSERT_TRUE(length == 0 || std::abs(length - 1) < 1e-4) << length;
      ASSERT_TRUE(hits.uv[2 * i] >= 0 && hits.uv[2 * i] <= 1);
      ASSERT_TRUE(hits.uv[2 * i + 1] >= 0 && hits.uv[2 * i + 1] <= 1);
    }
  };
  const Hits<float> in_float(scene, rays);
  const Hits<double> in_double(scene, rays);
  check(in_float);
  check(in_double);
  if (thick) {
    EXPECT_NEAR(in_float.count(), in_double.count(), 3);
  }
}

template <class Error = std::invalid_argument>
std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}
std::string refusal(const ControlCage& cage, const MeshOptions& options = {3}) {
  return message_of([&] { Scene().add_mesh(cage, options); });
}

TEST(Hostile, ValencesFrom2To360) {
  for (const int sides : {2, 3, 7, 60, 360}) expect_sane(pole(sides), 2);
}

TEST(Hostile, FacesFrom3To64Sides) {
  for (int sides = 3; sides <= 64; ++sides) expect_sane(polygon(sides), 2);
}

TEST(Hostile, CagesWithoutASurfaceAreMissed) {
  ControlCage holes = cube();
  holes.hole_indices = {0, 1, 2, 3, 4, 5};
  ControlCage stray;
  stray.points = {{0, 0, 0}, {1, 2, 3}};
  for (const ControlCage& cage : {ControlCage{}, holes, stray}) {
    Scene scene;
    scene.add_mesh(cage);
    EXPECT_EQ(scene.mesh_statistics(0).patches, 0u);
    EXPECT_EQ(scene.mesh_statistics(0).limit_error, 0);
    EXPECT_EQ(Hits<float>(scene, {0, 0, 5, 0, 0, -1}).count(), 0);
    scene.add_mesh(cube());  // beside it
    EXPECT_EQ(Hits<float>(scene, {0, 0, 5, 0, 0, -1}).count(), 1);
  }
}

TEST(Hostile, StrayPointsCostNoPrecision) {
  ControlCage cage = cube();
  cage.points.push_back({1e300, -1e300, 3});
  Scene with, without;
  with.add_mesh(cage, {4});
  without.add_mesh(cube(), {4});
  const std::vector<double> rays = rays_through(without.bounds(), 500);
  EXPECT_EQ(Hits<float>(with, rays).t, Hits<float>(without, rays).t);
}

TEST(Hostile, DegenerateCages) {
  ControlCage point = cube();
  for (Vec3d& p : point.points) p = {1, 2, 3};
  ControlCage line = cube();
  for (Vec3d& p : line.points) p = {p.x, 0, 0};
  ControlCage flat = cube();
  for (Vec3d& p : flat.points) p.z = 0;
  ControlCage folded = pole(5);
  folded.points[3] = folded.points[1];
  for (const ControlCage& cage : {point, line, flat}) expect_sane(cage, 3, false);
  expect_sane(folded);
}

TEST(Hostile, DegenerateCagesTakeBoundedTime) {
  // All patches are the same line, and the ray runs along it.
  ControlCage line = cube();
  for (Vec3d& p : line.points) p = {p.x, 0, 0};
  Scene scene(1);
  scene.add_mesh(line, {4});
  const std::vector<double> ray = {-3, 0, 0, 1, 0, 0};
  std::uint32_t count = 0;
  const double near = 0, far = infinity;
  scene.count_intersections({ray, {&near, 1}, {&far, 1}}, &count);
  const Statistics s = scene.statistics();
  EXPECT_LE(s.splits, (1u << 16) + 1024 * s.patch_tests);
}

/// A sphere of quads with open ends, each shrunk to a point: an edge of every patch there.
ControlCage sphere_of_quads(int around, int along) {
  ControlCage c;
  const double pi = std::numbers::pi;
  for (int j = 0; j <= along; ++j)
    for (int i = 0; i < around; ++i) {
      const double a = 2 * pi * i / around, r = j % along ? std::sin(pi * j / along) : 0;
      c.points.push_back({r * std::cos(a), r * std::sin(a), std::cos(pi * j / along)});
    }
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i) {
      const int a = j * around + i, b = j * around + (i + 1) % around;
      c.face_vertex_counts.push_back(4);
      for (const int k : {a, a + around, b + around, b}) c.face_vertex_indices.push_back(k);
    }
  return c;
}

template <class T>
void expect_few_splits_at_the_poles(bool use_newton) {
  Scene scene(1);
  scene.add_mesh(sphere_of_quads(12, 6), {4});
  scene.set_newton(use_newton);
  test::Generator g{3};
  test::Rays<T> rays;
  for (int i = 0; i < 500; ++i) {
    const double z = scene.bounds()[i % 2].z;
    rays.aim(4.0 * test::random_direction(g), {i % 3 ? 0 : 1e-7 * test::uniform(g, -1, 1), 0, z});
  }
  const test::Hits<T> hits = cast(scene, rays);
  // In double a ray that was rounded may pass the pole.
  for (std::size_t i = 0; sizeof(T) == 4 && i < rays.size(); ++i) EXPECT_TRUE(hits.hit(i)) << i;
  EXPECT_EQ(scene.statistics().unresolved, 0u);
  EXPECT_LE(scene.statistics().splits, 500u * 500);
}
TEST(Hostile, CollapsedEdgesTakeFewSplits) {
  for (const bool use_newton : {false, true}) {
    expect_few_splits_at_the_poles<float>(use_newton);
    expect_few_splits_at_the_poles<double>(use_newton);
  }
}

TEST(Hostile, NonManifoldCages) {
  for (const char* name : {"non_manifold_edge", "non_manifold_vertex", "non_manifold_winding",
                           "back_to_back", "cube_isolated"})
    expect_sane(read_obj(test::cage_file(name).string()));
}

TEST(Hostile, Sharpnesses) {
  for (const float sharpness :
       {0.0f, 1e-30f, 9.999f, 10.0f, 1e30f, std::numeric_limits<float>::infinity()}) {
    ControlCage cage = cube();
    cage.crease_indices = {0, 1, 3};
    cage.crease_lengths = {3};
    cage.crease_sharpnesses = {sharpness};
    cage.corner_indices = {6};
    cage.corner_sharpnesses = {sharpness};
    expect_sane(cage, 2);
  }
  ControlCage cage = cube();
  cage.corner_indices = {6};
  for (const float sharpness : {-1.0f, std::numeric_limits<float>::quiet_NaN()}) {
    cage.corner_sharpnesses = {sharpness};
    EXPECT_EQ(refusal(cage).substr(0, 21), "corner_sharpnesses[0]");
  }
}

TEST(Hostile, SizesWithinTheLimitsAreTraced) {
  const std::vector<double> rays = [] {
    Scene scene;
    scene.add_mesh(cube(), {3});
    return rays_through(scene.bounds(), 400);
  }();
  Scene unit;
  unit.add_mesh(cube(), {3});
  const Hits<double> expected(unit, rays);
  for (const double size : {2e-15, 1e-9, 1e9, 9e14}) {
    Scene scene;
    scene.add_mesh(scaled(cube(), size), {3});
    std::vector<double> moved = rays;
    for (double& x : moved) x *= size;
    const Hits<double> in_double(scene, moved);
    EXPECT_EQ(in_double.count(), expected.count()) << size;
    const Hits<float> in_float(scene, moved);
    EXPECT_NEAR(in_float.count(), expected.count(), 2) << size;
    for (std::size_t i = 0; i < in_float.t.size(); ++i) {
      if (!std::isfinite(in_float.t[i])) continue;
      const float* n = &in_float.normal[3 * i];
      EXPECT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-5) << size;
    }
  }
}

TEST(Hostile, SizesBeyondTheLimitsAreRefused) {
  EXPECT_EQ(refusal(scaled(cube(), 1e16)).substr(0, 45),
            "points[0][0]: must be within 1e+15 of 0, got ");
  EXPECT_EQ(refusal(scaled(cube(), 1e-17)).substr(0, 58),
            "points: must reach at least 1e-15 from their centre, or be");
  Affine far;
  far.offset = {1e18, 0, 0};
  EXPECT_EQ(refusal(cube(), {3, far}).substr(0, 43), "transform: must keep the surface within 1e+");
  Scene scene;
  scene.add_mesh(cube(), {3});
  EXPECT_THROW(scene.add_instance(0, far), std::invalid_argument);
  EXPECT_THROW(scene.update_points(0, scaled(cube(), 1e16).points), std::invalid_argument);
  EXPECT_EQ(scene.geometry_count(), 1u);
  EXPECT_EQ(Hits<float>(scene, {0, 0, 5, 0, 0, -1}).count(), 1);
}

TEST(Hostile, RaysThatAreNoneMiss) {
  Scene scene;
  scene.add_mesh(cube(), {3});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> base = {0, 0, 5, 0, 0, -1};
  for (std::size_t k = 0; k < 6; ++k)
    for (const double bad : {nan, infinity, -infinity}) {
      std::vector<double> ray = base;
      ray[k] = bad;
      EXPECT_EQ(Hits<float>(scene, ray).count(), 0);
      EXPECT_EQ(Hits<double>(scene, ray).count(), 0);
    }
  EXPECT_EQ(Hits<double>(scene, {0, 0, 5, 0, 0, 0}).count(), 0);
  EXPECT_EQ(Hits<double>(scene, {}).count(), 0);
}

TEST(Hostile, ACageTooLargeNamesTheSizeItNeeds) {
  Scene scene;
  MeshOptions options{8};
  options.memory_limit = 100'000;
  const std::string message = message_of<OutOfMemory>([&] { scene.add_mesh(pole(20), options); });
  EXPECT_NE(message.find("the cage needs about 0.0"), std::string::npos) << message;
  EXPECT_NE(message.find("patches at isolation_level 8"), std::string::npos) << message;
  EXPECT_EQ(scene.geometry_count(), 0u);
  options.memory_limit = 1'000'000'000;
  EXPECT_EQ(scene.add_mesh(pole(20), options), 0u);
  EXPECT_GT(free_memory(), 1'000'000u);
}

TEST(Hostile, WrongOptionsAreNamed) {
  for (const int level : {-1, 11})
    EXPECT_EQ(refusal(cube(), {level}),
              "isolation_level: must be 1 to 10, or 0 to choose it, got " + std::to_string(level));
  for (const double tolerance : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(refusal(cube(), {0, {}, tolerance}).substr(0, 30), "tolerance: must be above 0, go");
}

TEST(Hostile, ACancelledBuildLeavesTheSceneAsItWas) {
  Scene scene;
  scene.add_mesh(cube(), {3});
  Progress progress;
  progress.cancel = true;
  EXPECT_THROW(scene.add_mesh(pole(40), {6}, &progress), Cancelled);
  EXPECT_EQ(scene.geometry_count(), 1u);
  EXPECT_EQ(scene.mesh_count(), 1u);
  EXPECT_EQ(Hits<float>(scene, {0, 0, 5, 0, 0, -1}).count(), 1);
}

TEST(Hostile, ACancelledBatchKeepsTheRowsItHasWritten) {
  Scene scene(1);
  scene.add_mesh(cube(), {3});
  std::vector<float> rays;
  for (int i = 0; i < 4'000'000; ++i) rays.insert(rays.end(), {0, 0, 5, 0, 0, -1});
  std::vector<float> t(rays.size() / 6, -1);
  HitArrays<float> hits;
  hits.t = t.data();
  const float near = 0, far = std::numeric_limits<float>::infinity();
  Progress progress;
  auto call = std::async(std::launch::async, [&] {
    scene.cast_rays<float>({rays, {&near, 1}, {&far, 1}}, hits, &progress);
  });
  while (progress.done == 0) std::this_thread::yield();
  progress.cancel = true;
  EXPECT_THROW(call.get(), Cancelled);
  std::size_t done = 0;
  for (const float x : t) {
    ASSERT_TRUE(x == -1 || x == t[0]);  // a row is written whole or not at all
    done += x != -1;
  }
  EXPECT_EQ(done, progress.done);
  EXPECT_LT(done, t.size());
}

}  // namespace
}  // namespace limitray

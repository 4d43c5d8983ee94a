// The frame of a ray (intersect/ray.h): its eps and eps_z against long double, for meshes of every
// size and place, near and far rays, short and long directions.
#include <gtest/gtest.h>

#include "../support/extent.h"
#include "../support/random_patches.h"
#include "limitray/intersect/ray.h"
#include "limitray/intersect/root_patch.h"
#include "limitray/patches/patch_model.h"

namespace limitray {
namespace {

using test::Real;

struct RaySetup {
  double size, offset, distance, direction_length;
};

template <class T>
class RayTest : public testing::Test {
 protected:
  test::Generator generator{5};

  /// A ray that passes within `size` of `center`, from `distance * size` away.
  ObjectRay random_ray(const RaySetup& s, const Vec3d& center) {
    Vec3d d = test::random_direction(generator);
    if (generator() % 4 == 0)
      d = Vec3d{0, 0, 0}, d[int(generator() % 3)] = generator() % 2 ? 1 : -1;
    ObjectRay ray;
    const Vec3d target =
        center + s.size * test::uniform(generator, 0, 1) * test::random_direction(generator);
    ray.org = target - (s.distance * s.size) * d;
    ray.dir = s.direction_length * d;
    return ray;
  }
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(RayTest, Types);

/// x, y, z of the point `center` + p in the frame of `ray`, in long double, from the numbers that
/// the caller gave.
template <class T>
Vec3<Real> exact_frame(const ObjectRay& ray, const PatchRay<T>& r, const Vec3d& center,
                       const Vec3<Real>& p) {
  const auto at = [&](int i) { return (Real(center[i]) - Real(ray.org[i])) + p[i]; };
  const Real dz = ray.dir[r.axis_z], depth = at(r.axis_z);
  const Real x = at(r.axis_x) - Real(ray.dir[r.axis_x]) / dz * depth;
  const Real y = at(r.axis_y) - Real(ray.dir[r.axis_y]) / dz * depth;
  // t of the point's depth, then the frame's own z of it.
  return {x, y, (depth / dz - Real(r.t_origin)) / Real(r.t_scale)};
}

/// Largest error over a random patch as a fraction of eps (x and y) and of eps_z.
struct Fractions {
  Real xy = 0, z = 0;
};
template <class T>
Fractions measure(test::Generator& g, const ObjectRay& ray, const Vec3d& center, double size) {
  const test::Patch patch = test::random_patch(g, test::Shape::wild, true, size);
  const test::RoundedPatch<T> rounded(patch);
  PatchRay<T> r;
  Fractions f;
  if (!make_patch_ray(ray, test::extent_of(test::radius_of(patch), center), r)) return f;
  const RootPatch<T> root =
      to_ray_frame(rounded.net, rounded.bump_or_null(), r,
                   project(make_patch_model(rounded.net, rounded.bump_or_null()), r));
  T got[3][16];
  store_net(got[0], root.x), store_net(got[1], root.y), store_net(got[2], root.z);
  for (int i = 0; i < 16; ++i) {
    const Vec3<Real> p{patch.net.c[0][i], patch.net.c[1][i], patch.net.c[2][i]};
    const Vec3<Real> want = exact_frame(ray, r, center, p);
    f.xy = std::max(
        {f.xy, std::abs(got[0][i] - want.x) / r.eps, std::abs(got[1][i] - want.y) / r.eps});
    f.z = std::max(f.z, std::abs(got[2][i] - want.z) / r.eps_z);
  }
  return f;
}

TYPED_TEST(RayTest, EpsBoundsTheErrorOfEveryControlValue) {
  using T = TypeParam;
  Fractions worst;
  for (const double size : {1e-4, 1.0, 1e4})
    for (const double offset : {0.0, 1.0, 1e4})
      for (const double distance : {0.0, 3.0, 1e3, 1e6})
        for (const double length : {1e-3, 1.0, 1e3})
          for (int round = 0; round < 60; ++round) {
            const Vec3d center = offset * test::random_direction(this->generator);
            const ObjectRay ray = this->random_ray({size, offset, distance, length}, center);
            const Fractions f = measure<T>(this->generator, ray, center, size);
            ASSERT_LE(f.xy, 1) << size << " " << offset << " " << distance << " " << length;
            ASSERT_LE(f.z, 1) << size << " " << offset << " " << distance << " " << length;
            worst.xy = std::max(worst.xy, f.xy), worst.z = std::max(worst.z, f.z);
          }
  std::printf("largest error: %.2Lf of eps, %.2Lf of eps_z\n", worst.xy, worst.z);
  EXPECT_GT(worst.xy, 0.05L);  // the bound is not absurdly loose
}

TYPED_TEST(RayTest, EpsScalesWithTheMeshAndNotWithItsPlace) {
  using T = TypeParam;
  PatchRay<T> near, moved, large;
  ASSERT_TRUE(make_patch_ray({{0, 0, -3}, {0, 0, 1}}, test::extent_of(1), near));
  ASSERT_TRUE(
      make_patch_ray({{1e4, 0, 1e4 - 3}, {0, 0, 1}}, test::extent_of(1, {1e4, 0, 1e4}), moved));
  ASSERT_TRUE(make_patch_ray({{0, 0, -3e4}, {0, 0, 1}}, test::extent_of(1e4), large));
  EXPECT_LT(moved.eps, near.eps * (std::is_same_v<T, float> ? T(1.001) : T(1e5)));
  EXPECT_NEAR(large.eps / near.eps, 1e4, 1);
}

TYPED_TEST(RayTest, DepthMapsBackToT) {
  using T = TypeParam;
  for (int round = 0; round < 300; ++round) {
    const double length = std::pow(10.0, test::uniform(this->generator, -3, 3));
    const ObjectRay ray = this->random_ray({1, 0, 3, length}, {0, 0, 0});
    PatchRay<T> r;
    if (!make_patch_ray(ray, test::extent_of(1), r)) continue;
    // The moved origin lies on the ray at t_of(0).
    const Vec3d p = ray.org + r.t_of(0) * ray.dir;
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(p[i], r.org[i], r.eps);
    EXPECT_GT(r.t_of(1), r.t_of(0));
  }
}

TYPED_TEST(RayTest, DepthIntervalIsRoundedOutward) {
  using T = TypeParam;
  for (int round = 0; round < 300; ++round) {
    ObjectRay ray = this->random_ray({1, 0, 3, 1}, {0, 0, 0});
    ray.tnear = test::uniform(this->generator, 0, 3),
    ray.tfar = ray.tnear + test::uniform(this->generator, 0.1, 3);
    PatchRay<T> r;
    if (!make_patch_ray(ray, test::extent_of(1), r)) continue;
    EXPECT_LE(r.t_of(r.zmin), ray.tnear);
    EXPECT_GE(r.t_of(r.zmax), ray.tfar);
    EXPECT_LT(r.t_of(r.zmin), r.t_of(r.zmax));
  }
}

TYPED_TEST(RayTest, ImpossibleRaysAreRefused) {
  using T = TypeParam;
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               inf = std::numeric_limits<double>::infinity();
  PatchRay<T> r;
  const Extent unit = test::extent_of(1);
  const Vec3d up{0, 0, 1}, below{0, 0, -3};
  EXPECT_TRUE(make_patch_ray({below, up}, unit, r));
  EXPECT_FALSE(make_patch_ray({below, {0, 0, 0}}, unit, r));
  for (const double bad : {nan, inf, -inf})
    for (int i = 0; i < 3; ++i) {
      Vec3d o = below, d = up;
      o[i] = bad;
      EXPECT_FALSE(make_patch_ray({o, up}, unit, r));
      d[i] = bad;
      EXPECT_FALSE(make_patch_ray({below, d}, unit, r));
    }
  EXPECT_FALSE(make_patch_ray({below, up, 2, 2}, unit, r));
  EXPECT_FALSE(make_patch_ray({below, up, nan, inf}, unit, r));
  EXPECT_FALSE(make_patch_ray({below, up, 0, nan}, unit, r));
  EXPECT_FALSE(make_patch_ray({{1.1, 0, -3}, up}, unit, r)) << "passes the mesh";
  EXPECT_TRUE(make_patch_ray({{1, 1, -3}, up}, unit, r)) << "grazes an edge of its box";
}

}  // namespace
}  // namespace limitray

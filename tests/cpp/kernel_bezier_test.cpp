// Bernstein weights, restrictions and splits against de Casteljau in long double, with the error
// bounds that docs/accuracy.md (section 2) charges for them.
#include <gtest/gtest.h>

#include "../support/random_patches.h"
#include "limitray/intersect/ray.h"
#include "limitray/math/bezier.h"

namespace limitray {
namespace {

using test::Real;

template <class T>
class BezierTest : public testing::Test {
 protected:
  test::Generator generator{11};
  const Real u = unit_roundoff<T>;

  void random_net(T (&p)[16]) {
    for (T& x : p) x = T(test::uniform(generator, -1, 1));
  }
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(BezierTest, Types);

/// Running error analysis (Higham 2002, section 5.1) of Horner's rule as `bernstein` does it: bound
/// on the sum of the four weights' errors at x, in units of roundoff.
Real weight_error_bound(Real x) {
  constexpr Real c[4][4] = {{0.125L, -0.75L, 1.5L, -1},
                            {0.375L, -0.75L, -1.5L, 3},
                            {0.375L, 0.75L, -1.5L, -3},
                            {0.125L, 0.75L, 1.5L, 1}};
  const Real r = x - 0.5L;
  Real total = 0;
  for (const auto& row : c) {
    Real value = row[3], slope = 0, error = 0;
    for (int k = 2; k >= 0; --k) {
      const Real product = r * value;
      slope = value + r * slope;
      error = std::abs(r) * error + std::abs(product);
      value = row[k] + product;
      error += std::abs(value);
    }
    // x - 1/2 is exact from 1/4 on.
    total += error + (x < 0.25L ? std::abs(slope * r) : 0);
  }
  return total;
}

TEST(BernsteinBoundTest, WeightsAreOffByLessThanTheChargedNineteenRoundings) {
  Real worst = 0;
  for (int i = 0; i <= 100000; ++i) worst = std::max(worst, weight_error_bound(i / Real(100000)));
  RecordProperty("worst_in_roundings", std::to_string(double(worst)));
  std::printf("sum of the weights' errors: %.2Lf u\n", worst);
  EXPECT_LT(worst, 19);
}

TYPED_TEST(BezierTest, WeightsStayWithinTheirBound) {
  using T = TypeParam;
  for (int i = 0; i < 20000 / test::rounds_divisor; ++i) {
    const T x = T(test::uniform(this->generator, 0, 1)) * (i % 4 == 0 ? T(1e-3) : T(1));
    const Quad<T> b = bernstein(x), d = bernstein_derivative(x);
    Real error = 0;
    for (int k = 0; k < 4; ++k) {
      Real e[4] = {0, 0, 0, 0};
      e[k] = 1;
      error += std::abs(Real(b[k]) - test::casteljau(e[0], e[1], e[2], e[3], x));
      const Real slope =
          3 * ((1 - Real(x)) * ((1 - Real(x)) * (e[1] - e[0]) + Real(x) * (e[2] - e[1])) +
               Real(x) * ((1 - Real(x)) * (e[2] - e[1]) + Real(x) * (e[3] - e[2])));
      EXPECT_NEAR(double(d[k]), double(slope), double(32 * this->u));
    }
    EXPECT_LE(error, weight_error_bound(x) * this->u * (1 + 1e-3L)) << x;
  }
}

/// Control value i of the cubic restricted to [a,b]: the blossom, by de Casteljau with mixed
/// arguments.
Real blossom(const Real (&p)[4], Real a, Real b, int i) {
  Real q[4] = {p[0], p[1], p[2], p[3]};
  for (int step = 0; step < 3; ++step) {
    const Real x = step < 3 - i ? a : b;
    for (int k = 0; k < 3 - step; ++k) q[k] = (1 - x) * q[k] + x * q[k + 1];
  }
  return q[0];
}

TYPED_TEST(BezierTest, RestrictionIsTheBlossom) {
  using T = TypeParam;
  for (int round = 0; round < 2000 / test::rounds_divisor; ++round) {
    const int level = int(this->generator() % 20);
    const T size = T(1) / T(1 << level);
    const T au = T(this->generator() % (1u << level)) * size,
            av = T(this->generator() % (1u << level)) * size;
    T p[16], r[16];
    this->random_net(p);
    store_net(
        r, restrict_uv(load_net(p), restriction<T>(au, au + size), restriction<T>(av, av + size)));
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) {
        Real rows[4];
        for (int k = 0; k < 4; ++k) {
          const Real row[4] = {p[4 * k], p[4 * k + 1], p[4 * k + 2], p[4 * k + 3]};
          rows[k] = blossom(row, au, au + size, i);
        }
        // Section 2: 7 roundings a direction; |p| <= 1.
        EXPECT_LE(std::abs(Real(r[4 * j + i]) - blossom(rows, av, av + size, j)), 14.1L * this->u);
      }
  }
}

TYPED_TEST(BezierTest, HalvesAreRestrictions) {
  using T = TypeParam;
  T p[16], got[16], want[16];
  this->random_net(p);
  const Net<T> n = load_net(p);
  const Restriction<T> whole = restriction<T>(0, 1);
  for (int half = 0; half < 2; ++half) {
    const Restriction<T> matrix = half ? high_half<T>() : low_half<T>();
    const Restriction<T> r = restriction<T>(T(0.5) * T(half), T(0.5) * T(half + 1));
    for (int across = 0; across < 2; ++across) {
      store_net(
          got, across ? restrict_u(spread_columns(n), matrix) : restrict_v(spread_rows(n), matrix));
      store_net(want, across ? restrict_uv(n, r, whole) : restrict_uv(n, whole, r));
      for (int i = 0; i < 16; ++i) EXPECT_NEAR(got[i], want[i], double(8 * this->u)) << i;
    }
  }
}

TYPED_TEST(BezierTest, DifferencesAreDerivativeNetsWithTheLastLineRepeated) {
  using T = TypeParam;
  T p[16], s[16], t[16];
  this->random_net(p);
  store_net(s, difference_u(load_net(p)));
  store_net(t, difference_v(load_net(p)));
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      const int ci = std::min(i, 2), cj = std::min(j, 2);
      EXPECT_EQ(s[4 * j + i], p[4 * j + ci + 1] - p[4 * j + ci]);
      EXPECT_EQ(t[4 * j + i], p[4 * cj + 4 + i] - p[4 * cj + i]);
    }
}

}  // namespace
}  // namespace limitray

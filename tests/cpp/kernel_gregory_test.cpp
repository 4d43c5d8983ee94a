// The bump form of a Gregory patch (patches/gregory.h): values against the textbook blend of f+ and
// f-, derivatives against finite differences, the constants against dense sampling, and what
// freezing a blend on a subdomain may lose.
#include <gtest/gtest.h>

#include "../support/random_patches.h"
#include "limitray/intersect/hit_attributes.h"
#include "limitray/patches/gregory.h"

namespace limitray {
namespace {

using test::Real;

/// g(a,b) of patches/gregory.h and its blend.
Real weight(Real x) { return 3 * x * (1 - x) * (1 - x); }
Real ratio(Real a, Real b) { return a + b > 0 ? (a - b) / (a + b) : 0; }
Real bump(Real a, Real b) { return weight(a) * weight(b) * ratio(a, b); }

template <class T>
class GregoryTest : public testing::Test {
 protected:
  test::Generator generator{3};
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(GregoryTest, Types);

TYPED_TEST(GregoryTest, SurfaceIsTheTextbookBlend) {
  using T = TypeParam;
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    const test::RoundedPatch<T> p(
        test::random_patch(this->generator, test::surface_shapes[round % 6], round % 4 != 0));
    const T s = T(test::random_parameter(this->generator)),
            t = T(test::random_parameter(this->generator));
    const SurfacePoint<T> got = evaluate_patch(p.net, p.bump_or_null(), s, t);
    for (int c = 0; c < 3; ++c) {
      const Real want =
          test::reference_component(p.net.c[c], p.gregory ? p.bump.c[c] : nullptr, s, t);
      // 64 roundings of the largest control value, as section 2 charges.
      EXPECT_NEAR(got.p[c], double(want), double(64 * unit_roundoff<T> * 2)) << s << " " << t;
    }
  }
}

TYPED_TEST(GregoryTest, DerivativesAreThoseOfTheSurface) {
  using T = TypeParam;
  const Real h = 1e-5L;
  for (int round = 0; round < 2000 / test::rounds_divisor; ++round) {
    const test::RoundedPatch<T> p(
        test::random_patch(this->generator, test::surface_shapes[round % 6], true));
    const T s = T(test::uniform(this->generator, 0.001, 0.999)),
            t = T(test::uniform(this->generator, 0.001, 0.999));
    const SurfacePoint<T> got = evaluate_patch(p.net, p.bump_or_null(), s, t);
    for (int c = 0; c < 3; ++c) {
      const auto at = [&](Real ds, Real dt) {
        return test::reference_component(p.net.c[c], p.bump.c[c], s + ds, t + dt);
      };
      EXPECT_NEAR(got.p_s[c], double((at(h, 0) - at(-h, 0)) / (2 * h)), 1e-5);
      EXPECT_NEAR(got.p_t[c], double((at(0, h) - at(0, -h)) / (2 * h)), 1e-5);
    }
  }
}

TYPED_TEST(GregoryTest, CornersHaveNoBumpAndFiniteDerivatives) {
  using T = TypeParam;
  for (int corner = 0; corner < 4; ++corner) {
    const BumpWeights<T> w = bump_weights(T(corner == 1 || corner == 2), T(corner >= 2));
    for (int k = 0; k < 4; ++k) {
      EXPECT_EQ(w.g[k], 0);
      EXPECT_EQ(w.g_s[k], 0);
      EXPECT_EQ(w.g_t[k], 0);
    }
  }
}

TEST(GregoryConstantsTest, SupremaAreWhatTheCodeSays) {
  Real top = 0, slope = 0, plain_slope = 0, both = 0;
  const int n = 1500 / test::rounds_divisor;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const Real a = i / Real(n), b = j / Real(n);
      const BumpWeights<double> w = bump_weights(double(a), double(b));
      top = std::max(top, std::abs(bump(a, b)));
      slope = std::max(slope, std::abs(Real(w.g_s[0])));
      both = std::max(both, std::abs(Real(w.g_s[0])) + std::abs(Real(w.g_t[0])));
      plain_slope = std::max(plain_slope, std::abs(3 * (1 - a) * (1 - 3 * a) * weight(b)));
    }
  std::printf("bump %.5Lf, its slope %.5Lf, sum of slopes %.5Lf, slope without blend %.5Lf\n", top,
              slope, both, plain_slope);
  EXPECT_LT(top, 0.0667L);
  EXPECT_GT(top, 0.0665L);
  EXPECT_LE(slope, bump_slope<double> * (1 + 1e-12L));
  EXPECT_GT(slope, bump_slope<double> * 0.999L);
  EXPECT_LE(plain_slope, bump_slope<double> * (1 + 1e-12L));
  EXPECT_LE(both, bump_slope<double> * (1 + 1e-12L));  // bump_gain of the whole patch
}

/// Second derivatives of the bump: by a twice, by a and b, by b twice.
struct Bend {
  Real aa, ab, bb;
};
Bend bend(Real a, Real b) {
  const auto slope = [](Real x) { return 3 * (1 - x) * (1 - 3 * x); };
  const auto curve = [](Real x) { return 3 * (6 * x - 4); };
  const Real s = a + b, w = (a - b) / s, w_a = 2 * b / (s * s), w_b = -2 * a / (s * s);
  const Real w_aa = -2 * w_a / s, w_bb = -2 * w_b / s, w_ab = 2 * w / (s * s);
  const Real p = weight(a), q = weight(b), p1 = slope(a), q1 = slope(b);
  return {curve(a) * q * w + 2 * p1 * q * w_a + p * q * w_aa,
          p1 * q1 * w + p1 * q * w_b + p * q1 * w_a + p * q * w_ab,
          p * curve(b) * w + 2 * p * q1 * w_b + p * q * w_bb};
}

TEST(GregoryConstantsTest, SecondDerivativesAreAsBoundedByTheCode) {
  Real curvature = 0, change = 0;
  const int n = 1500 / test::rounds_divisor;
  for (int j = 0; j <= n; ++j)
    for (int i = 1; i <= n; ++i)
      for (const Real scale : {Real(1), Real(1e-4L)}) {  // near the corner, too
        const Bend d = bend(scale * i / n, scale * j / n);
        const Real aa = std::abs(d.aa), ab = std::abs(d.ab), bb = std::abs(d.bb);
        curvature = std::max(curvature, aa / 2 + ab + bb / 2);
        change = std::max({change, aa + ab, bb + ab});
      }
  EXPECT_LE(curvature, bump_curvature<double>);
  EXPECT_GT(curvature, bump_curvature<double> * 0.99L);
  EXPECT_LE(change, bump_slope_change<double>);
  EXPECT_GT(change, bump_slope_change<double> * 0.99L);
}

TYPED_TEST(GregoryTest, FrozenBlendContainsTheTrueOne) {
  using T = TypeParam;
  for (int round = 0; round < 4000 / test::rounds_divisor; ++round) {
    const int lu = int(this->generator() % 12), lv = int(this->generator() % 12);
    const T su = T(1) / T(1 << lu), sv = T(1) / T(1 << lv);
    // Every second subdomain touches a border.
    const T s0 = round % 4 == 0 ? 0 : T(this->generator() % (1u << lu)) * su;
    const T t0 = round % 4 == 1 ? 1 - sv : T(this->generator() % (1u << lv)) * sv;
    const FrozenBlend<T> f = freeze_blend(s0, t0, su, sv);
    for (int j = 0; j <= 8; ++j)
      for (int i = 0; i <= 8; ++i) {
        const Real s = s0 + i / Real(8) * su, t = t0 + j / Real(8) * sv;
        const Real a[4] = {s, 1 - s, 1 - s, s}, b[4] = {t, t, 1 - t, 1 - t};
        for (int k = 0; k < 4; ++k) {
          const Real frozen = weight(a[k]) * weight(b[k]) * Real(f.mid[k]);
          EXPECT_LE(std::abs(bump(a[k], b[k]) - frozen), Real(f.deviation[k]));
        }
      }
  }
}

TYPED_TEST(GregoryTest, FrozenBlendGetsTightAsSubdomainsShrink) {
  using T = TypeParam;
  const FrozenBlend<T> f = freeze_blend<T>(T(0.25), T(0.5), T(1.0 / 1024), T(1.0 / 1024));
  for (int k = 0; k < 4; ++k) EXPECT_LT(f.deviation[k], T(0.001));
}

}  // namespace
}  // namespace limitray

// First order models of patches (patches/patch_model.h) hold the exact surface; models and hulls
// made for several patches at once, one a lane (bvh/trace_patches.h), are those of one patch alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "../support/random_patches.h"
#include "limitray/bvh/trace_patches.h"

namespace limitray {
namespace {

using test::Real;

/// What the model allows the surface to be from its tangent plane, ds and dt from the middle.
template <class T>
Real allowed(const PatchModel<T>& m, int axis, Real ds, Real dt) {
  const auto& a = m.axis[axis];
  const Real by_slopes = a.d_u.value() * std::abs(ds) + a.d_v.value() * std::abs(dt);
  const Real largest = std::max(std::abs(ds), std::abs(dt));
  return std::min(by_slopes, Real(m.curvature) * largest * largest);
}

template <class T>
class ModelTest : public testing::Test {};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(ModelTest, Types);

TYPED_TEST(ModelTest, HoldsTheExactSurface) {
  using T = TypeParam;
  test::Generator g{23};
  Real most = 0;
  for (int round = 0; round < 800 / test::rounds_divisor; ++round) {
    const test::Patch p = test::random_patch(g, test::all_shapes[round % 8], round % 3 != 0);
    const test::RoundedPatch<T> rounded(p);
    const PatchBump<T>* bump = rounded.bump_or_null();
    const PatchModel<T> m = make_patch_model(rounded.net, bump);
    const Real rounding = 16 * Real(unit_roundoff<T>) * test::radius_of(p);
    for (int k = 0; k < 81; ++k) {
      const Real ds = (k % 9) / Real(8) - 0.5L, dt = (k / 9) / Real(8) - 0.5L;
      for (int c = 0; c < 3; ++c) {
        const Real exact = test::reference_component(rounded.net.c[c], bump ? bump->c[c] : nullptr,
                                                     ds + 0.5L, dt + 0.5L);
        const auto& a = m.axis[c];
        const Real off = std::abs(exact - a.p - a.p_u * ds - a.p_v * dt);
        ASSERT_LE(off, allowed(m, c, ds, dt) + rounding) << round << " " << k << " " << c;
        if (allowed(m, c, ds, dt) > rounding) most = std::max(most, off / allowed(m, c, ds, dt));
      }
    }
  }
  EXPECT_GT(most, 0.5L);  // the bounds are not absurdly loose
}

TYPED_TEST(ModelTest, HeightsHoldTheExactSurface) {
  using T = TypeParam;
  test::Generator g{27};
  Real most = 0;
  for (int round = 0; round < 800 / test::rounds_divisor; ++round) {
    const test::Patch p = test::random_patch(g, test::all_shapes[round % 8], round % 3 != 0);
    const test::RoundedPatch<T> rounded(p);
    const PatchBump<T>* bump = rounded.bump_or_null();
    const PatchModel<T> m = make_patch_model(rounded.net, bump);
    ASSERT_LE(m.below, 0) << "the middle is at height 0";
    ASSERT_GE(m.above, 0);
    for (int k = 0; k < 81; ++k) {
      Real height = 0;
      for (int c = 0; c < 3; ++c) {
        const auto &a = m.axis[c], &b = m.axis[(c + 1) % 3], &d = m.axis[(c + 2) % 3];
        const Real n = Real(b.p_u) * d.p_v - Real(d.p_u) * b.p_v;
        height += n * (test::reference_component(rounded.net.c[c], bump ? bump->c[c] : nullptr,
                                                 (k % 9) / Real(8), (k / 9) / Real(8)) -
                       a.p);
      }
      ASSERT_LE(height, m.above) << round << " " << k;
      ASSERT_GE(height, m.below) << round << " " << k;
      if (m.above > 0) most = std::max(most, height / m.above);
    }
  }
  EXPECT_GT(most, 0.9L);  // they are met
}

TEST(HalfBoundTest, IsRoundedUpByLessThanAPercent) {
  test::Generator g{31};
  for (int round = 0; round < 10000; ++round) {
    const double x = std::pow(10.0, test::uniform(g, -30, 30));
    ASSERT_GE(HalfBound<float>(float(x)).value(), float(x));
    ASSERT_LE(HalfBound<float>(float(x)).value(), 1.0079 * x);
    ASSERT_GE(HalfBound<double>(x).value(), x);
    ASSERT_LE(HalfBound<double>(x).value(), (1 + 3e-7) * x);
  }
  EXPECT_EQ(HalfBound<float>(0.0f).value(), 0.0f);
  EXPECT_EQ(HalfBound<float>(std::numeric_limits<float>::infinity()).value(),
            std::numeric_limits<float>::infinity());
}

/// Patches with bumps for some of them, as a refiner hands them to the kernels.
struct Patches {
  std::vector<PatchNet<float>> nets;
  std::vector<PatchBump<float>> bumps;
  double radius = 0;

  Patches(test::Generator& g, bool gregory) {
    for (int j = 0; j < lane_count; ++j) {
      const test::Patch p = test::random_patch(g, test::all_shapes[g() % 8], gregory);
      const test::RoundedPatch<float> rounded(p);
      nets.push_back(rounded.net), bumps.push_back(rounded.bump);
      radius = std::max(radius, test::radius_of(p));
    }
  }
};

TEST(ModelsOfLanesTest, AreThoseOfOnePatch) {
  test::Generator g{29};
  for (int round = 0; round < 400 / test::rounds_divisor; ++round) {
    const Patches patches(g, round % 2);
    const PatchNet<float>* nets[lane_count];
    const PatchBump<float>* bumps[lane_count];
    PatchModel<float> models[lane_count], *to_models[lane_count];
    PatchHull<float> hulls[lane_count], *to_hulls[lane_count];
    for (int j = 0; j < lane_count; ++j) {
      nets[j] = &patches.nets[j], to_models[j] = models + j, to_hulls[j] = hulls + j;
      bumps[j] = round % 2 && j % 3 ? &patches.bumps[j] : nullptr;
    }
    PatchValues<Lanes> values;
    ModelValues<Lanes> model;
    PatchHull<Lanes> hull;
    load_values(nets, bumps, values);
    make_patch_model(values, model);
    make_patch_hull(values, hull);
    store_models(model, to_models);
    store_hulls(hull, to_hulls);
    for (int j = 0; j < lane_count; ++j) {
      const double rounding = 2e-5 * patches.radius;  // curvature sums hundreds of values
      const PatchModel<float> one = make_patch_model(*nets[j], bumps[j]);
      for (int c = 0; c < 3; ++c) {
        const auto &a = models[j].axis[c], &b = one.axis[c];
        ASSERT_NEAR(a.p, b.p, rounding);
        ASSERT_NEAR(a.p_u, b.p_u, rounding);
        ASSERT_NEAR(a.p_v, b.p_v, rounding);
        ASSERT_NEAR(a.d_u.value(), b.d_u.value(), rounding + b.d_u.value() / 128);
        ASSERT_NEAR(a.d_v.value(), b.d_v.value(), rounding + b.d_v.value() / 128);
      }
      ASSERT_NEAR(models[j].below, one.below, rounding);
      ASSERT_NEAR(models[j].above, one.above, rounding);
      ASSERT_NEAR(models[j].curvature, one.curvature, rounding);
      PatchHull<float> one_hull;
      make_patch_hull(values_of(*nets[j], bumps[j]), one_hull);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(hulls[j].lo[c], one_hull.lo[c], rounding);
        ASSERT_NEAR(hulls[j].hi[c], one_hull.hi[c], rounding);
      }
    }
  }
}

}  // namespace
}  // namespace limitray

// Primvars: the lookup of patches by place, and surfaces of values against the patches of
// positions.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "limitray/cage/limit.h"
#include "limitray/cage/obj.h"
#include "limitray/patches/patch_lookup.h"
#include "limitray/patches/primvar_surface.h"
#include "limitray/patches/refine.h"

namespace limitray {
namespace {

const std::filesystem::path cages = LIMITRAY_TEST_CAGES;

class EachCage : public testing::TestWithParam<const char*> {
 protected:
  ControlCage cage = read_obj(cages / GetParam());
  RefineOptions options{3};
};
INSTANTIATE_TEST_SUITE_P(Primvar, EachCage,
                         testing::Values("cube_semi_2_5.obj", "prism_5.obj", "torus_creases.obj",
                                         "pole_5.obj", "dart_semi.obj", "sheet_none.obj",
                                         "cube_hole.obj"));

TEST_P(EachCage, LookupFindsThePatchThatContainsThePoint) {
  const PatchBuffer<double> patches = Refiner(cage, options).make_patches(cage.points);
  const QuadNumbers quads(cage.face_vertex_counts);
  const PatchLookup lookup(quads, patches.infos);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::uint32_t i = 0; i < patches.size(); ++i) {
    const PatchInfo& info = patches.infos[i];
    const std::uint32_t quad = quads(info.face, info.sub_quad);
    for (int k = 0; k < 4; ++k) {
      const double u = info.u0 + unit(random) * info.du, v = info.v0 + unit(random) * info.dv;
      ASSERT_EQ(lookup.find(quad, u, v), i);
    }
  }
}

TEST_P(EachCage, LookupCoversBordersAndCorners) {
  const PatchBuffer<double> patches = Refiner(cage, options).make_patches(cage.points);
  const QuadNumbers quads(cage.face_vertex_counts);
  const PatchLookup lookup(quads, patches.infos);
  for (const PatchInfo& info : patches.infos)
    for (double u : {0.0, 0.5, 1.0})
      for (double v : {0.0, 0.25, 1.0}) {
        const std::uint32_t quad = quads(info.face, info.sub_quad);
        const PatchInfo& found = patches.infos[lookup.find(quad, u, v)];
        EXPECT_EQ(quads(found.face, found.sub_quad), quad);
        EXPECT_TRUE(found.u0 <= u && u <= found.u0 + found.du);
        EXPECT_TRUE(found.v0 <= v && v <= found.v0 + found.dv);
      }
}

TEST(PatchLookup, KnowsQuadsWithoutPatches) {
  const ControlCage cage = read_obj(cages / "cube_hole.obj");
  const PatchBuffer<double> patches = Refiner(cage, {}).make_patches(cage.points);
  const QuadNumbers quads(cage.face_vertex_counts);
  const PatchLookup lookup(quads, patches.infos);
  const auto hole = static_cast<std::uint32_t>(cage.hole_indices.at(0));
  EXPECT_EQ(lookup.find(quads(hole, 0), 0.5, 0.5), invalid_id);
}

/// The points of `cage` as a primvar, rounded to float.
Primvar points_as_primvar(const ControlCage& cage) {
  Primvar primvar{"rest", Interpolation::vertex, 3, {}, {}};
  for (std::size_t i = 0; i < cage.points.size(); ++i) {
    for (int k = 0; k < 3; ++k) primvar.values.push_back(static_cast<float>(cage.points[i][k]));
    primvar.indices.push_back(static_cast<std::int32_t>(i));
  }
  return primvar;
}

/// Away from extraordinary vertices the patches are the limit surface itself: half of all places
/// must agree to rounding, all of them to the error of Gregory patches of level 3.
TEST_P(EachCage, VertexPrimvarOfThePointsIsTheLimitSurface) {
  cage.primvars = {points_as_primvar(cage)};
  for (std::size_t i = 0; i < cage.points.size(); ++i)
    for (int k = 0; k < 3; ++k) cage.points[i][k] = cage.primvars[0].values[3 * i + k];
  const Refiner refiner(cage, options);
  const PrimvarSurface surface(cage, cage.primvars[0], refiner, options);
  const LimitEvaluator limit(cage);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  int exact = 0, count = 0;
  for (const PatchInfo& info : refiner.make_patches(cage.points).infos) {
    const double u = info.u0 + unit(random) * info.du, v = info.v0 + unit(random) * info.dv;
    double value[3], d_du[3], d_dv[3];
    surface.evaluate(info.face, info.sub_quad, u, v, value, d_du, d_dv);
    const LimitSample truth =
        limit.evaluate(static_cast<std::int32_t>(info.face), info.sub_quad, u, v);
    double error = 0;
    for (int k = 0; k < 3; ++k) error = std::max(error, std::abs(value[k] - truth.point[k]));
    EXPECT_LT(error, 0.01);
    exact += error < 1e-13;
    ++count;
  }
  EXPECT_GT(exact, count / 2);
}

TEST(PrimvarSurface, FaceVaryingChartsKeepApart) {
  ControlCage cage = read_obj(cages / "torus_creases.obj");
  Primvar chart{"chart", Interpolation::face_varying, 5, {}, {}};
  for (std::size_t f = 0, corner = 0; f < cage.face_count(); ++f)
    for (int k = 0; k < cage.face_vertex_counts[f]; ++k, ++corner) {
      chart.indices.push_back(static_cast<std::int32_t>(f));
      if (k == 0) chart.values.insert(chart.values.end(), 5, static_cast<float>(f));
    }
  cage.primvars = {chart};
  validate(cage);
  const PrimvarSurface surface(cage, cage.primvars[0], Refiner(cage, {}), {});
  EXPECT_EQ(surface.width(), 5);
  for (std::uint32_t f = 0; f < cage.face_count(); ++f)
    for (double u : {0.0, 0.3, 1.0}) {
      double value[5], d_du[5], d_dv[5];
      surface.evaluate(f, 0, u, 0.7, value, d_du, d_dv);
      for (int k = 0; k < 5; ++k) {
        EXPECT_NEAR(value[k], f, 1e-12);
        EXPECT_NEAR(d_du[k], 0, 1e-12);
        EXPECT_NEAR(d_dv[k], 0, 1e-12);
      }
    }
}

}  // namespace
}  // namespace limitray

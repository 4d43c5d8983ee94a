// What the patches are exact to: Bezier patches, creases of all kinds included, are the limit
// surface to rounding; Gregory patches are near it, nearer with each level of isolation. The truth
// is the limit evaluator, which shares no code with the refinement, and OpenSubdiv's limit masks.
#include <gtest/gtest.h>
#include <opensubdiv/far/patchMap.h>
#include <opensubdiv/far/patchTableFactory.h>
#include <opensubdiv/far/stencilTable.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "../support/patch_sampler.h"
#include "../support/random_creases.h"
#include "cage_files.h"
#include "limitray/cage/limit.h"
#include "limitray/cage/obj.h"
#include "limitray/patches/refine.h"
#include "opensubdiv_limits.h"

namespace limitray {
namespace {

using test::PatchPoint;
using test::PatchSampler;
using test::Place;

ControlCage load(const std::string& name) { return read_obj(test::cage_file(name)); }

PatchSampler sampler_of(const ControlCage& cage, int level) {
  return PatchSampler(Refiner(cage, {level}).make_patches(cage.points));
}

/// Largest distances from the limit surface, relative to the radius of the patches. That of Gregory
/// patches is along the limit's normal: their parametrization is another.
struct Errors {
  double bezier = 0, gregory = 0;
  std::size_t beziers = 0;
};

/// At `samples` random places, half of them near a corner, where deep patches are.
Errors errors_against_limit(const ControlCage& cage, int level, int samples) {
  const PatchSampler sampler = sampler_of(cage, level);
  const LimitEvaluator limit(cage);
  const double radius = sampler.patches().radius;
  Errors errors;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> inside(0, 1);
  std::vector<std::pair<std::int32_t, std::int32_t>> quads;
  for (const auto& [quad, patches] : sampler.quads()) quads.push_back(quad);
  for (int i = 0; i < samples && !quads.empty(); ++i) {
    const auto [face, sub_quad] = quads[random() % quads.size()];
    Place place{face, sub_quad, inside(random), inside(random)};
    if (i % 2 == 1) {
      const double scale = std::ldexp(1.0, -static_cast<int>(random() % 8));
      place.u = std::abs(static_cast<double>(random() % 2) - scale * place.u);
      place.v = std::abs(static_cast<double>(random() % 2) - scale * place.v);
    }
    const LimitSample truth = limit.evaluate(face, sub_quad, place.u, place.v);
    for (const PatchPoint& p : sampler.at(place)) {
      if (p.gregory) {
        const double off = std::abs(dot(p.point - truth.point, truth.normal)) / radius;
        errors.gregory = std::max(errors.gregory, off);
      } else {
        ++errors.beziers;
        errors.bezier = std::max(errors.bezier, length(p.point - truth.point) / radius);
      }
    }
  }
  return errors;
}

class LimitOfPatches : public testing::TestWithParam<std::filesystem::path> {};

TEST_P(LimitOfPatches, BezierPatchesAreTheLimitSurface) {
  const ControlCage cage = read_obj(GetParam());
  for (const int level : {1, 4})
    EXPECT_LT(errors_against_limit(cage, level, 300).bezier, 1e-13) << "level " << level;
}

TEST_P(LimitOfPatches, BezierPatchesAreTheLimitSurfaceUnderAnyTags) {
  const ControlCage cage = read_obj(GetParam());
  for (unsigned seed = 100; seed < 103; ++seed) {
    ControlCage tagged = test::with_random_creases(cage, seed);
    // OpenSubdiv averages fractional sharpnesses, and all of them under Chaikin's rule, in float.
    EXPECT_LT(errors_against_limit(tagged, 2, 200).bezier, 1e-7) << "seed " << seed;
    tagged.creasing_method = CreasingMethod::uniform;
    for (float& s : tagged.crease_sharpnesses) s = std::ceil(s);
    EXPECT_LT(errors_against_limit(tagged, 2, 200).bezier, 1e-13) << "seed " << seed;
  }
}

/// Where OpenSubdiv's mask of a refined vertex is its limit: not at the end of an infinitely sharp
/// crease and not at smooth vertices of valence 2.
bool osd_position_is_exact(const test::RefinedCorner& corner) {
  using Crease = OpenSubdiv::Sdc::Crease;
  return corner.settled && corner.rule != Crease::RULE_DART &&
         !(corner.rule == Crease::RULE_SMOOTH && corner.valence_faces == 2);
}

TEST_P(LimitOfPatches, BezierPatchesMeetOpenSubdivsLimitAtRefinedVertices) {
  const ControlCage cage = read_obj(GetParam());
  const PatchSampler sampler = sampler_of(cage, 3);
  const int steps = cage.face_count() < 100 ? 3 : 1;
  for (const test::RefinedCorner& corner : test::refined_corners(cage, steps)) {
    if (!osd_position_is_exact(corner)) continue;
    for (const PatchPoint& p : sampler.at({corner.face, corner.sub_quad, corner.u, corner.v})) {
      if (p.gregory) continue;
      ASSERT_LT(length(p.point - corner.limit), 1e-13 * sampler.patches().radius)
          << "face " << corner.face << " (" << corner.u << ", " << corner.v << ")";
    }
  }
}

std::string case_name(const testing::TestParamInfo<std::filesystem::path>& parameter) {
  return test::test_name(parameter.param) + "_" + std::to_string(parameter.index);
}
INSTANTIATE_TEST_SUITE_P(Files, LimitOfPatches, testing::ValuesIn(test::small_files(60'000)),
                         case_name);

// Semi-sharp creases by themselves: a crease through a sheet is nothing but crease pieces.
class SemiSharpCrease : public testing::TestWithParam<float> {};

TEST_P(SemiSharpCrease, IsExactInPiecesAndAtItsEnds) {
  ControlCage sheet = load("sheet_edge_only");
  std::mt19937 random(4);
  std::normal_distribution<double> shift(0, 0.2);
  for (Vec3d& p : sheet.points) p.z += shift(random);
  const CageTopology topology = make_topology(sheet);
  for (const CageTopology::Edge& edge : topology.edges) {
    // Inner edges in one direction only: parallel creases from boundary to boundary.
    const Vec3d d = sheet.points[edge.v1] - sheet.points[edge.v0];
    const bool along_x = std::abs(d.x) > std::abs(d.y);
    if (!along_x) continue;
    sheet.crease_indices.insert(sheet.crease_indices.end(), {edge.v0, edge.v1});
    sheet.crease_lengths.push_back(2);
    sheet.crease_sharpnesses.push_back(GetParam());
  }
  EXPECT_LT(errors_against_limit(sheet, 1, 3000).bezier, 1e-13);

  ControlCage cube = load("cube");
  cube.crease_indices = {0, 1, 3};
  cube.crease_lengths = {3};
  cube.crease_sharpnesses = {GetParam()};
  const Errors errors = errors_against_limit(cube, 3, 3000);
  EXPECT_GT(errors.beziers, 1500u);  // the others are Gregory patches at the corners
  EXPECT_LT(errors.bezier, 1e-13);
}
INSTANTIATE_TEST_SUITE_P(Sharpnesses, SemiSharpCrease, testing::Values(0.3f, 1, 2.5f, 3.7f, 9));

/// The cage's patches as OpenSubdiv makes and evaluates them, in one piece.
class OpenSubdivPatches {
 public:
  OpenSubdivPatches(const ControlCage& cage, int level) {
    std::unique_ptr<test::Far::TopologyRefiner> refiner = test::make_refiner(cage, 0);
    refiner->Unrefine();
    test::Far::PatchTableFactory::Options options(level);
    options.useInfSharpPatch = true;
    options.generateLegacySharpCornerPatches = false;
    options.SetPatchPrecision<double>();
    refiner->RefineAdaptive(options.GetRefineAdaptiveOptions());
    table_.reset(test::Far::PatchTableFactory::Create(*refiner, options));
    map_ = std::make_unique<test::Far::PatchMap>(*table_);

    for (const Vec3d& p : cage.points) points_.push_back({p});
    const test::Far::PrimvarRefinerReal<double> primvars(*refiner);
    points_.resize(refiner->GetNumVerticesTotal() + table_->GetNumLocalPoints());
    test::RefinedPoint *from = points_.data(), *to = from;
    for (int l = 1; l <= refiner->GetMaxLevel(); ++l, from = to) {
      to = from + refiner->GetLevel(l - 1).GetNumVertices();
      primvars.Interpolate(l, from, to);
    }
    table_->GetLocalPointStencilTable<double>()->UpdateValues(
        points_.data(), points_.data() + refiner->GetNumVerticesTotal());
  }

  Vec3d point(int ptex_face, double u, double v) const {
    const test::Far::PatchTable::PatchHandle* patch = map_->FindPatch(ptex_face, u, v);
    double weights[20];
    table_->EvaluateBasis(*patch, u, v, weights);
    const test::Far::ConstIndexArray indices = table_->GetPatchVertices(*patch);
    test::RefinedPoint sum;
    for (int i = 0; i < indices.size(); ++i) sum.AddWithWeight(points_[indices[i]], weights[i]);
    return sum.p;
  }

 private:
  std::unique_ptr<const test::Far::PatchTable> table_;
  std::unique_ptr<test::Far::PatchMap> map_;
  std::vector<test::RefinedPoint> points_;
};

TEST(Patches, AreOpenSubdivsAsANetAndABump) {
  for (const char* name : {"cube", "pole_8", "prism_5", "tetrahedron", "dart_infinite", "open_fan",
                           "cube_inf_loop", "icosahedron_smooth", "non_manifold_vertex"}) {
    const ControlCage cage = load(name);
    const PatchSampler sampler = sampler_of(cage, 3);
    const OpenSubdivPatches truth(cage, 3);
    std::mt19937 random(6);
    std::uniform_real_distribution<double> inside(0, 1);
    int ptex_face = 0, gregory = 0;
    for (const auto& [quad, patches] : sampler.quads()) {  // in ptex order, as there are no holes
      for (int i = 0; i < 100; ++i) {
        const double u = i % 2 ? inside(random) : inside(random) / 8, v = inside(random) / 8;
        for (const PatchPoint& p : sampler.at({quad.first, quad.second, u, v})) {
          gregory += p.gregory;
          ASSERT_LT(length(p.point - truth.point(ptex_face, u, v)),
                    1e-14 * sampler.patches().radius)
              << name << " face " << quad.first << " (" << u << ", " << v << ")";
        }
      }
      ++ptex_face;
    }
    EXPECT_GT(gregory, 50) << name;
  }
}

// Measured with 200,000 samples a level; relative to the radius of the patches.
struct Nearness {
  const char* cage;
  double level_2, level_4, level_6;
};
class GregoryPatches : public testing::TestWithParam<Nearness> {};

TEST_P(GregoryPatches, ComeAsNearAsMeasured) {
  const ControlCage cage = load(GetParam().cage);
  const double measured[] = {GetParam().level_2, GetParam().level_4, GetParam().level_6};
  for (int i = 0; i < 3; ++i) {
    const double error = errors_against_limit(cage, 2 + 2 * i, 10000).gregory;
    EXPECT_LT(error, 1.1 * measured[i]) << "level " << 2 + 2 * i;
    EXPECT_GT(error, 0.1 * measured[i]) << "level " << 2 + 2 * i;  // the sampling finds them
  }
}
INSTANTIATE_TEST_SUITE_P(Cages, GregoryPatches,
                         testing::Values(Nearness{"tetrahedron", 1.29e-3, 5.05e-5,
                                                  1.61e-6},  // valence 3
                                         Nearness{"cube", 6.11e-4, 2.31e-5, 7.38e-7},
                                         Nearness{"pole_5", 4.13e-4, 3.69e-5, 3.75e-6},
                                         Nearness{"pole_8", 1.73e-3, 2.90e-4, 5.64e-5},
                                         Nearness{"pole_12", 2.65e-3, 5.98e-4, 1.57e-4},
                                         Nearness{"pole_20", 2.96e-3, 8.03e-4, 2.59e-4},
                                         Nearness{"pole_48", 2.28e-3, 6.30e-4, 2.40e-4},
                                         Nearness{"dart_infinite", 6.64e-3, 7.34e-4, 7.42e-5}));

}  // namespace
}  // namespace limitray

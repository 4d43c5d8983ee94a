// The limit evaluator against OpenSubdiv's limit masks, against finite differences, and itself.
#include "limitray/cage/limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "opensubdiv_limits.h"

namespace limitray {
namespace {

using test::RefinedCorner;
constexpr auto smooth = OpenSubdiv::Sdc::Crease::RULE_SMOOTH;
constexpr auto dart = OpenSubdiv::Sdc::Crease::RULE_DART;
constexpr auto crease = OpenSubdiv::Sdc::Crease::RULE_CREASE;

ControlCage load(const std::string& name) { return read_obj(test::cage_file(name)); }

double extent(const ControlCage& cage) {
  Vec3d low = cage.points[0], high = low;
  for (const Vec3d& p : cage.points) {
    for (int i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], p[i]);
      high[i] = std::max(high[i], p[i]);
    }
  }
  return length(high - low);
}

Vec3d unit(Vec3d v) { return (1 / length(v)) * v; }

LimitSample at(const LimitEvaluator& limit, const RefinedCorner& corner) {
  return limit.evaluate(corner.face, corner.sub_quad, corner.u, corner.v);
}

// OpenSubdiv's position masks hold everywhere but at the end of an infinitely sharp crease, where
// it uses the smooth mask, and at smooth vertices of valence 2, where it returns the vertex.
bool osd_position_is_exact(const RefinedCorner& corner) {
  return corner.settled && corner.rule != dart &&
         !(corner.rule == smooth && corner.valence_faces == 2);
}

// Its tangents hold at smooth vertices and regular boundaries; beside an interior crease they are
// those of one side; at boundaries of 3 and more faces they are for other subdivision rules.
void expect_same_normal(const RefinedCorner& corner, Vec3d normal) {
  const Vec3d across = cross(corner.tangent1, corner.tangent2);
  if (length(across) <= 1e-6 * length(corner.tangent1) * length(corner.tangent2)) return;
  if ((corner.rule == smooth && corner.valence_faces > 2) || corner.valence_faces == 1 ||
      (corner.rule == crease && corner.valence_faces == 2)) {
    EXPECT_LT(length(normal - unit(across)), 1e-10) << "face " << corner.face;
  } else if (corner.rule == crease && corner.valence_faces <= 4) {
    EXPECT_LT(std::abs(dot(normal, unit(corner.tangent1))), 1e-10) << "face " << corner.face;
  }
}

class LimitOfCage : public testing::TestWithParam<std::filesystem::path> {};

std::vector<std::filesystem::path> all_files() {
  std::vector<std::filesystem::path> files = test::cage_files();
  const std::vector<std::filesystem::path> models = test::model_files();
  files.insert(files.end(), models.begin(), models.end());
  return files;
}

TEST_P(LimitOfCage, EqualsOpenSubdivsLimitAtRefinedVertices) {
  const ControlCage cage = read_obj(GetParam());
  const std::size_t faces = cage.face_count();
  const LimitEvaluator limit(cage);
  const double size = extent(cage);
  // Folds at vertices of valence 2 leave no tangent plane around them.
  bool valence_2 = false;
  const auto corners = test::refined_corners(cage, faces < 20 ? 3 : faces < 200 ? 2 : 1);
  for (const RefinedCorner& corner : corners) {
    valence_2 |= corner.rule == smooth && corner.valence_faces == 2;
  }
  for (const RefinedCorner& corner : corners) {
    if (!osd_position_is_exact(corner)) continue;
    const LimitSample sample = at(limit, corner);
    ASSERT_LT(length(sample.point - corner.limit), 1e-14 * size)
        << "face " << corner.face << " u " << corner.u << " v " << corner.v;
    if (!valence_2) expect_same_normal(corner, sample.normal);
  }
}

TEST_P(LimitOfCage, DerivativesAreThoseOfFiniteDifferences) {
  const ControlCage cage = read_obj(GetParam());
  const LimitEvaluator limit(cage);
  const double size = extent(cage), h = 1e-5;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> inside(0.05, 0.95);
  std::uniform_int_distribution<std::size_t> any_face(0, cage.face_count() - 1);
  for (int i = 0; i < 100; ++i) {
    const auto face = static_cast<std::int32_t>(any_face(random));
    const std::int32_t sides = cage.face_vertex_counts[face];
    const std::int32_t quad = sides == 4 ? 0 : i % sides;
    const double u = inside(random), v = inside(random);
    LimitSample here;
    try {
      here = limit.evaluate(face, quad, u, v);
    } catch (const std::invalid_argument&) {
      continue;  // a hole
    }
    const auto point = [&](double s, double t) { return limit.evaluate(face, quad, s, t).point; };
    const Vec3d du = (0.5 / h) * (point(u + h, v) - point(u - h, v));
    const Vec3d dv = (0.5 / h) * (point(u, v + h) - point(u, v - h));
    // Semi-sharp creases have steps in the second derivative: first order there.
    EXPECT_LT(length(du - here.dp_du), 1e-4 * size) << "face " << face;
    EXPECT_LT(length(dv - here.dp_dv), 1e-4 * size) << "face " << face;
    const Vec3d normal = cross(here.dp_du, here.dp_dv);
    if (length(normal) > 1e-6 * size * size) {
      EXPECT_LT(length(here.normal - unit(normal)), 1e-9);
    }
  }
}

// Names cases by their files.
std::string case_name(const testing::TestParamInfo<std::filesystem::path>& parameter) {
  return test::test_name(parameter.param) + "_" + std::to_string(parameter.index);
}

INSTANTIATE_TEST_SUITE_P(Files, LimitOfCage, testing::ValuesIn(all_files()), case_name);

// Where OpenSubdiv's masks are not exact, its refined vertices still converge to the limit.
class ConvergenceOfOpenSubdiv : public testing::TestWithParam<const char*> {};

TEST_P(ConvergenceOfOpenSubdiv, LeadsToTheLimitAtDartsAndValenceTwo) {
  const ControlCage cage = load(GetParam());
  const LimitEvaluator limit(cage);
  double errors[2] = {0, 0};
  for (const int level : {2, 6}) {
    for (const RefinedCorner& corner : test::refined_corners(cage, level)) {
      if (!corner.settled || osd_position_is_exact(corner)) continue;
      double& error = errors[level == 6];
      error = std::max(error, length(at(limit, corner).point - corner.limit));
    }
  }
  EXPECT_GT(errors[0], 0);
  EXPECT_LT(errors[1], errors[0] / 10);  // by an eigenvalue, at most 1/2 here, a level
}

INSTANTIATE_TEST_SUITE_P(Cages, ConvergenceOfOpenSubdiv,
                         testing::Values("cube_inf_chain", "back_to_back", "dart_infinite"));

// The cage after one step of OpenSubdiv, as a cage of its own.
ControlCage refined_cage(const ControlCage& cage) {
  const auto refiner = test::make_refiner(cage, 1);
  const auto& level = refiner->GetLevel(1);
  ControlCage refined;
  refined.interpolate_boundary = cage.interpolate_boundary;
  refined.creasing_method = cage.creasing_method;
  for (const test::RefinedPoint& point : test::refined_points(cage, *refiner)) {
    refined.points.push_back(point.p);
  }
  for (int face = 0; face < level.GetNumFaces(); ++face) {
    refined.face_vertex_counts.push_back(4);
    for (const int vertex : level.GetFaceVertices(face)) {
      refined.face_vertex_indices.push_back(vertex);
    }
  }
  for (int edge = 0; edge < level.GetNumEdges(); ++edge) {
    if (level.GetEdgeSharpness(edge) == 0) continue;
    refined.crease_lengths.push_back(2);
    refined.crease_sharpnesses.push_back(level.GetEdgeSharpness(edge));
    for (const int vertex : level.GetEdgeVertices(edge)) refined.crease_indices.push_back(vertex);
  }
  for (int vertex = 0; vertex < level.GetNumVertices(); ++vertex) {
    if (level.GetVertexSharpness(vertex) == 0) continue;
    refined.corner_indices.push_back(vertex);
    refined.corner_sharpnesses.push_back(level.GetVertexSharpness(vertex));
  }
  return refined;
}

// Semi-sharp features reach deeper than uniform refinement can follow: one step must not change
// the limit.
class RefinedOnce : public testing::TestWithParam<const char*> {};

TEST_P(RefinedOnce, HasTheSameLimit) {
  const ControlCage cage = load(GetParam());
  const ControlCage refined = refined_cage(cage);
  const LimitEvaluator limit(cage), limit_of_refined(refined);
  const auto refiner = test::make_refiner(cage, 1);
  for (int face = 0; face < static_cast<int>(refined.face_count()); ++face) {
    const test::RefinedPlace place = test::refined_place(*refiner, 1, face);
    for (const double u : {0.0, 0.01, 0.4, 1.0}) {
      for (const double v : {0.0, 0.02, 0.7, 1.0}) {
        const Vec3d expected = limit_of_refined.evaluate(face, 0, u, v).point;
        const Vec3d got = limit
                              .evaluate(place.face, place.sub_quad, place.u + u * place.size,
                                        place.v + v * place.size)
                              .point;
        ASSERT_LT(length(got - expected), 1e-14) << "face " << face << " u " << u << " v " << v;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cages, RefinedOnce,
                         testing::Values("cube_semi_9", "cube_semi_3_7", "cube_semi_0_3",
                                         "cube_chaikin", "cube_corners", "dart_semi",
                                         "pole_creased", "star_prism", "sheet_creased",
                                         "non_manifold_edge", "demo"));

// Difference between the normals at corner (0,0) of a face and at a distance of `step`.
double normal_jump(const LimitEvaluator& limit, int face, double step) {
  return length(limit.evaluate(face, 0, 0, 0).normal - limit.evaluate(face, 0, step, step).normal);
}

// Normals converge like the ratio of two eigenvalues to the number of halvings, slowly at many
// faces: from 0.6 a halving at valence 3 to 0.9 at valence 12.
TEST(LimitNormals, AtExtraordinaryVerticesAreLimitsOfNormals) {
  for (const char* name : {"cube", "pole_5", "pole_8", "pole_12", "tetrahedron", "prism_5"}) {
    const ControlCage cage = load(name);
    const LimitEvaluator limit(cage);
    for (std::size_t face = 0; face < cage.face_count(); ++face) {
      EXPECT_LT(normal_jump(limit, static_cast<int>(face), 1e-15), 0.01) << name;
    }
  }
}

// A boundary vertex in the middle of a fan of `faces` quads, the corner (0,0) of each.
ControlCage boundary_fan(int faces) {
  ControlCage cage;
  cage.points.push_back({0, 0, 0.1});
  for (int i = 0; i <= 2 * faces; ++i) {
    const double angle = 3.5 * i / (2 * faces), radius = i % 2 == 0 ? 1 : 1.4;
    cage.points.push_back({radius * std::cos(angle), radius * std::sin(angle), 0.2 * (i % 3)});
  }
  for (int i = 0; i < faces; ++i) {
    cage.face_vertex_counts.push_back(4);
    for (const int vertex : {0, 2 * i + 1, 2 * i + 2, 2 * i + 3}) {
      cage.face_vertex_indices.push_back(vertex);
    }
  }
  return cage;
}

TEST(LimitNormals, OnBoundariesAreLimitsOfNormals) {
  for (const int faces : {2, 3, 5, 6, 8, 12}) {
    const LimitEvaluator limit(boundary_fan(faces));
    for (int face = 0; face < faces; ++face) {
      EXPECT_LT(normal_jump(limit, face, 1e-15), 0.05) << faces << " faces, face " << face;
    }
  }
}

TEST(LimitNormals, FollowOrientation) {
  ControlCage cage = load("cube");
  const LimitEvaluator right(cage);
  cage.orientation = Orientation::left_handed;
  const LimitEvaluator left(cage);
  const LimitSample a = right.evaluate(1, 0, 0.3, 0.6), b = left.evaluate(1, 0, 0.3, 0.6);
  EXPECT_GT(a.normal.z, 0.9);  // face 1 is the top
  EXPECT_EQ(length(a.normal + b.normal), 0);
  EXPECT_EQ(length(a.dp_du - b.dp_du), 0);
}

TEST(Limit, KeepsItsDigitsFarFromTheOrigin) {
  ControlCage cage = load("pole_8");
  const LimitEvaluator limit(cage);
  const Vec3d shift{1024, -2048, 4096};
  for (Vec3d& point : cage.points) {
    // Points that lose nothing when they are moved.
    for (int i = 0; i < 3; ++i) point[i] = std::ldexp(std::round(std::ldexp(point[i], 24)), -24);
  }
  const LimitEvaluator near(cage);
  for (Vec3d& point : cage.points) point = point + shift;
  const LimitEvaluator far(cage);
  for (const double u : {1e-8, 1e-3, 0.4}) {
    const LimitSample a = near.evaluate(0, 0, u, 0.7 * u), b = far.evaluate(0, 0, u, 0.7 * u);
    EXPECT_LT(length(a.point + shift - b.point), 1e-12);
    EXPECT_LT(length(a.dp_du - b.dp_du), 1e-13 * length(a.dp_du));
    EXPECT_LT(length(a.normal - b.normal), 1e-13);
  }
}

TEST(Limit, IsTheSameFromSeveralThreads) {
  const ControlCage cage = load("demo");
  const LimitEvaluator limit(cage);
  const auto sweep = [&] {
    Vec3d sum{};
    for (std::size_t face = 0; face < cage.face_count(); ++face) {
      sum = sum + limit.evaluate(static_cast<std::int32_t>(face), 0, 0.01, 0.37).point;
    }
    return sum;
  };
  const Vec3d expected = sweep();
  Vec3d sums[4];
  std::vector<std::thread> threads;
  for (Vec3d& sum : sums) threads.emplace_back([&] { sum = sweep(); });
  for (std::thread& thread : threads) thread.join();
  for (const Vec3d& sum : sums) EXPECT_EQ(length(sum - expected), 0);
}

// Runs `call` and returns what it complains about.
template <class Call>
std::string complaint(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Limit, NamesWrongArguments) {
  const LimitEvaluator hole(load("cube_hole")), prism(load("prism_5")), open(load("sheet_none"));
  EXPECT_EQ(complaint([&] { hole.evaluate(6, 0, 0, 0); }), "face: must be in [0, 6), got 6");
  EXPECT_EQ(complaint([&] { hole.evaluate(0, 1, 0, 0); }), "sub_quad: must be in [0, 1), got 1");
  EXPECT_EQ(complaint([&] { prism.evaluate(5, 5, 0, 0); }), "sub_quad: must be in [0, 5), got 5");
  EXPECT_EQ(complaint([&] { prism.evaluate(0, 0, 1.5, 0); }), "u: must be in [0, 1], got 1.5");
  EXPECT_EQ(complaint([&] { prism.evaluate(0, 0, 0, NAN); }), "v: must be in [0, 1], got nan");
  const std::string absent = "face: must be part of the surface (no hole, no open boundary), got ";
  EXPECT_EQ(complaint([&] { hole.evaluate(1, 0, 0, 0); }), absent + "1");
  EXPECT_EQ(complaint([&] { open.evaluate(0, 0, 0, 0); }), absent + "0");
  EXPECT_EQ(complaint([&] { open.evaluate(5, 0, 0, 0); }), "nothing");
}

}  // namespace
}  // namespace limitray

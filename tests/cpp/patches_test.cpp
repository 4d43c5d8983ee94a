// Refinement to patches: they cover the surface once, meet without gaps, follow moved points, and
// are rounded and reordered faithfully. What they are exact to: patches_limit_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "../support/patch_sampler.h"
#include "../support/random_creases.h"
#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/cage/topology.h"
#include "limitray/patches/refine.h"
#include "limitray/patches/single_crease.h"

namespace limitray {
namespace {

using test::PatchPoint;
using test::PatchSampler;
using test::Place;

ControlCage load(const std::string& name) { return read_obj(test::cage_file(name)); }

PatchBuffer<double> patches_of(const ControlCage& cage, int level) {
  return Refiner(cage, {level}).make_patches(cage.points);
}

/// Sides x sides quads over a wavy square, large enough for several groups of faces.
ControlCage wavy_sheet(int sides) {
  ControlCage cage;
  for (int j = 0; j <= sides; ++j)
    for (int i = 0; i <= sides; ++i)
      cage.points.push_back({double(i), double(j), 2 * std::sin(0.7 * i) * std::cos(0.4 * j)});
  for (int j = 0; j < sides; ++j)
    for (int i = 0; i < sides; ++i) {
      const int v = j * (sides + 1) + i;
      cage.face_vertex_counts.push_back(4);
      cage.face_vertex_indices.insert(cage.face_vertex_indices.end(),
                                      {v, v + 1, v + sides + 2, v + sides + 1});
    }
  return cage;
}

/// Every sixth face of a sheet becomes two triangles, and creases of all sharpnesses are strewn
/// over it, so that groups meet in every kind of feature.
ControlCage rough_sheet(int sides, CreasingMethod method) {
  const ControlCage even = wavy_sheet(sides);
  ControlCage cage;
  cage.points = even.points;
  cage.creasing_method = method;
  std::mt19937 random(3);
  for (std::size_t f = 0; f < even.face_count(); ++f) {
    const auto* v = &even.face_vertex_indices[4 * f];
    if (random() % 6 == 0) {
      cage.face_vertex_counts.insert(cage.face_vertex_counts.end(), {3, 3});
      cage.face_vertex_indices.insert(cage.face_vertex_indices.end(),
                                      {v[0], v[1], v[2], v[0], v[2], v[3]});
    } else {
      cage.face_vertex_counts.push_back(4);
      cage.face_vertex_indices.insert(cage.face_vertex_indices.end(), v, v + 4);
    }
    if (random() % 4 != 0) continue;
    constexpr float sharpnesses[] = {0.3f, 1, 2.5f, 10};
    cage.crease_indices.insert(cage.crease_indices.end(), {v[0], v[1]});
    cage.crease_lengths.push_back(2);
    cage.crease_sharpnesses.push_back(sharpnesses[random() % 4]);
  }
  return cage;
}

struct Gap {
  double distance = 0;
  Place place{};

  void add(const Place& p, const std::vector<PatchPoint>& points) {
    for (const PatchPoint& q : points) {
      const double d = length(q.point - points[0].point);
      if (d > distance) *this = {d, p};
    }
  }
};

/// Largest gap between patches that meet inside a quad: along each patch's edges, so also where
/// one patch ends at the middle of another's edge.
Gap gap_within_quads(const PatchSampler& sampler) {
  Gap gap;
  for (const auto& [quad, patches] : sampler.quads()) {
    for (const std::size_t i : patches) {
      const PatchInfo& info = sampler.patches().infos[i];
      for (const double x : {0.0, 0.125, 0.3, 0.5, 0.77, 1.0}) {
        for (const auto& [s, t] : {std::pair{x, 0.0}, {1.0, x}, {x, 1.0}, {0.0, x}}) {
          const Place place{quad.first, quad.second, info.u0 + s * info.du, info.v0 + t * info.dv};
          gap.add(place, sampler.at(place));
        }
      }
    }
  }
  return gap;
}

/// The place at `x` along the edge that `corner` owns, and, at the middle of an n-gon's edge, the
/// same place in the next sub-quad.
std::vector<Place> places_on_edge(const CageTopology& topology, std::int32_t corner, double x) {
  const std::int32_t face = topology.corner_faces[corner];
  const std::int32_t k = corner - topology.face_offsets[face];
  const std::int32_t n = topology.face_offsets[face + 1] - topology.face_offsets[face];
  if (n == 4) {
    const double u[] = {x, 1, 1 - x, 0}, v[] = {0, x, 1, 1 - x};
    return {{face, 0, u[k], v[k]}};
  }
  std::vector<Place> places;
  if (x <= 0.5) places.push_back({face, k, 2 * x, 0});
  if (x >= 0.5) places.push_back({face, (k + 1) % n, 0, 2 * (1 - x)});
  return places;
}

/// Largest gap along edges of the cage, all their faces together, and along the seams between the
/// sub-quads of n-gons.
Gap gap_between_faces(const PatchSampler& sampler, const ControlCage& cage) {
  const CageTopology topology = make_topology(cage);
  Gap gap;
  const auto compare = [&](const std::vector<Place>& places) {
    std::vector<PatchPoint> points;
    for (const Place& place : places) {
      const std::vector<PatchPoint> more = sampler.at(place);
      points.insert(points.end(), more.begin(), more.end());
    }
    gap.add(places[0], points);
  };
  for (std::size_t e = 0; e < topology.edges.size(); ++e) {
    for (const double x : {0.0, 0.0625, 0.25, 0.31, 0.5, 0.6, 0.75, 0.9, 1.0}) {
      std::vector<Place> places;
      for (const std::int32_t corner : topology.edge_corners[static_cast<std::int32_t>(e)]) {
        const bool forward = cage.face_vertex_indices[corner] == topology.edges[e].v0;
        const auto more = places_on_edge(topology, corner, forward ? x : 1 - x);
        places.insert(places.end(), more.begin(), more.end());
      }
      compare(places);
    }
  }
  for (const auto& [quad, patches] : sampler.quads()) {
    const auto [face, k] = quad;
    const std::int32_t n = cage.face_vertex_counts[face];
    for (const double x : {0.0, 0.2, 0.5, 0.7, 1.0})
      if (n != 4) compare({{face, k, 1, x}, {face, (k + 1) % n, x, 1}});
  }
  return gap;
}

void expect_no_gaps(const ControlCage& cage, int level) {
  const PatchSampler sampler(patches_of(cage, level));
  const double tolerance = 1e-14 * sampler.patches().radius;
  for (const Gap& gap : {gap_within_quads(sampler), gap_between_faces(sampler, cage)})
    EXPECT_LE(gap.distance, tolerance) << "face " << gap.place.face << "." << gap.place.sub_quad
                                       << " (" << gap.place.u << ", " << gap.place.v << ")";
}

class PatchesOfCage : public testing::TestWithParam<std::filesystem::path> {};

TEST_P(PatchesOfCage, CoverEachQuadOfEachPresentFaceOnce) {
  const ControlCage cage = read_obj(GetParam());
  const PatchSampler sampler(patches_of(cage, 3));
  const std::vector<bool> absent = absent_faces(cage, make_topology(cage));
  std::size_t quads = 0;
  for (std::size_t f = 0; f < cage.face_count(); ++f)
    if (!absent[f]) quads += cage.face_vertex_counts[f] == 4 ? 1 : cage.face_vertex_counts[f];
  EXPECT_EQ(sampler.quads().size(), quads);

  std::mt19937 random(1);
  std::uniform_real_distribution<double> inside(0, 1);
  for (const auto& [quad, patches] : sampler.quads()) {
    EXPECT_FALSE(absent[quad.first]);
    double area = 0;
    for (const std::size_t i : patches) {
      const PatchInfo& info = sampler.patches().infos[i];
      area += double(info.du) * double(info.dv);
      EXPECT_TRUE(info.u0 >= 0 && info.v0 >= 0 && info.u0 + info.du <= 1 && info.v0 + info.dv <= 1);
    }
    EXPECT_EQ(area, 1) << "face " << quad.first;  // all sizes are powers of two
    for (int i = 0; i < 8; ++i)
      EXPECT_EQ(sampler.at({quad.first, quad.second, inside(random), inside(random)}).size(), 1u);
  }
}

TEST_P(PatchesOfCage, MeetWithoutGaps) {
  const ControlCage cage = read_obj(GetParam());
  for (const int level : {1, 2, 3}) expect_no_gaps(cage, level);
}

/// OpenSubdiv's Gregory patches do not meet where one infinitely sharp crease ends at an inner
/// vertex of only two faces.
bool has_sharp_end_between_two_faces(const ControlCage& cage) {
  const CageTopology topology = make_topology(cage);
  std::vector<int> sharp_edges(cage.points.size());
  for (const CreaseEdge& edge : crease_edges(cage)) {
    if (edge.sharpness < infinite_sharpness) continue;
    ++sharp_edges[edge.v0];
    ++sharp_edges[edge.v1];
  }
  for (std::size_t v = 0; v < cage.points.size(); ++v) {
    const auto vertex = static_cast<std::int32_t>(v);
    if (sharp_edges[v] == 1 && topology.vertex_corners[vertex].size() == 2 &&
        topology.vertex_edges[vertex].size() == 2)
      return true;
  }
  return false;
}

TEST_P(PatchesOfCage, MeetWithoutGapsUnderAnyTags) {
  const ControlCage cage = read_obj(GetParam());
  for (unsigned seed = 0; seed < 2; ++seed) {
    const ControlCage tagged = test::with_random_creases(cage, seed);
    if (!has_sharp_end_between_two_faces(tagged))
      expect_no_gaps(tagged, 1 + static_cast<int>(seed));
  }
}

std::string case_name(const testing::TestParamInfo<std::filesystem::path>& parameter) {
  return test::test_name(parameter.param) + "_" + std::to_string(parameter.index);
}
INSTANTIATE_TEST_SUITE_P(Files, PatchesOfCage, testing::ValuesIn(test::small_files(20'000)),
                         case_name);

TEST(Patches, GroupsOfFacesMeetWithoutGaps) {
  for (const CreasingMethod method : {CreasingMethod::uniform, CreasingMethod::chaikin}) {
    const ControlCage cage = rough_sheet(50, method);
    ASSERT_GT(cage.face_count(), 2048u);  // at least three groups
    expect_no_gaps(cage, 2);
  }
}

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

TEST(Patches, MovedPointsGiveWhatARebuildGives) {
  for (const ControlCage& cage : {load("demo"), rough_sheet(40, CreasingMethod::uniform)}) {
    const Refiner refiner(cage, {3});
    ControlCage moved = cage;
    std::mt19937 random(5);
    std::normal_distribution<double> shift(0, 0.1);
    for (Vec3d& p : moved.points) p = p + Vec3d{shift(random), shift(random), 3 + shift(random)};
    refiner.make_patches(cage.points);
    const PatchBuffer<double> updated = refiner.make_patches(moved.points);
    const PatchBuffer<double> rebuilt = patches_of(moved, 3);
    EXPECT_TRUE(same_bytes(updated.nets, rebuilt.nets));
    EXPECT_TRUE(same_bytes(updated.bumps, rebuilt.bumps));
    EXPECT_TRUE(same_bytes(updated.infos, rebuilt.infos));
    EXPECT_EQ(updated.radius, rebuilt.radius);
  }
}

TEST(Patches, AreRelativeToTheCentreOfTheCage) {
  ControlCage cage = load("demo");
  const PatchBuffer<double> here = patches_of(cage, 3);
  for (Vec3d& p : cage.points) p = p + Vec3d{1024, -4096, 512};
  const PatchBuffer<double> far = patches_of(cage, 3);
  EXPECT_LT(length(far.origin - here.origin - Vec3d{1024, -4096, 512}), 1e-11);
  EXPECT_NEAR(far.radius, here.radius, 1e-11);
  for (std::size_t i = 0; i < here.size(); ++i)
    for (int k = 0; k < 48; ++k)
      ASSERT_NEAR(far.nets[i].c[k / 16][k % 16], here.nets[i].c[k / 16][k % 16], 1e-11);
}

TEST(Patches, RadiusIsTheLargestControlValue) {
  const PatchBuffer<double> patches = patches_of(load("pole_8"), 2);
  double radius = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    test::Patch p{patches.nets[i], {}, patches.infos[i].bump != no_bump};
    if (p.gregory) p.bump = patches.bumps[patches.infos[i].bump];
    radius = std::max(radius, test::radius_of(p));
  }
  EXPECT_EQ(patches.radius, radius);
}

TEST(Patches, RoundingKeepsEachPatchAndItsBump) {
  const PatchBuffer<double> patches = patches_of(load("demo"), 3);
  std::vector<std::uint32_t> order(patches.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(2));
  const PatchBuffer<float> rounded = round_patches<float>(patches, order);
  ASSERT_EQ(rounded.size(), patches.size());
  ASSERT_EQ(rounded.bumps.size(), patches.bumps.size());
  std::uint32_t next_bump = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const PatchInfo &to = rounded.infos[i], &from = patches.infos[order[i]];
    ASSERT_EQ(to.face, from.face);
    ASSERT_EQ(to.u0, from.u0);
    for (int k = 0; k < 48; ++k)
      ASSERT_EQ(rounded.nets[i].c[k / 16][k % 16], float(patches.nets[order[i]].c[k / 16][k % 16]));
    ASSERT_EQ(to.bump == no_bump, from.bump == no_bump);
    if (to.bump == no_bump) continue;
    ASSERT_EQ(to.bump, next_bump++);  // bumps lie in the order of their patches
    for (int k = 0; k < 12; ++k)
      ASSERT_EQ(rounded.bumps[to.bump].c[k / 4][k % 4],
                float(patches.bumps[from.bump].c[k / 4][k % 4]));
  }
}

TEST(Patches, OfASurfaceWithoutFacesAreNone) {
  ControlCage cage = load("cube");
  cage.hole_indices = {0, 1, 2, 3, 4, 5};
  const PatchBuffer<double> patches = patches_of(cage, 3);
  EXPECT_EQ(patches.size(), 0u);
  EXPECT_EQ(patches.radius, 0);
}

TEST(Patches, WrongArgumentsAreNamed) {
  const ControlCage cage = load("cube");
  const auto message = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "";
  };
  for (const int level : {0, 11})
    EXPECT_EQ(message([&] { Refiner(cage, {level}); }),
              "isolation_level: must be 1 to 10, got " + std::to_string(level));
  EXPECT_EQ(message([&] {
              Refiner(cage, {3}).make_patches({cage.points.data(), 7});
            }),
            "points: must be as many as the cage has, 8, got 7");
}

TEST(CreasePieces, AreAsManyAsTheSharpnessNeeds) {
  const auto cuts = [](double sharpness) {
    std::vector<double> c{0};
    for (const CreasePiece& piece : crease_pieces(sharpness)) {
      EXPECT_EQ(piece.begin, c.back());
      c.push_back(piece.end);
    }
    return c;
  };
  EXPECT_EQ(cuts(0.3), (std::vector<double>{0, 0.5, 1}));
  EXPECT_EQ(cuts(1), (std::vector<double>{0, 0.5, 1}));
  EXPECT_EQ(cuts(2.5), (std::vector<double>{0, 0.125, 0.25, 1}));
  EXPECT_EQ(cuts(9), (std::vector<double>{0, 1.0 / 512, 1}));
}

}  // namespace
}  // namespace limitray

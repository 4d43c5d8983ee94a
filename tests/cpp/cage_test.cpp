// Validation of cages: what is refused, with which words, and what is only worth a warning.
#include "limitray/cage/cage.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/cage/topology.h"

namespace limitray {
namespace {

constexpr float inf = std::numeric_limits<float>::infinity();

ControlCage cube() { return read_obj(test::cage_file("cube")); }

// A flat grid of n x n quads.
ControlCage grid(int n) {
  ControlCage cage;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) cage.points.push_back({double(i), double(j), 0});
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i;
      cage.face_vertex_counts.push_back(4);
      for (const int v : {a, a + 1, a + n + 2, a + n + 1}) cage.face_vertex_indices.push_back(v);
    }
  }
  return cage;
}

std::string complaint(const ControlCage& cage) {
  try {
    validate(cage);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing";
}

std::string all_warnings(const ControlCage& cage) {
  std::string text;
  for (const std::string& message : validate(cage).messages) text += message + "\n";
  return text;
}

struct Wrong {
  const char* message;
  std::function<void(ControlCage&)> spoil;
};

class WrongCage : public testing::TestWithParam<Wrong> {};

TEST_P(WrongCage, IsRefusedWithArgumentRuleAndValue) {
  ControlCage cage = cube();
  ASSERT_EQ(complaint(cage), "nothing");
  GetParam().spoil(cage);
  EXPECT_EQ(complaint(cage), GetParam().message);
}

void add_crease(ControlCage& cage, std::vector<std::int32_t> chain, std::vector<float> values) {
  cage.crease_lengths.push_back(static_cast<std::int32_t>(chain.size()));
  cage.crease_indices.insert(cage.crease_indices.end(), chain.begin(), chain.end());
  cage.crease_sharpnesses.insert(cage.crease_sharpnesses.end(), values.begin(), values.end());
}

const Wrong wrong_points_and_faces[] = {
    {"points[3][1]: must be finite, got nan", [](ControlCage& c) { c.points[3].y = NAN; }},
    {"points[0][2]: must be finite, got -inf", [](ControlCage& c) { c.points[0].z = -inf; }},
    {"face_vertex_counts[2]: must be in [3, 65535], got 2",
     [](ControlCage& c) { c.face_vertex_counts[2] = 2; }},
    {"face_vertex_counts[0]: must be in [3, 65535], got -4",
     [](ControlCage& c) { c.face_vertex_counts[0] = -4; }},
    {"face_vertex_counts[0]: must be in [3, 65535], got 65536",
     [](ControlCage& c) { c.face_vertex_counts[0] = 65536; }},
    {"face_vertex_indices: must hold the sum of face_vertex_counts (23), got 24",
     [](ControlCage& c) { c.face_vertex_counts[5] = 3; }},
    {"face_vertex_indices[17]: must be in [0, 8), got 9",
     [](ControlCage& c) { c.face_vertex_indices[17] = 9; }},
    {"face_vertex_indices[0]: must be in [0, 8), got -1",
     [](ControlCage& c) { c.face_vertex_indices[0] = -1; }},
    {"face_vertex_indices[2]: must not repeat a vertex of face 0, got 0",
     [](ControlCage& c) { c.face_vertex_indices[2] = 0; }},
};

const Wrong wrong_tags[] = {
    {"crease_lengths[0]: must be at least 2, got 1",
     [](ControlCage& c) { add_crease(c, {0}, {1}); }},
    {"crease_indices: must hold the sum of crease_lengths (3), got 2",
     [](ControlCage& c) {
       add_crease(c, {0, 1}, {1});
       c.crease_lengths[0] = 3;
     }},
    {"crease_sharpnesses: must hold one value a chain (1) or one an edge (2), got 3",
     [](ControlCage& c) {
       add_crease(c, {0, 1, 3}, {1, 2, 3});
     }},
    {"crease_sharpnesses[1]: must be a number >= 0 (inf is allowed), got -1",
     [](ControlCage& c) {
       add_crease(c, {0, 1, 3}, {1, -1});
     }},
    {"crease_sharpnesses[0]: must be a number >= 0 (inf is allowed), got nan",
     [](ControlCage& c) {
       add_crease(c, {0, 1}, {NAN});
     }},
    {"crease_indices[1]: must be in [0, 8), got 8",
     [](ControlCage& c) {
       add_crease(c, {0, 8}, {1});
     }},
    {"crease_indices[4]: must go on along an edge of the mesh, got (1, 6)",
     [](ControlCage& c) {
       add_crease(c, {0, 2, 3}, {1});
       add_crease(c, {0, 1, 6}, {1});
     }},
    {"crease_indices[0]: must go on along an edge of the mesh, got (4, 4)",
     [](ControlCage& c) {
       add_crease(c, {4, 4}, {1});
     }},
    {"crease_indices[2]: must not crease an edge twice with other sharpness, got (1, 0) with 1 "
     "and 2",
     [](ControlCage& c) {
       add_crease(c, {0, 1}, {1});
       add_crease(c, {1, 0}, {2});
     }},
    {"corner_sharpnesses: must hold one value a corner index (1), got 0",
     [](ControlCage& c) { c.corner_indices = {0}; }},
    {"corner_indices[0]: must be in [0, 8), got 11",
     [](ControlCage& c) {
       c.corner_indices = {11};
       c.corner_sharpnesses = {1};
     }},
    {"corner_indices[1]: must name each index once, got 5",
     [](ControlCage& c) {
       c.corner_indices = {5, 5};
       c.corner_sharpnesses = {1, 1};
     }},
    {"corner_sharpnesses[0]: must be a number >= 0 (inf is allowed), got -0.5",
     [](ControlCage& c) {
       c.corner_indices = {5};
       c.corner_sharpnesses = {-0.5f};
     }},
    {"hole_indices[0]: must be in [0, 6), got 6", [](ControlCage& c) { c.hole_indices = {6}; }},
    {"hole_indices[2]: must name each index once, got 1",
     [](ControlCage& c) {
       c.hole_indices = {1, 2, 1};
     }},
};

Primvar texture(std::size_t indices, Interpolation interpolation = Interpolation::face_varying) {
  return {"st", interpolation, 2, {0, 0, 1, 1}, std::vector<std::int32_t>(indices, 1)};
}

const Wrong wrong_primvars[] = {
    {"primvars[\"st\"].width: must be at least 1, got 0",
     [](ControlCage& c) {
       c.primvars = {{"st", Interpolation::vertex, 0, {}, {}}};
     }},
    {"primvars[\"st\"].values: must hold whole rows of 2, got 3 values",
     [](ControlCage& c) {
       c.primvars = {{"st", Interpolation::vertex, 2, {0, 1, 2}, {}}};
     }},
    {"primvars[\"st\"].values[1][0]: must be finite, got nan",
     [](ControlCage& c) {
       c.primvars = {texture(24)};
       c.primvars[0].values[2] = NAN;
     }},
    {"primvars[\"st\"].indices: must hold one index a face corner (24), got 23",
     [](ControlCage& c) { c.primvars = {texture(23)}; }},
    {"primvars[\"st\"].indices: must hold one index a point (8), got 24",
     [](ControlCage& c) { c.primvars = {texture(24, Interpolation::vertex)}; }},
    {"primvars[\"st\"].indices: must hold one index a face (6), got 8",
     [](ControlCage& c) { c.primvars = {texture(8, Interpolation::uniform)}; }},
    {"primvars[\"st\"].indices[7]: must be in [0, 2), got 2",
     [](ControlCage& c) {
       c.primvars = {texture(24)};
       c.primvars[0].indices[7] = 2;
     }},
};

INSTANTIATE_TEST_SUITE_P(PointsAndFaces, WrongCage, testing::ValuesIn(wrong_points_and_faces));
INSTANTIATE_TEST_SUITE_P(Tags, WrongCage, testing::ValuesIn(wrong_tags));
INSTANTIATE_TEST_SUITE_P(Primvars, WrongCage, testing::ValuesIn(wrong_primvars));

TEST(Validate, WarnsAboutWhatIsAllowed) {
  EXPECT_EQ(all_warnings(cube()), "");
  const auto of = [](const char* name) { return all_warnings(read_obj(test::cage_file(name))); };
  EXPECT_EQ(of("cube_isolated"), "1 vertex belongs to no face\n");
  EXPECT_EQ(of("non_manifold_edge"),
            "1 edge is non-manifold (more than two faces, or faces of opposite winding): "
            "infinitely sharp\n"
            "2 vertices are non-manifold: an infinitely sharp corner or crease\n");
  EXPECT_EQ(of("non_manifold_vertex"),
            "1 vertex is non-manifold: an infinitely sharp corner or crease\n");
  EXPECT_EQ(of("sheet_none"), "10 faces at an open boundary dropped (interpolate_boundary none)\n");
}

TEST(Validate, AllowsRepeatedCreasesThatAgree) {
  ControlCage cage = cube();
  add_crease(cage, {0, 1}, {inf});
  add_crease(cage, {1, 0}, {inf});
  EXPECT_EQ(all_warnings(cage), "1 crease edge is repeated, with the same sharpness\n");
}

TEST(Validate, AllowsEmptySurfacesAndCoincidentPoints) {
  EXPECT_EQ(all_warnings(ControlCage{}), "the surface is empty\n");
  ControlCage holes = cube();
  holes.hole_indices = {0, 1, 2, 3, 4, 5};
  EXPECT_EQ(all_warnings(holes), "the surface is empty\n");
  ControlCage point = cube();
  for (Vec3d& p : point.points) p = {1, 2, 3};
  EXPECT_EQ(all_warnings(point), "6 faces have no area\n");
}

// `triangles` of a star around vertex 0; they share edges, or only the vertex.
ControlCage star(int triangles, bool share_edges) {
  ControlCage cage;
  cage.points.resize(1 + (share_edges ? triangles : 2 * triangles));
  for (int i = 0; i < triangles; ++i) {
    cage.face_vertex_counts.push_back(3);
    const int a = share_edges ? 1 + i : 1 + 2 * i;
    const int b = share_edges ? 1 + (i + 1) % triangles : a + 1;
    for (const int v : {0, a, b}) cage.face_vertex_indices.push_back(v);
  }
  return cage;
}

TEST(Validate, RefusesValencesThatOpenSubdivCannotCount) {
  EXPECT_EQ(complaint(star(65534, true)), "nothing");
  EXPECT_EQ(complaint(star(65535, true)),
            "face_vertex_indices[196602]: must use a vertex in fewer than 65535 faces, got 0 once "
            "more");
  EXPECT_EQ(complaint(star(40000, false)),
            "face_vertex_indices: must give vertex 0 at most 65535 edges, got 80000");
}

TEST(Validate, TakesAMillionFacesInAboutASecond) {
  const ControlCage cage = grid(1000);
  const auto start = std::chrono::steady_clock::now();
  validate(cage);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  RecordProperty("seconds", std::to_string(seconds.count()));
  EXPECT_LT(seconds.count(), 10);
}

TEST(CreaseEdges, ExpandChainsByEitherCount) {
  ControlCage cage = cube();
  add_crease(cage, {0, 1, 3}, {1.5f});
  add_crease(cage, {6, 7}, {inf});
  auto edges = crease_edges(cage);
  ASSERT_EQ(edges.size(), 3u);
  EXPECT_EQ(edges[1].v0, 1);
  EXPECT_EQ(edges[1].v1, 3);
  EXPECT_EQ(edges[1].sharpness, 1.5f);
  EXPECT_EQ(edges[2].sharpness, inf);
  cage.crease_sharpnesses = {1, 2, 3};
  edges = crease_edges(cage);
  EXPECT_EQ(edges[1].sharpness, 2);
  EXPECT_EQ(edges[2].sharpness, 3);
}

TEST(Topology, CountsAreEulersForClosedCages) {
  for (const auto& [name, characteristic] :
       {std::pair{"cube", 2}, {"torus", 0}, {"prism_64", 2}, {"pole_48", 2}, {"icosahedron", 2}}) {
    const ControlCage cage = read_obj(test::cage_file(name));
    const CageTopology topology = make_topology(cage);
    const int vertices = static_cast<int>(cage.points.size());
    const int edges = static_cast<int>(topology.edges.size());
    EXPECT_EQ(vertices - edges + static_cast<int>(cage.face_count()), characteristic) << name;
    for (int edge = 0; edge < edges; ++edge) EXPECT_EQ(topology.edge_corners[edge].size(), 2u);
  }
}

TEST(Topology, FindsEdgesFromBothEnds) {
  const CageTopology topology = make_topology(cube());
  EXPECT_EQ(topology.edges.size(), 12u);
  EXPECT_EQ(topology.find_edge(4, 5), topology.find_edge(5, 4));
  EXPECT_GE(topology.find_edge(4, 5), 0);
  EXPECT_EQ(topology.find_edge(0, 7), -1);
}

}  // namespace
}  // namespace limitray

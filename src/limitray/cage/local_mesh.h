// Stage: control cage. A face and the faces around it, and one step of Catmull-Clark subdivision
// that keeps a quarter of the face and the faces around that. The neighbourhood by shared vertices
// is all that a step needs, so it can be repeated without end.
#pragma once

#include <vector>

#include "limitray/cage/sharpness.h"
#include "limitray/math/vec.h"

namespace limitray {

/// The neighbourhood of one face. Face 0 is the face itself, vertices 0 to `inner` - 1 are its
/// corners in order; only at these are edges and faces complete. Points are relative to `origin`,
/// which moves with the neighbourhood, so that small differences keep their digits.
struct LocalMesh {
  struct Edge {
    int vertices[2];
    float sharpness;  // infinite where it has other than two faces
    int faces[2];     // -1 where there is none
  };

  Vec3d origin;
  std::vector<Vec3d> points;
  std::vector<SemiSharpEdges> semi_sharp;  // one a point
  std::vector<int> face_offsets;           // first corner of each face, and the end
  std::vector<int> corner_vertices;
  std::vector<int> corner_edges;  // edge from this corner to the next; -1 between outer vertices
  std::vector<int> corner_faces;
  std::vector<Edge> edges;
  int inner = 0;
  std::vector<float> inner_sharpness;           // of the vertex
  std::vector<std::vector<int>> inner_corners;  // corners at the vertex, in no order
  std::vector<std::vector<int>> inner_edges;    // edges at the vertex, in no order

  void clear(int new_inner);
  int add_point(Vec3d point, SemiSharpEdges edges_there);
  int add_edge(int v0, int v1, float sharpness);
  void add_corner(int vertex, int edge);
  /// Ends the face of the corners added last.
  void end_face();

  int face_count() const { return static_cast<int>(face_offsets.size()) - 1; }
  int face_size(int face) const { return face_offsets[face + 1] - face_offsets[face]; }
  int next_corner(int corner) const {
    const int face = corner_faces[corner];
    return corner + 1 == face_offsets[face + 1] ? face_offsets[face] : corner + 1;
  }
  int previous_corner(int corner) const {
    const int face = corner_faces[corner];
    return corner == face_offsets[face] ? face_offsets[face + 1] - 1 : corner - 1;
  }
  int other_end(int edge, int vertex) const {
    return edges[edge].vertices[edges[edge].vertices[0] == vertex ? 1 : 0];
  }
  VertexRule rule(int inner_vertex) const;
};

/// What subdivision does beyond Catmull and Clark's rules.
struct SubdivisionRules {
  bool chaikin = false;
  bool smooth_triangles = false;
};

/// Remembers the children of a mesh while it is subdivided. Kept between steps for its memory.
struct SubdivisionMemo {
  std::vector<int> vertices, edges, faces, half_edges, spokes;
  std::vector<Vec3d> face_middles;
};

/// Writes to `out` the quarter of `in`'s face 0 at corner `corner` and the faces around it. For a
/// quad, corner i of the quarter is the one at corner i's side: the quarter keeps the directions
/// of (u,v). For other faces corner 0 of the quarter is `corner`.
void subdivide(const LocalMesh& in, int corner, const SubdivisionRules& rules,
               SubdivisionMemo& memo, LocalMesh& out);

}  // namespace limitray

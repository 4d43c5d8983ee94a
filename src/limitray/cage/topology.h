// Stage: control cage. Comes in: face-vertex indices. Goes out: edges and incidences, which
// `validate` inspects and the limit evaluator walks. Linear in the size of the cage (edges are
// found by bucketing corners by their edge's smaller vertex).
//
// A corner is an index into `face_vertex_indices`; corner c of a face owns the edge from its vertex
// to the vertex of the next corner.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/cage/cage.h"

namespace limitray {

/// Rows of different lengths, one after the other.
struct Rows {
  std::vector<std::int32_t> offsets{0};  // one more than there are rows
  std::vector<std::int32_t> values;

  std::size_t size() const { return offsets.size() - 1; }
  std::span<const std::int32_t> operator[](std::int32_t row) const {
    return {values.data() + offsets[row], values.data() + offsets[row + 1]};
  }
  std::span<std::int32_t> operator[](std::int32_t row) {
    return {values.data() + offsets[row], values.data() + offsets[row + 1]};
  }
};

/// Incidences of a cage whose indices are in range and whose faces repeat no vertex.
struct CageTopology {
  struct Edge {
    std::int32_t v0, v1;  // v0 < v1
  };

  std::vector<std::int32_t> face_offsets;  // first corner of each face, and the end
  std::vector<std::int32_t> corner_faces;  // face of each corner
  std::vector<std::int32_t> corner_edges;  // edge of each corner
  std::vector<Edge> edges;                 // sorted by (v0, v1)
  std::vector<std::int32_t> first_edges;   // first edge with v0 = vertex, and the end
  Rows edge_corners;                       // corners that own an edge: one a face at the edge
  Rows vertex_corners;                     // corners at a vertex
  Rows vertex_edges;                       // edges at a vertex
  /// More than two faces, or two that run through the edge in the same direction.
  std::vector<bool> edge_non_manifold;
  /// The faces at the vertex are not one fan (or ring) of faces joined by manifold edges.
  /// A vertex without faces is manifold here.
  std::vector<bool> vertex_non_manifold;

  /// The edge between two vertices, or -1.
  std::int32_t find_edge(std::int32_t a, std::int32_t b) const;
};

/// Throws nothing: `cage` must have valid counts and indices and no repeated vertex in a face.
CageTopology make_topology(const ControlCage& cage);

/// Faces that are no part of the surface: holes, and with InterpolateBoundary::none all faces at a
/// vertex with a boundary edge that is not creased infinitely sharp. One flag a face.
std::vector<bool> absent_faces(const ControlCage& cage, const CageTopology& topology);

}  // namespace limitray

#include "limitray/cage/topology.h"

#include <algorithm>
#include <numeric>

namespace limitray {

namespace {

// Rows of `n` keys: row k lists the positions i with keys[i] == k, in order.
Rows group_by(std::span<const std::int32_t> keys, std::size_t n) {
  Rows rows;
  rows.offsets.assign(n + 1, 0);
  for (const std::int32_t key : keys) ++rows.offsets[key + 1];
  std::partial_sum(rows.offsets.begin(), rows.offsets.end(), rows.offsets.begin());
  rows.values.resize(keys.size());
  std::vector<std::int32_t> next(rows.offsets.begin(), rows.offsets.end() - 1);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    rows.values[next[keys[i]]++] = static_cast<std::int32_t>(i);
  }
  return rows;
}

// Vertex at the end of the edge that `corner` owns.
std::int32_t end_vertex(const ControlCage& cage, const CageTopology& topology,
                        std::int32_t corner) {
  const std::int32_t face = topology.corner_faces[corner];
  const bool last = corner + 1 == topology.face_offsets[face + 1];
  return cage.face_vertex_indices[last ? topology.face_offsets[face] : corner + 1];
}

void find_corners(const ControlCage& cage, CageTopology& topology) {
  const std::size_t corners = cage.face_vertex_indices.size();
  topology.face_offsets.reserve(cage.face_count() + 1);
  topology.face_offsets.push_back(0);
  topology.corner_faces.reserve(corners);
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const std::int32_t count = cage.face_vertex_counts[face];
    topology.face_offsets.push_back(topology.face_offsets.back() + count);
    topology.corner_faces.insert(topology.corner_faces.end(), count,
                                 static_cast<std::int32_t>(face));
  }
  topology.vertex_corners = group_by(cage.face_vertex_indices, cage.points.size());
}

// Buckets corners by the smaller vertex of their edge and sorts each bucket by the larger one:
// corners of the same edge become neighbours.
void find_edges(const ControlCage& cage, CageTopology& topology) {
  const std::size_t corners = cage.face_vertex_indices.size();
  std::vector<std::int32_t> smaller(corners), larger(corners);
  for (std::size_t c = 0; c < corners; ++c) {
    const auto [low, high] = std::minmax(
        {cage.face_vertex_indices[c], end_vertex(cage, topology, static_cast<std::int32_t>(c))});
    smaller[c] = low;
    larger[c] = high;
  }
  Rows buckets = group_by(smaller, cage.points.size());
  topology.corner_edges.resize(corners);
  topology.first_edges.reserve(cage.points.size() + 1);
  for (std::size_t v = 0; v < buckets.size(); ++v) {
    const std::span<std::int32_t> bucket = buckets[static_cast<std::int32_t>(v)];
    std::sort(bucket.begin(), bucket.end(), [&](std::int32_t a, std::int32_t b) {
      return larger[a] != larger[b] ? larger[a] < larger[b] : a < b;
    });
    topology.first_edges.push_back(static_cast<std::int32_t>(topology.edges.size()));
    for (std::size_t i = 0; i < bucket.size(); ++i) {
      if (i == 0 || larger[bucket[i]] != larger[bucket[i - 1]]) {
        topology.edges.push_back({static_cast<std::int32_t>(v), larger[bucket[i]]});
      }
      topology.corner_edges[bucket[i]] = static_cast<std::int32_t>(topology.edges.size()) - 1;
    }
  }
  topology.first_edges.push_back(static_cast<std::int32_t>(topology.edges.size()));
  topology.edge_corners = group_by(topology.corner_edges, topology.edges.size());
}

void find_vertex_edges(const ControlCage& cage, CageTopology& topology) {
  std::vector<std::int32_t> ends;
  ends.reserve(2 * topology.edges.size());
  for (const CageTopology::Edge& edge : topology.edges) {
    ends.push_back(edge.v0);
    ends.push_back(edge.v1);
  }
  topology.vertex_edges = group_by(ends, cage.points.size());
  for (std::int32_t& end : topology.vertex_edges.values) end /= 2;
}

void classify_edges(const ControlCage& cage, CageTopology& topology) {
  topology.edge_non_manifold.resize(topology.edges.size());
  for (std::size_t e = 0; e < topology.edges.size(); ++e) {
    const auto corners = topology.edge_corners[static_cast<std::int32_t>(e)];
    topology.edge_non_manifold[e] =
        corners.size() > 2 || (corners.size() == 2 && cage.face_vertex_indices[corners[0]] ==
                                                          cage.face_vertex_indices[corners[1]]);
  }
}

// The corner counter-clockwise after `corner` at the same vertex, or -1 at a boundary. The edge
// into the corner must be manifold.
std::int32_t next_around_vertex(const CageTopology& topology, std::int32_t corner) {
  const std::int32_t face = topology.corner_faces[corner];
  const bool first = corner == topology.face_offsets[face];
  const std::int32_t previous = first ? topology.face_offsets[face + 1] - 1 : corner - 1;
  const auto pair = topology.edge_corners[topology.corner_edges[previous]];
  if (pair.size() < 2) return -1;
  return pair[pair[0] == previous ? 1 : 0];
}

// Whether all faces at the vertex are met by walking around it from its leading face.
bool is_one_fan(const CageTopology& topology, std::span<const std::int32_t> corners) {
  std::int32_t start = corners[0];
  for (const std::int32_t corner : corners) {
    if (topology.edge_corners[topology.corner_edges[corner]].size() == 1) start = corner;
  }
  std::size_t met = 0;
  std::int32_t corner = start;
  do {
    ++met;
    corner = next_around_vertex(topology, corner);
  } while (corner >= 0 && corner != start);
  return met == corners.size();
}

void classify_vertices(CageTopology& topology) {
  const std::size_t vertices = topology.vertex_corners.size();
  topology.vertex_non_manifold.resize(vertices);
  for (std::size_t e = 0; e < topology.edges.size(); ++e) {
    if (!topology.edge_non_manifold[e]) continue;
    topology.vertex_non_manifold[topology.edges[e].v0] = true;
    topology.vertex_non_manifold[topology.edges[e].v1] = true;
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto corners = topology.vertex_corners[static_cast<std::int32_t>(v)];
    if (corners.empty() || topology.vertex_non_manifold[v]) continue;
    topology.vertex_non_manifold[v] = !is_one_fan(topology, corners);
  }
}

}  // namespace

std::int32_t CageTopology::find_edge(std::int32_t a, std::int32_t b) const {
  const auto [low, high] = std::minmax({a, b});
  const auto first = edges.begin() + first_edges[low], last = edges.begin() + first_edges[low + 1];
  const auto found = std::lower_bound(
      first, last, high, [](const Edge& edge, std::int32_t vertex) { return edge.v1 < vertex; });
  if (found == last || found->v1 != high) return -1;
  return static_cast<std::int32_t>(found - edges.begin());
}

CageTopology make_topology(const ControlCage& cage) {
  CageTopology topology;
  find_corners(cage, topology);
  find_edges(cage, topology);
  find_vertex_edges(cage, topology);
  classify_edges(cage, topology);
  classify_vertices(topology);
  return topology;
}

std::vector<bool> absent_faces(const ControlCage& cage, const CageTopology& topology) {
  std::vector<bool> absent(cage.face_count());
  for (const std::int32_t face : cage.hole_indices) absent[face] = true;
  if (cage.interpolate_boundary != InterpolateBoundary::none) return absent;

  std::vector<bool> sharp(topology.edges.size());
  for (const CreaseEdge& crease : crease_edges(cage)) {
    if (crease.sharpness < infinite_sharpness) continue;
    sharp[topology.find_edge(crease.v0, crease.v1)] = true;
  }
  for (std::size_t e = 0; e < topology.edges.size(); ++e) {
    if (sharp[e] || topology.edge_corners[static_cast<std::int32_t>(e)].size() != 1) continue;
    for (const std::int32_t vertex : {topology.edges[e].v0, topology.edges[e].v1}) {
      for (const std::int32_t corner : topology.vertex_corners[vertex]) {
        absent[topology.corner_faces[corner]] = true;
      }
    }
  }
  return absent;
}

}  // namespace limitray

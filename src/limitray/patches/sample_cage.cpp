// Stage: patches (S0). See sample_cage.h.
#include "limitray/patches/sample_cage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "limitray/cage/topology.h"

namespace limitray {
namespace {

constexpr std::size_t vertices_a_kind = 6, kinds_at_most = 12;
constexpr std::int32_t faces_a_vertex = 2;

/// What is counted at a vertex in passes over the corners.
struct Vertex {
  Vec3d normal{};      // sum over the faces
  double heights = 0;  // sum of squares over three other vertices of each face
  double roughness = 0;
  std::int32_t faces = 0, sharp_edges = 0, sides = 4;  // sides: of a face that is no quad
  // Hashes of the next vertices less those of the previous ones: 0 where the faces close.
  std::uint32_t neighbours = 0;
  bool sharp = false;

  bool on_boundary() const { return neighbours != 0; }
};

std::uint32_t hash(std::int32_t vertex) {
  std::uint32_t x = static_cast<std::uint32_t>(vertex) * 0x9E3779B9u + 0x7F4A7C15u;
  x = (x ^ (x >> 15)) * 0x85EBCA6Bu;
  return x ^ (x >> 13);
}

/// The vertex of a corner, and those after and before it.
struct Corner {
  std::int32_t vertex, next, after_next, previous;
};

/// Calls visit(face, corner) for each corner.
template <class Visit>
void for_each_corner(const ControlCage& cage, const Visit& visit) {
  const std::int32_t* first = cage.face_vertex_indices.data();
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const std::int32_t n = cage.face_vertex_counts[face];
    for (std::int32_t i = 0; i < n; ++i)
      visit(static_cast<std::int32_t>(face),
            Corner{first[i], first[(i + 1) % n], first[(i + 2) % n], first[(i + n - 1) % n]});
    first += n;
  }
}

std::vector<Vertex> inspect_vertices(const ControlCage& cage) {
  std::vector<Vertex> vertices(cage.points.size());
  for_each_corner(cage, [&](std::int32_t face, const Corner& c) {
    Vertex& vertex = vertices[c.vertex];
    const Vec3d p = cage.points[c.vertex];
    vertex.normal = vertex.normal + cross(cage.points[c.next] - p, cage.points[c.previous] - p);
    vertex.neighbours += hash(c.next) - hash(c.previous);
    ++vertex.faces;
    if (cage.face_vertex_counts[face] != 4) vertex.sides = cage.face_vertex_counts[face];
  });
  for (Vertex& vertex : vertices) {
    const double size = length(vertex.normal);
    if (size > 0) vertex.normal = (1 / size) * vertex.normal;
  }
  for_each_corner(cage, [&](std::int32_t, const Corner& c) {
    Vertex& vertex = vertices[c.vertex];
    const bool has_normal = dot(vertex.normal, vertex.normal) > 0;
    for (const std::int32_t other : {c.next, c.after_next, c.previous}) {
      const Vec3d edge = cage.points[other] - cage.points[c.vertex];
      const double height = has_normal ? dot(vertex.normal, edge) : length(edge);
      vertex.heights += height * height;
    }
  });
  // A vertex is also rough where its neighbours are.
  const auto own_roughness = [&](std::int32_t v) {
    return std::sqrt(vertices[v].heights / (3 * std::max(1, vertices[v].faces)));
  };
  for_each_corner(cage, [&](std::int32_t, const Corner& c) {
    double& roughness = vertices[c.vertex].roughness;
    for (const std::int32_t other : {c.next, c.previous})
      roughness = std::max({roughness, own_roughness(c.vertex), 0.25 * own_roughness(other)});
  });
  for (const CreaseEdge& crease : crease_edges(cage)) {
    if (crease.sharpness <= 0) continue;
    ++vertices[crease.v0].sharp_edges;
    ++vertices[crease.v1].sharp_edges;
  }
  for (std::size_t i = 0; i < cage.corner_indices.size(); ++i)
    vertices[cage.corner_indices[i]].sharp = cage.corner_sharpnesses[i] > 0;
  return vertices;
}

/// Without a Gregory patch: inside with four quads, or on a boundary with two, or one in a corner.
bool is_regular(const Vertex& v, InterpolateBoundary rule) {
  if (v.sides != 4 || v.sharp || v.sharp_edges > 0) return false;
  if (!v.on_boundary()) return v.faces == 4;
  return v.faces == 2 || (v.faces == 1 && rule == InterpolateBoundary::edge_and_corner);
}

/// The kind of each chosen vertex, else -1: the roughest of each kind are chosen, the kinds in
/// order of their roughest one.
std::vector<std::int32_t> choose_vertices(const ControlCage& cage,
                                          const std::vector<Vertex>& vertices) {
  using Kind = std::array<std::int32_t, 5>;
  std::map<Kind, std::vector<std::int32_t>> kinds;
  const auto rougher = [&](std::int32_t a, std::int32_t b) {
    const double ra = vertices[a].roughness, rb = vertices[b].roughness;
    return ra != rb ? ra > rb : a < b;
  };
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vertex& v = vertices[i];
    if (v.faces == 0 || is_regular(v, cage.interpolate_boundary)) continue;
    std::vector<std::int32_t>& best =
        kinds[{v.faces, v.on_boundary(), std::min(v.sharp_edges, 3), v.sharp, v.sides}];
    const auto vertex = static_cast<std::int32_t>(i);
    if (best.size() == vertices_a_kind && !rougher(vertex, best.back())) continue;
    best.push_back(vertex);
    std::sort(best.begin(), best.end(), rougher);
    if (best.size() > vertices_a_kind) best.pop_back();
  }
  std::vector<std::vector<std::int32_t>> ordered;
  for (const auto& [kind, best] : kinds) ordered.push_back(best);
  std::stable_sort(ordered.begin(), ordered.end(),
                   [&](const auto& a, const auto& b) { return rougher(a[0], b[0]); });
  std::vector<std::int32_t> chosen(vertices.size(), -1);
  for (std::size_t k = 0; k < std::min(ordered.size(), kinds_at_most); ++k)
    for (const std::int32_t vertex : ordered[k]) chosen[vertex] = static_cast<std::int32_t>(k);
  return chosen;
}

/// Flags of the faces that have a vertex of `vertices` (one flag each).
std::vector<bool> faces_at(const ControlCage& cage, const std::vector<bool>& vertices) {
  std::vector<bool> faces(cage.face_count());
  for_each_corner(cage, [&](std::int32_t face, const Corner& c) {
    if (vertices[c.vertex]) faces[face] = true;
  });
  return faces;
}

std::vector<bool> vertices_of(const ControlCage& cage, const std::vector<bool>& faces) {
  std::vector<bool> vertices(cage.points.size());
  for_each_corner(cage, [&](std::int32_t face, const Corner& c) {
    if (faces[face]) vertices[c.vertex] = true;
  });
  return vertices;
}

/// For each vertex of `chosen` some of its faces, evenly spread over the order of the faces.
std::vector<bool> choose_faces(const ControlCage& cage, const std::vector<Vertex>& vertices,
                               const std::vector<std::int32_t>& chosen) {
  std::vector<bool> hole(cage.face_count()), faces(cage.face_count());
  for (const std::int32_t face : cage.hole_indices) hole[face] = true;
  std::map<std::int32_t, std::int32_t> seen;  // faces met so far at the chosen vertices
  for_each_corner(cage, [&](std::int32_t face, const Corner& c) {
    if (chosen[c.vertex] < 0) return;
    const std::int32_t count = vertices[c.vertex].faces, wanted = faces_a_vertex + count / 12;
    if (seen[c.vertex]++ % std::max<std::int32_t>(1, count / wanted) == 0 && !hole[face])
      faces[face] = true;
  });
  return faces;
}

/// The faces `kept` of `cage` with their tags; those that are not `open` become holes.
SampleCage extract(const ControlCage& cage, const std::vector<bool>& kept,
                   const std::vector<bool>& open, const std::vector<std::int32_t>& chosen) {
  SampleCage sample;
  ControlCage& part = sample.cage;
  part.interpolate_boundary = cage.interpolate_boundary;
  part.triangle_subdivision_rule = cage.triangle_subdivision_rule;
  part.creasing_method = cage.creasing_method;
  std::vector<std::int32_t> number(cage.points.size(), -1);
  std::size_t corner = 0;
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const std::size_t end = corner + static_cast<std::size_t>(cage.face_vertex_counts[face]);
    if (!kept[face]) {
      corner = end;
      continue;
    }
    if (!open[face]) part.hole_indices.push_back(static_cast<std::int32_t>(part.face_count()));
    part.face_vertex_counts.push_back(cage.face_vertex_counts[face]);
    for (; corner < end; ++corner) {
      const std::int32_t v = cage.face_vertex_indices[corner];
      if (number[v] < 0) {
        number[v] = static_cast<std::int32_t>(part.points.size());
        part.points.push_back(cage.points[v]);
        sample.kinds.push_back(chosen[v]);
      }
      part.face_vertex_indices.push_back(number[v]);
    }
  }
  for (std::size_t i = 0; i < cage.corner_indices.size(); ++i) {
    if (number[cage.corner_indices[i]] < 0) continue;
    part.corner_indices.push_back(number[cage.corner_indices[i]]);
    part.corner_sharpnesses.push_back(cage.corner_sharpnesses[i]);
  }
  const CageTopology topology = make_topology(part);
  for (const CreaseEdge& crease : crease_edges(cage)) {
    const std::int32_t v0 = number[crease.v0], v1 = number[crease.v1];
    if (v0 < 0 || v1 < 0 || topology.find_edge(v0, v1) < 0) continue;
    part.crease_indices.insert(part.crease_indices.end(), {v0, v1});
    part.crease_lengths.push_back(2);
    part.crease_sharpnesses.push_back(crease.sharpness);
  }
  return sample;
}

}  // namespace

SampleCage sample_cage(const ControlCage& cage) {
  const std::vector<Vertex> vertices = inspect_vertices(cage);
  const std::vector<std::int32_t> chosen = choose_vertices(cage, vertices);
  const std::vector<bool> open = choose_faces(cage, vertices, chosen);
  if (std::find(open.begin(), open.end(), true) == open.end()) return {};
  std::vector<bool> kept = open;
  for (int ring = 0; ring < 2; ++ring) kept = faces_at(cage, vertices_of(cage, kept));
  return extract(cage, kept, open, chosen);
}

}  // namespace limitray

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

constexpr std::size_t vertices_a_kind = 3, kinds_at_most = 16;
constexpr std::int32_t faces_a_vertex = 2;

/// What is counted at a vertex in passes over the corners.
struct Vertex {
  Vec3d normal{};       // sum over the faces
  double heights = 0;   // sum of squares over the neighbours, corner by corner
  std::int32_t faces = 0, sharp_edges = 0, sides = 4;  // sides: of a face that is no quad
  // Hashes of the next vertices less those of the previous ones: 0 where the faces close.
  std::uint32_t neighbours = 0;
  bool sharp = false;

  bool on_boundary() const { return neighbours != 0; }
  double roughness() const { return faces > 0 ? std::sqrt(heights / (2 * faces)) : 0; }
};

std::uint32_t hash(std::int32_t vertex) {
  std::uint32_t x = static_cast<std::uint32_t>(vertex) * 0x9E3779B9u + 0x7F4A7C15u;
  x = (x ^ (x >> 15)) * 0x85EBCA6Bu;
  return x ^ (x >> 13);
}

/// Calls visit(face, vertex, next, previous) for each corner.
template <class Visit>
void for_each_corner(const ControlCage& cage, const Visit& visit) {
  const std::int32_t* first = cage.face_vertex_indices.data();
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const std::int32_t n = cage.face_vertex_counts[face];
    for (std::int32_t i = 0; i < n; ++i)
      visit(static_cast<std::int32_t>(face), first[i], first[i + 1 == n ? 0 : i + 1],
            first[i == 0 ? n - 1 : i - 1]);
    first += n;
  }
}

std::vector<Vertex> inspect_vertices(const ControlCage& cage) {
  std::vector<Vertex> vertices(cage.points.size());
  for_each_corner(cage, [&](std::int32_t face, std::int32_t v, std::int32_t next,
                            std::int32_t previous) {
    Vertex& vertex = vertices[v];
    const Vec3d p = cage.points[v];
    vertex.normal = vertex.normal + cross(cage.points[next] - p, cage.points[previous] - p);
    vertex.neighbours += hash(next) - hash(previous);
    ++vertex.faces;
    if (cage.face_vertex_counts[face] != 4) vertex.sides = cage.face_vertex_counts[face];
  });
  for (Vertex& vertex : vertices) {
    const double size = length(vertex.normal);
    if (size > 0) vertex.normal = (1 / size) * vertex.normal;
  }
  for_each_corner(cage, [&](std::int32_t, std::int32_t v, std::int32_t next,
                            std::int32_t previous) {
    for (const std::int32_t other : {next, previous}) {
      const Vec3d edge = cage.points[other] - cage.points[v];
      const bool flat = dot(vertices[v].normal, vertices[v].normal) > 0;
      const double height = flat ? dot(vertices[v].normal, edge) : length(edge);
      vertices[v].heights += height * height;
    }
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

/// The kind of each chosen vertex, else -1: the roughest of each kind are chosen, the kinds in order
/// of their roughest one.
std::vector<std::int32_t> choose_vertices(const ControlCage& cage,
                                          const std::vector<Vertex>& vertices) {
  using Kind = std::array<std::int32_t, 5>;
  std::map<Kind, std::vector<std::int32_t>> kinds;
  const auto rougher = [&](std::int32_t a, std::int32_t b) {
    const double ra = vertices[a].roughness(), rb = vertices[b].roughness();
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
  for_each_corner(cage, [&](std::int32_t face, std::int32_t v, std::int32_t, std::int32_t) {
    if (vertices[v]) faces[face] = true;
  });
  return faces;
}

std::vector<bool> vertices_of(const ControlCage& cage, const std::vector<bool>& faces) {
  std::vector<bool> vertices(cage.points.size());
  for_each_corner(cage, [&](std::int32_t face, std::int32_t v, std::int32_t, std::int32_t) {
    if (faces[face]) vertices[v] = true;
  });
  return vertices;
}

/// For each vertex of `chosen` some of its faces, evenly spread over the order of the faces.
std::vector<bool> choose_faces(const ControlCage& cage, const std::vector<Vertex>& vertices,
                               const std::vector<std::int32_t>& chosen) {
  std::vector<bool> hole(cage.face_count()), faces(cage.face_count());
  for (const std::int32_t face : cage.hole_indices) hole[face] = true;
  std::map<std::int32_t, std::int32_t> seen;  // faces met so far at the chosen vertices
  for_each_corner(cage, [&](std::int32_t face, std::int32_t v, std::int32_t, std::int32_t) {
    if (chosen[v] < 0) return;
    const std::int32_t stride = std::max<std::int32_t>(1, vertices[v].faces / (faces_a_vertex + vertices[v].faces / 12));
    if (seen[v]++ % stride == 0 && !hole[face]) faces[face] = true;
  });
  return faces;
}

/// The faces `kept` of `cage` with their tags; those that are not `open` become holes.
SampleCage extract(const ControlCage& cage, const std::vector<bool>& kept,
                   const std::vector<bool>& open,
                   const std::vector<std::int32_t>& chosen) {
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

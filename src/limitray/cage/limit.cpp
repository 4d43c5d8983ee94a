#include "limitray/cage/limit.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "limitray/cage/local_limit.h"
#include "limitray/cage/local_mesh.h"
#include "limitray/cage/topology.h"

namespace limitray {

namespace {

// Subdivisions after which a face is a point for a double, and after which a corner without masks
// has converged.
constexpr int max_depth = 64;

template <class Value>
[[noreturn]] void fail(const char* argument, const std::string& rule, Value value) {
  std::ostringstream text;
  text.precision(17);
  text << argument << ": must be " << rule << ", got " << value;
  throw std::invalid_argument(text.str());
}

std::string range(std::int64_t end) { return "in [0, " + std::to_string(end) + ")"; }

// Numbers things of a cage in the order they are met. A small hash table, kept for its memory.
class Numbering {
 public:
  void clear() {
    std::fill(slots_.begin(), slots_.end(), Slot{});
    size_ = 0;
  }
  int size() const { return size_; }

  /// The number of `key`; a new key gets the next one.
  int number(std::int32_t key) {
    if (2 * (static_cast<std::size_t>(size_) + 1) > slots_.size()) grow();
    Slot& slot = find(key);
    if (slot.number < 0) slot = {key, size_++};
    return slot.number;
  }

 private:
  struct Slot {
    std::int32_t key = 0;
    int number = -1;
  };

  Slot& find(std::int32_t key) {
    const std::size_t mask = slots_.size() - 1;
    std::size_t at = (static_cast<std::uint32_t>(key) * 2654435769u) & mask;
    while (slots_[at].number >= 0 && slots_[at].key != key) at = (at + 1) & mask;
    return slots_[at];
  }

  void grow() {
    const std::vector<Slot> old = std::exchange(slots_, std::vector<Slot>(2 * slots_.size()));
    for (const Slot& slot : old) {
      if (slot.number >= 0) find(slot.key) = slot;
    }
  }

  std::vector<Slot> slots_ = std::vector<Slot>(128);
  int size_ = 0;
};

// Memory of one thread's evaluations.
struct Scratch {
  LocalMesh meshes[2];
  SubdivisionMemo memo;
  Numbering vertices, edges, faces;
};

Scratch& scratch() {
  thread_local Scratch mine;
  return mine;
}

}  // namespace

struct LimitEvaluator::Topology {
  ControlCage cage;
  CageTopology incidence;
  std::vector<float> edge_sharpness, vertex_sharpness;
  std::vector<SemiSharpEdges> semi_sharp;  // one a vertex
  std::vector<bool> absent;                // one a face
  SubdivisionRules rules;

  explicit Topology(ControlCage&& source);
  void sharpen_edges();
  void sharpen_vertices();
  bool is_infinitely_sharp_vertex(std::int32_t vertex) const;

  void check(std::int32_t face, std::int32_t sub_quad, double u, double v) const;
  void gather(std::int32_t face, Scratch& memory) const;
  void add_face(std::int32_t face, Scratch& memory) const;
  LimitSample sample(std::int32_t face, std::int32_t sub_quad, double u, double v) const;
};

LimitEvaluator::Topology::Topology(ControlCage&& source) : cage(std::move(source)) {
  validate(cage);
  incidence = make_topology(cage);
  absent = absent_faces(cage, incidence);
  rules.chaikin = cage.creasing_method == CreasingMethod::chaikin;
  rules.smooth_triangles = cage.triangle_subdivision_rule == TriangleSubdivisionRule::smooth;
  sharpen_edges();
  sharpen_vertices();
}

// Creases, and infinite sharpness for boundary and non-manifold edges.
void LimitEvaluator::Topology::sharpen_edges() {
  edge_sharpness.assign(incidence.edges.size(), 0);
  for (const CreaseEdge& crease : crease_edges(cage)) {
    edge_sharpness[incidence.find_edge(crease.v0, crease.v1)] = crease.sharpness;
  }
  semi_sharp.resize(cage.points.size());
  for (std::size_t e = 0; e < incidence.edges.size(); ++e) {
    const bool boundary = incidence.edge_corners[static_cast<std::int32_t>(e)].size() < 2;
    if (boundary || incidence.edge_non_manifold[e]) edge_sharpness[e] = infinite_sharpness;
    semi_sharp[incidence.edges[e].v0].add(edge_sharpness[e]);
    semi_sharp[incidence.edges[e].v1].add(edge_sharpness[e]);
  }
}

void LimitEvaluator::Topology::sharpen_vertices() {
  vertex_sharpness.assign(cage.points.size(), 0);
  for (std::size_t i = 0; i < cage.corner_indices.size(); ++i) {
    vertex_sharpness[cage.corner_indices[i]] = cage.corner_sharpnesses[i];
  }
  for (std::size_t v = 0; v < cage.points.size(); ++v) {
    if (is_infinitely_sharp_vertex(static_cast<std::int32_t>(v))) {
      vertex_sharpness[v] = infinite_sharpness;
    }
  }
}

// The corner of a boundary, if that is asked for, and non-manifold vertices, except where a
// non-manifold crease of two edges passes through the inside of the surface.
bool LimitEvaluator::Topology::is_infinitely_sharp_vertex(std::int32_t vertex) const {
  const std::size_t faces = incidence.vertex_corners[vertex].size();
  const auto edges = incidence.vertex_edges[vertex];
  if (faces == 1 && cage.interpolate_boundary == InterpolateBoundary::edge_and_corner) return true;
  if (!incidence.vertex_non_manifold[vertex]) return false;
  int boundary_edges = 0, non_manifold_edges = 0;
  for (const std::int32_t edge : edges) {
    boundary_edges += incidence.edge_corners[edge].size() < 2;
    non_manifold_edges += incidence.edge_non_manifold[edge];
  }
  return !(non_manifold_edges == 2 && boundary_edges == 0 && faces > edges.size());
}

void LimitEvaluator::Topology::check(std::int32_t face, std::int32_t sub_quad, double u,
                                     double v) const {
  const auto faces = static_cast<std::int64_t>(cage.face_count());
  if (face < 0 || face >= faces) fail("face", range(faces), face);
  const std::int32_t sides = cage.face_vertex_counts[face];
  const std::int32_t quads = sides == 4 ? 1 : sides;
  if (sub_quad < 0 || sub_quad >= quads) fail("sub_quad", range(quads), sub_quad);
  if (!(u >= 0 && u <= 1)) fail("u", "in [0, 1]", u);
  if (!(v >= 0 && v <= 1)) fail("v", "in [0, 1]", v);
  if (absent[face]) fail("face", "part of the surface (no hole, no open boundary)", face);
}

// Copies the face and all faces that share a vertex with it.
void LimitEvaluator::Topology::gather(std::int32_t face, Scratch& memory) const {
  LocalMesh& mesh = memory.meshes[0];
  const std::int32_t first = incidence.face_offsets[face];
  mesh.clear(cage.face_vertex_counts[face]);
  memory.vertices.clear();
  memory.edges.clear();
  memory.faces.clear();
  mesh.origin = cage.points[cage.face_vertex_indices[first]];
  for (int i = 0; i < mesh.inner; ++i) {
    const std::int32_t vertex = cage.face_vertex_indices[first + i];
    memory.vertices.number(vertex);
    mesh.add_point(cage.points[vertex] - mesh.origin, semi_sharp[vertex]);
    mesh.inner_sharpness[i] = vertex_sharpness[vertex];
  }
  add_face(face, memory);
  for (int i = 0; i < mesh.inner; ++i) {
    for (const std::int32_t corner :
         incidence.vertex_corners[cage.face_vertex_indices[first + i]]) {
      add_face(incidence.corner_faces[corner], memory);
    }
  }
}

void LimitEvaluator::Topology::add_face(std::int32_t face, Scratch& memory) const {
  LocalMesh& mesh = memory.meshes[0];
  if (memory.faces.number(face) < mesh.face_count()) return;
  const std::int32_t first = incidence.face_offsets[face], end = incidence.face_offsets[face + 1];
  for (std::int32_t corner = first; corner < end; ++corner) {
    const std::int32_t vertex = cage.face_vertex_indices[corner];
    if (memory.vertices.number(vertex) == static_cast<int>(mesh.points.size())) {
      mesh.add_point(cage.points[vertex] - mesh.origin, semi_sharp[vertex]);
    }
  }
  for (std::int32_t corner = first; corner < end; ++corner) {
    const std::int32_t next = corner + 1 == end ? first : corner + 1;
    const int v0 = memory.vertices.number(cage.face_vertex_indices[corner]);
    const int v1 = memory.vertices.number(cage.face_vertex_indices[next]);
    int edge = -1;
    if (v0 < mesh.inner || v1 < mesh.inner) {
      const std::int32_t cage_edge = incidence.corner_edges[corner];
      edge = memory.edges.number(cage_edge);
      if (edge == static_cast<int>(mesh.edges.size())) {
        mesh.add_edge(v0, v1, edge_sharpness[cage_edge]);
      }
    }
    mesh.add_corner(v0, edge);
  }
  mesh.end_face();
}

// Subdivides towards (u,v) until the limit is known in closed form.
LimitSample LimitEvaluator::Topology::sample(std::int32_t face, std::int32_t sub_quad, double u,
                                             double v) const {
  Scratch& memory = scratch();
  LocalMesh *mesh = &memory.meshes[0], *other = &memory.meshes[1];
  gather(face, memory);
  if (mesh->inner != 4) {
    subdivide(*mesh, sub_quad, rules, memory.memo, *other);
    std::swap(mesh, other);
  }
  LocalSample local;
  int depth = 0;
  for (;; ++depth) {
    if (is_regular(*mesh)) {
      local = sample_regular(*mesh, u, v);
      break;
    }
    if (depth == max_depth) {
      u = std::round(u);
      v = std::round(v);
    }
    const int right = u >= 0.5, upper = v >= 0.5;
    const int corner = upper ? (right ? 2 : 3) : (right ? 1 : 0);
    const bool at_corner = u == right && v == upper;
    if (at_corner && has_limit_masks(*mesh, corner)) {
      local = sample_corner(*mesh, corner);
      break;
    }
    if (depth == max_depth) {
      local = sample_tiny_corner(*mesh, corner);
      break;
    }
    subdivide(*mesh, corner, rules, memory.memo, *other);
    std::swap(mesh, other);
    u = 2 * u - right;
    v = 2 * v - upper;
  }
  const double scale = std::ldexp(1.0, depth);
  return {mesh->origin + local.point, scale * scale * local.normal, scale * local.dp_du,
          scale * local.dp_dv};
}

LimitEvaluator::LimitEvaluator(ControlCage cage)
    : topology_(std::make_unique<Topology>(std::move(cage))) {}
LimitEvaluator::~LimitEvaluator() = default;
LimitEvaluator::LimitEvaluator(LimitEvaluator&&) noexcept = default;
LimitEvaluator& LimitEvaluator::operator=(LimitEvaluator&&) noexcept = default;

LimitSample LimitEvaluator::evaluate(std::int32_t face, std::int32_t sub_quad, double u,
                                     double v) const {
  topology_->check(face, sub_quad, u, v);
  LimitSample sample = topology_->sample(face, sub_quad, u, v);
  // Where the derivatives are parallel or 0 the normal is that of a point close by.
  const auto has_normal = [&] {
    const double scale = std::max(dot(sample.dp_du, sample.dp_du), dot(sample.dp_dv, sample.dp_dv));
    return length(sample.normal) > 1e-12 * scale;
  };
  for (double step = 0x1p-20; step < 0.5 && !has_normal(); step *= 16) {
    sample.normal =
        topology_->sample(face, sub_quad, u + step * (0.5 - u), v + step * (0.5 - v)).normal;
  }
  const double side = topology_->cage.orientation == Orientation::left_handed ? -1 : 1;
  const double size = length(sample.normal);
  if (size > 0) sample.normal = (side / size) * sample.normal;
  return sample;
}

}  // namespace limitray

#include "limitray/cage/local_mesh.h"

#include <algorithm>

namespace limitray {

namespace {

constexpr int none = -1;
// Weight of a triangle's middle in an edge point (Stam and Loop's smooth triangles).
constexpr double smooth_triangle_weight = 0.470;

class Step {
 public:
  Step(const LocalMesh& in, int corner, const SubdivisionRules& rules, SubdivisionMemo& memo,
       LocalMesh& out)
      : in_(in),
        corner_(corner),
        turn_(in.inner == 4 ? corner : 0),
        rules_(rules),
        memo_(memo),
        out_(out) {
    memo_.vertices.assign(in.inner, none);
    memo_.edges.assign(in.edges.size(), none);
    memo_.faces.assign(in.face_count(), none);
    memo_.half_edges.assign(2 * in.edges.size(), none);
    memo_.spokes.assign(in.corner_vertices.size(), none);
  }

  void run() {
    out_.clear(4);
    find_face_middles();
    add_inner_points();
    add_children();
    recenter();
  }

 private:
  // Corner 0 to 3 of the quarter, seen from its own corner: vertex, edge, face, edge.
  void add_inner_points() {
    const int next_edge = in_.corner_edges[corner_];
    const int previous_edge = in_.corner_edges[in_.previous_corner(corner_)];
    for (int i = 0; i < 4; ++i) {
      const int role = (i - turn_) & 3;
      if (role == 0) {
        vertex_point(corner_);
        out_.inner_sharpness[i] = decayed(in_.inner_sharpness[corner_]);
      } else if (role == 2) {
        face_point(0);
      } else {
        edge_point(role == 1 ? next_edge : previous_edge);
      }
    }
  }

  // The quarter first; then those around its corner vertex, its two edge points and its middle.
  void add_children() {
    const int before = in_.previous_corner(corner_), after = in_.next_corner(corner_);
    add_child(corner_, turn_);
    for (const int corner : in_.inner_corners[corner_]) {
      if (corner != corner_) add_child(corner, 0);
    }
    add_children_along(after, in_.corner_edges[corner_]);
    add_children_along(before, in_.corner_edges[before]);
    for (int corner = 0; corner < in_.inner; ++corner) {
      if (corner != corner_) add_child(corner, 0);
    }
  }

  // Quarters at `vertex` of the other faces at `edge`.
  void add_children_along(int vertex, int edge) {
    for (const int corner : in_.inner_corners[vertex]) {
      const bool at_edge =
          in_.corner_edges[corner] == edge || in_.corner_edges[in_.previous_corner(corner)] == edge;
      if (at_edge && in_.corner_faces[corner] != 0) add_child(corner, 0);
    }
  }

  // The quarter of a face at one of its corners, its own corners turned by `turn`.
  void add_child(int corner, int turn) {
    const int before = in_.previous_corner(corner);
    const int vertex = in_.corner_vertices[corner];
    const int edge = in_.corner_edges[corner], edge_before = in_.corner_edges[before];
    const int vertices[4] = {vertex_point(vertex), edge_point(edge),
                             face_point(in_.corner_faces[corner]), edge_point(edge_before)};
    const int edges[4] = {half_edge(edge, vertex), spoke(corner), spoke(before),
                          half_edge(edge_before, vertex)};
    for (int i = 0; i < 4; ++i) {
      const int role = (i - turn) & 3;
      out_.add_corner(vertices[role], edges[role]);
    }
    out_.end_face();
  }

  bool is_inner(int child_vertex) const { return child_vertex < out_.inner; }

  // The half of `edge` at `vertex`, where it touches an inner vertex.
  int half_edge(int edge, int vertex) {
    int& child = memo_.half_edges[2 * edge + (in_.edges[edge].vertices[0] == vertex ? 0 : 1)];
    const int v0 = vertex_point(vertex), v1 = edge_point(edge);
    if (child == none && (is_inner(v0) || is_inner(v1))) {
      child = out_.add_edge(v0, v1, child_sharpness(edge, vertex));
    }
    return child;
  }

  // The edge from the middle of the edge that `corner` owns to the middle of its face.
  int spoke(int corner) {
    if (in_.corner_edges[corner] == none) return none;
    int& child = memo_.spokes[corner];
    const int v0 = edge_point(in_.corner_edges[corner]), v1 = face_point(in_.corner_faces[corner]);
    if (child == none && (is_inner(v0) || is_inner(v1))) child = out_.add_edge(v0, v1, 0);
    return child;
  }

  float child_sharpness(int edge, int vertex) const {
    const float sharpness = in_.edges[edge].sharpness;
    return rules_.chaikin ? decayed_chaikin(sharpness, in_.semi_sharp[vertex]) : decayed(sharpness);
  }

  void find_face_middles() {
    memo_.face_middles.clear();
    for (int face = 0; face < in_.face_count(); ++face) {
      Vec3d sum{};
      for (int c = in_.face_offsets[face]; c < in_.face_offsets[face + 1]; ++c) {
        sum = sum + in_.points[in_.corner_vertices[c]];
      }
      memo_.face_middles.push_back((1.0 / in_.face_size(face)) * sum);
    }
  }

  int face_point(int face) {
    int& child = memo_.faces[face];
    if (child == none) child = out_.add_point(memo_.face_middles[face], {});
    return child;
  }

  int edge_point(int edge) {
    if (memo_.edges[edge] == none) {
      SemiSharpEdges semi_sharp;
      for (const int end : in_.edges[edge].vertices) semi_sharp.add(child_sharpness(edge, end));
      const Vec3d position = edge_position(edge);
      memo_.edges[edge] = out_.add_point(position, semi_sharp);
    }
    return memo_.edges[edge];
  }

  // A crease point is the middle of the edge. Where the crease ends at this level the point lies
  // between that and the smooth one; as in OpenSubdiv the sharpness is the weight even where
  // Chaikin's rule ends a crease that is sharper than 1.
  Vec3d edge_position(int index) const {
    const LocalMesh::Edge& edge = in_.edges[index];
    const Vec3d middle = 0.5 * (in_.points[edge.vertices[0]] + in_.points[edge.vertices[1]]);
    if (!is_sharp(edge.sharpness)) return smooth_edge_position(edge, middle);
    if (is_sharp(child_sharpness(index, edge.vertices[0])) &&
        is_sharp(child_sharpness(index, edge.vertices[1]))) {
      return middle;
    }
    const double weight = edge.sharpness;
    return weight * middle + (1 - weight) * smooth_edge_position(edge, middle);
  }

  Vec3d smooth_edge_position(const LocalMesh::Edge& edge, Vec3d middle) const {
    double face_weight = 0;
    Vec3d faces{};
    for (const int face : edge.faces) {
      const bool smooth_triangle = rules_.smooth_triangles && in_.face_size(face) == 3;
      face_weight += 0.5 * (smooth_triangle ? smooth_triangle_weight : 0.25);
      faces = faces + memo_.face_middles[face];
    }
    return (1 - 2 * face_weight) * middle + face_weight * faces;
  }

  int vertex_point(int vertex) {
    if (memo_.vertices[vertex] == none) {
      SemiSharpEdges semi_sharp;
      for (const int edge : in_.inner_edges[vertex]) semi_sharp.add(child_sharpness(edge, vertex));
      const Vec3d position = vertex_position(vertex);
      memo_.vertices[vertex] = out_.add_point(position, semi_sharp);
    }
    return memo_.vertices[vertex];
  }

  // Where the rule changes at this level, the point lies between those of both rules.
  Vec3d vertex_position(int vertex) const {
    const auto own = [&](int edge) { return in_.edges[edge].sharpness; };
    const auto child = [&](int edge) { return child_sharpness(edge, vertex); };
    const VertexRule rule = in_.rule(vertex);
    const Vec3d position = position_by_rule(vertex, rule, own);
    if (rule == VertexRule::smooth || rule == VertexRule::dart) return position;

    int sharp_edges = 0;
    for (const int edge : in_.inner_edges[vertex]) sharp_edges += is_sharp(child(edge));
    const VertexRule child_rule = vertex_rule(decayed(in_.inner_sharpness[vertex]), sharp_edges);
    if (child_rule == rule) return position;
    const double weight = fading_weight(vertex);
    return weight * position + (1 - weight) * position_by_rule(vertex, child_rule, child);
  }

  // Mean sharpness of what is sharp at this level and no longer at the next, at most 1.
  double fading_weight(int vertex) const {
    float sum = 0;
    int count = 0;
    const float sharpness = in_.inner_sharpness[vertex];
    if (is_sharp(sharpness) && !is_sharp(decayed(sharpness))) {
      sum += sharpness;
      ++count;
    }
    for (const int edge : in_.inner_edges[vertex]) {
      const float edge_sharpness = in_.edges[edge].sharpness;
      if (!is_sharp(edge_sharpness) || is_sharp(child_sharpness(edge, vertex))) continue;
      sum += edge_sharpness;
      ++count;
    }
    return count == 0 ? 0 : std::min(1.0, static_cast<double>(sum / static_cast<float>(count)));
  }

  template <class Sharpness>
  Vec3d position_by_rule(int vertex, VertexRule rule, const Sharpness& sharpness) const {
    const Vec3d own = in_.points[vertex];
    if (rule == VertexRule::corner) return own;
    Vec3d sum{};
    if (rule == VertexRule::crease) {
      for (const int edge : in_.inner_edges[vertex]) {
        if (is_sharp(sharpness(edge))) sum = sum + in_.points[in_.other_end(edge, vertex)];
      }
      return 0.75 * own + 0.125 * sum;
    }
    const double n = static_cast<double>(in_.inner_corners[vertex].size());
    for (const int edge : in_.inner_edges[vertex]) {
      sum = sum + in_.points[in_.other_end(edge, vertex)];
    }
    for (const int corner : in_.inner_corners[vertex]) {
      sum = sum + memo_.face_middles[in_.corner_faces[corner]];
    }
    return ((n - 2) / n) * own + (1 / (n * n)) * sum;
  }

  void recenter() {
    const Vec3d shift = out_.points[turn_];
    for (Vec3d& point : out_.points) point = point - shift;
    out_.origin = in_.origin + shift;
  }

  const LocalMesh& in_;
  const int corner_;  // corner, and vertex, of face 0
  const int turn_;
  const SubdivisionRules& rules_;
  SubdivisionMemo& memo_;
  LocalMesh& out_;
};

}  // namespace

void LocalMesh::clear(int new_inner) {
  origin = {};
  points.clear();
  semi_sharp.clear();
  face_offsets.assign(1, 0);
  corner_vertices.clear();
  corner_edges.clear();
  corner_faces.clear();
  edges.clear();
  inner = new_inner;
  inner_sharpness.assign(inner, 0);
  if (inner_corners.size() < static_cast<std::size_t>(inner)) {
    inner_corners.resize(inner);
    inner_edges.resize(inner);
  }
  for (int vertex = 0; vertex < inner; ++vertex) {
    inner_corners[vertex].clear();
    inner_edges[vertex].clear();
  }
}

int LocalMesh::add_point(Vec3d point, SemiSharpEdges edges_there) {
  points.push_back(point);
  semi_sharp.push_back(edges_there);
  return static_cast<int>(points.size()) - 1;
}

int LocalMesh::add_edge(int v0, int v1, float sharpness) {
  const int edge = static_cast<int>(edges.size());
  edges.push_back({{v0, v1}, sharpness, {none, none}});
  if (v0 < inner) inner_edges[v0].push_back(edge);
  if (v1 < inner) inner_edges[v1].push_back(edge);
  return edge;
}

void LocalMesh::add_corner(int vertex, int edge) {
  const int face = face_count();
  if (vertex < inner) inner_corners[vertex].push_back(static_cast<int>(corner_vertices.size()));
  if (edge != none) {
    Edge& at = edges[edge];
    if (at.faces[0] == none) {
      at.faces[0] = face;
    } else if (at.faces[1] == none) {
      at.faces[1] = face;
    }
  }
  corner_vertices.push_back(vertex);
  corner_edges.push_back(edge);
  corner_faces.push_back(face);
}

void LocalMesh::end_face() { face_offsets.push_back(static_cast<int>(corner_vertices.size())); }

VertexRule LocalMesh::rule(int inner_vertex) const {
  int sharp_edges = 0;
  for (const int edge : inner_edges[inner_vertex]) sharp_edges += is_sharp(edges[edge].sharpness);
  return vertex_rule(inner_sharpness[inner_vertex], sharp_edges);
}

void subdivide(const LocalMesh& in, int corner, const SubdivisionRules& rules,
               SubdivisionMemo& memo, LocalMesh& out) {
  Step(in, corner, rules, memo, out).run();
}

}  // namespace limitray

#include "limitray/cage/local_limit.h"

#include <array>
#include <cmath>
#include <numbers>
#include <span>

namespace limitray {

namespace {

constexpr double pi = std::numbers::pi;

// The face beside `edge` that is not `face`.
int other_face(const LocalMesh& mesh, int edge, int face) {
  const auto& faces = mesh.edges[edge].faces;
  return faces[0] == face ? faces[1] : faces[0];
}

bool is_sharp_edge(const LocalMesh& mesh, int edge) { return is_sharp(mesh.edges[edge].sharpness); }

// The corner of `face` that owns `edge`.
int owner_corner(const LocalMesh& mesh, int face, int edge) {
  int corner = mesh.face_offsets[face];
  while (mesh.corner_edges[corner] != edge) ++corner;
  return corner;
}

// Corners at a vertex one after the other counter-clockwise, between two sharp edges (or all of
// them around), with the place of face 0 among them.
struct Sector {
  std::vector<int> corners;
  std::size_t place = 0;
};

Sector find_sector(const LocalMesh& mesh, int vertex) {
  Sector sector;
  // Clockwise from face 0 to the leading edge.
  int corner = vertex;
  while (!is_sharp_edge(mesh, mesh.corner_edges[corner])) {
    const int edge = mesh.corner_edges[corner];
    const int face = other_face(mesh, edge, mesh.corner_faces[corner]);
    corner = mesh.next_corner(owner_corner(mesh, face, edge));
    if (corner == vertex) break;
  }
  // Counter-clockwise from there.
  const int first = corner;
  while (true) {
    if (corner == vertex) sector.place = sector.corners.size();
    sector.corners.push_back(corner);
    const int edge = mesh.corner_edges[mesh.previous_corner(corner)];
    if (is_sharp_edge(mesh, edge)) break;
    const int face = other_face(mesh, edge, mesh.corner_faces[corner]);
    corner = owner_corner(mesh, face, edge);
    if (corner == first) break;
  }
  return sector;
}

// No semi-sharp feature and only quads at a corner of face 0.
bool is_settled(const LocalMesh& mesh, int vertex) {
  if (is_semi_sharp(mesh.inner_sharpness[vertex])) return false;
  for (const int edge : mesh.inner_edges[vertex]) {
    if (is_semi_sharp(mesh.edges[edge].sharpness)) return false;
  }
  for (const int corner : mesh.inner_corners[vertex]) {
    if (mesh.face_size(mesh.corner_faces[corner]) != 4) return false;
  }
  return true;
}

bool is_regular_corner(const LocalMesh& mesh, int vertex) {
  if (!is_settled(mesh, vertex)) return false;
  const bool sharp_after = is_sharp_edge(mesh, mesh.corner_edges[vertex]);
  const bool sharp_before = is_sharp_edge(mesh, mesh.corner_edges[mesh.previous_corner(vertex)]);
  switch (mesh.rule(vertex)) {
    case VertexRule::smooth:
      return mesh.inner_corners[vertex].size() == 4;
    case VertexRule::dart:
      return false;
    case VertexRule::crease:
      return sharp_after != sharp_before && find_sector(mesh, vertex).corners.size() == 2;
    case VertexRule::corner:
      return sharp_after && sharp_before;
  }
  return false;
}

// Control points of the patch, [v][u]; face 0 in the middle.
using Grid = std::array<std::array<Vec3d, 4>, 4>;

struct Place {
  int row, column;
};
constexpr Place inner_places[4] = {{1, 1}, {1, 2}, {2, 2}, {2, 1}};
constexpr Place diagonal_places[4] = {{0, 0}, {0, 3}, {3, 3}, {3, 0}};
// Beyond edge i of face 0: beside its first and its second corner.
constexpr Place beyond_places[4][2] = {
    {{0, 1}, {0, 2}}, {{1, 3}, {2, 3}}, {{3, 2}, {3, 1}}, {{2, 0}, {1, 0}}};

void put(Grid& grid, Place place, Vec3d point) { grid[place.row][place.column] = point; }

// The far point of the face opposite to face 0 at a smooth corner.
void put_diagonal(const LocalMesh& mesh, int vertex, Grid& grid) {
  const int edge = mesh.corner_edges[vertex];
  const int beside = other_face(mesh, edge, 0);
  const int corner = mesh.next_corner(owner_corner(mesh, beside, edge));
  const int edge_on = mesh.corner_edges[corner];
  const int opposite = other_face(mesh, edge_on, beside);
  const int opposite_corner = mesh.next_corner(owner_corner(mesh, opposite, edge_on));
  const int far = mesh.next_corner(mesh.next_corner(opposite_corner));
  put(grid, diagonal_places[vertex], mesh.points[mesh.corner_vertices[far]]);
}

Grid gather_patch(const LocalMesh& mesh) {
  Grid grid{};
  for (int i = 0; i < 4; ++i) {
    put(grid, inner_places[i], mesh.points[i]);
    const int edge = mesh.corner_edges[i];
    if (is_sharp_edge(mesh, edge)) continue;
    const int corner = owner_corner(mesh, other_face(mesh, edge, 0), edge);
    const int beyond_first = mesh.next_corner(mesh.next_corner(corner));
    const int beyond_second = mesh.next_corner(beyond_first);
    put(grid, beyond_places[i][0], mesh.points[mesh.corner_vertices[beyond_first]]);
    put(grid, beyond_places[i][1], mesh.points[mesh.corner_vertices[beyond_second]]);
  }
  for (int i = 0; i < 4; ++i) {
    if (mesh.rule(i) == VertexRule::smooth) put_diagonal(mesh, i, grid);
  }
  // Mirror beyond sharp edges: first the columns, then whole rows with their ends.
  for (auto& row : grid) {
    if (is_sharp_edge(mesh, mesh.corner_edges[3])) row[0] = 2.0 * row[1] - row[2];
    if (is_sharp_edge(mesh, mesh.corner_edges[1])) row[3] = 2.0 * row[2] - row[1];
  }
  for (int column = 0; column < 4; ++column) {
    const auto at = [&](int row) -> Vec3d& { return grid[row][column]; };
    if (is_sharp_edge(mesh, mesh.corner_edges[0])) at(0) = 2.0 * at(1) - at(2);
    if (is_sharp_edge(mesh, mesh.corner_edges[2])) at(3) = 2.0 * at(2) - at(1);
  }
  return grid;
}

using Weights = std::array<double, 4>;

Weights spline_weights(double t) {
  const double s = 1 - t;
  return {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * s * s * s - 6 * s * s + 4) / 6,
          t * t * t / 6};
}

Weights spline_derivatives(double t) {
  const double s = 1 - t;
  return {-s * s / 2, (3 * t * t - 4 * t) / 2, (4 * s - 3 * s * s) / 2, t * t / 2};
}

Vec3d weighted(const Grid& grid, const Weights& u, const Weights& v) {
  Vec3d sum{};
  for (int row = 0; row < 4; ++row) {
    Vec3d along{};
    for (int column = 0; column < 4; ++column) along = along + u[column] * grid[row][column];
    sum = sum + v[row] * along;
  }
  return sum;
}

// Turns tangents along the edges to the next and previous corner into derivatives.
LocalSample oriented(Vec3d point, Vec3d to_next, Vec3d to_previous, Vec3d normal, int corner) {
  switch (corner) {
    case 0:
      return {point, normal, to_next, to_previous};
    case 1:
      return {point, normal, -1.0 * to_previous, to_next};
    case 2:
      return {point, normal, -1.0 * to_next, -1.0 * to_previous};
    default:
      return {point, normal, to_previous, -1.0 * to_next};
  }
}

// End of the spoke that leads into a corner's face, and that face's far point.
Vec3d spoke_point(const LocalMesh& mesh, int corner) {
  return mesh.points[mesh.corner_vertices[mesh.next_corner(corner)]];
}
Vec3d far_point(const LocalMesh& mesh, int corner) {
  return mesh.points[mesh.corner_vertices[mesh.next_corner(mesh.next_corner(corner))]];
}
Vec3d last_spoke_point(const LocalMesh& mesh, int corner) {
  return mesh.points[mesh.corner_vertices[mesh.previous_corner(corner)]];
}

// Eigenvalue of subdivision for a wave that advances by `step` from spoke to spoke.
double eigenvalue(double step) {
  const double c = std::cos(step);
  return (5 + c + std::cos(step / 2) * std::sqrt(2 * (9 + c))) / 16;
}

// Tangent along spoke `spoke` of a smooth vertex: the second eigenvector of subdivision, turned.
Vec3d smooth_tangent(const LocalMesh& mesh, std::span<const int> corners, std::size_t spoke) {
  const double n = static_cast<double>(corners.size()), step = 2 * pi / n;
  const double far_weight = 1 / (4 * eigenvalue(step) - 1);
  Vec3d sum{};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const double place = static_cast<double>(i) - static_cast<double>(spoke);
    const double here = std::cos(place * step), next = std::cos((place + 1) * step);
    sum = sum + (4 * here) * spoke_point(mesh, corners[i]) +
          (far_weight * (here + next)) * far_point(mesh, corners[i]);
  }
  return (1 / (3 * n)) * sum;
}

LocalSample sample_smooth(const LocalMesh& mesh, const Sector& sector, int corner) {
  const double n = static_cast<double>(sector.corners.size());
  Vec3d spokes{}, far{};
  for (const int c : sector.corners) {
    spokes = spokes + spoke_point(mesh, c);
    far = far + far_point(mesh, c);
  }
  const double weight = 1 / (n * (n + 5));
  const Vec3d point = (n / (n + 5)) * mesh.points[corner] + (4 * weight) * spokes + weight * far;
  const Vec3d to_next = smooth_tangent(mesh, sector.corners, sector.place);
  const Vec3d to_previous = smooth_tangent(mesh, sector.corners, sector.place + 1);
  return oriented(point, to_next, to_previous, cross(to_next, to_previous), corner);
}

// The part of a sector beside a crease that subdivision keeps as `waves` half sine waves across
// it: the left eigenvector with 4 sin(waves i pi / k) at spoke i of k + 1. The weights of the
// vertex and of the crease's ends follow from the columns of the subdivision matrix.
Vec3d sector_wave(const LocalMesh& mesh, const Sector& sector, int corner, int waves) {
  const double k = static_cast<double>(sector.corners.size()), step = waves * pi / k;
  const double value = eigenvalue(step), far_weight = 1 / (4 * value - 1);
  Vec3d sum{};
  double all_spokes = 0, all_far = 0, ends[2] = {0, 0};
  for (std::size_t i = 0; i < sector.corners.size(); ++i) {
    const bool first = i == 0, last = i + 1 == sector.corners.size();
    const double here = first ? 0 : 4 * std::sin(static_cast<double>(i) * step);
    const double next = last ? 0 : 4 * std::sin(static_cast<double>(i + 1) * step);
    const double far = far_weight * (here + next) / 4;
    if (!first) sum = sum + here * spoke_point(mesh, sector.corners[i]);
    sum = sum + far * far_point(mesh, sector.corners[i]);
    all_spokes += here;
    all_far += far;
    if (first) ends[0] = next / 16 + far / 4;
    if (last) ends[1] = here / 16 + far / 4;
  }
  const Vec3d first_end = spoke_point(mesh, sector.corners.front());
  const Vec3d last_end = last_spoke_point(mesh, sector.corners.back());
  if (waves == 2) {
    // Odd: the vertex has no weight.
    sum = sum + (1 / (value - 0.5)) * (ends[0] * first_end + ends[1] * last_end);
  } else {
    const double inflow = 3 * all_spokes / 8 + all_far / 4;
    const double own = (ends[0] + inflow * (value - 0.5)) / ((value - 1) * (value - 0.25));
    const double end = (value - 0.75) * own - inflow;
    sum = sum + own * mesh.points[corner] + end * (first_end + last_end);
  }
  return (1 / (3 * k)) * sum;
}

// Up to 4 faces beside a crease the tangents lead along it and across; from 5 on the crease's own
// eigenvalue 1/2 is smaller than that of two half waves. With one face the bend of the crease
// spans the tangent plane.
LocalSample sample_crease(const LocalMesh& mesh, const Sector& sector, int corner) {
  const Vec3d own = mesh.points[corner];
  const Vec3d first = spoke_point(mesh, sector.corners.front());
  const Vec3d last = last_spoke_point(mesh, sector.corners.back());
  const std::size_t faces = sector.corners.size();
  Vec3d ends{};  // of the crease; those of the sector unless that is a closed fan beside it
  for (const int edge : mesh.inner_edges[corner]) {
    if (is_sharp_edge(mesh, edge)) ends = ends + mesh.points[mesh.other_end(edge, corner)];
  }
  const Vec3d point = (2.0 / 3) * own + (1.0 / 6) * ends;
  const Vec3d along = faces >= 5 ? sector_wave(mesh, sector, corner, 2) : 0.5 * (first - last);
  const Vec3d across = faces == 1 ? first + last - 2.0 * own : sector_wave(mesh, sector, corner, 1);
  const auto spoke = [&](std::size_t i) {
    const double angle = static_cast<double>(i) * pi / static_cast<double>(faces);
    return std::cos(angle) * along + std::sin(angle) * across;
  };
  return oriented(point, spoke(sector.place), spoke(sector.place + 1), cross(along, across),
                  corner);
}

}  // namespace

bool is_regular(const LocalMesh& mesh) {
  if (mesh.inner != 4) return false;
  for (int corner = 0; corner < 4; ++corner) {
    if (!is_regular_corner(mesh, corner)) return false;
  }
  return true;
}

LocalSample sample_regular(const LocalMesh& mesh, double u, double v) {
  const Grid grid = gather_patch(mesh);
  const Weights along_u = spline_weights(u), along_v = spline_weights(v);
  LocalSample sample;
  sample.point = weighted(grid, along_u, along_v);
  sample.dp_du = weighted(grid, spline_derivatives(u), along_v);
  sample.dp_dv = weighted(grid, along_u, spline_derivatives(v));
  sample.normal = cross(sample.dp_du, sample.dp_dv);
  return sample;
}

bool has_limit_masks(const LocalMesh& mesh, int corner) {
  if (!is_settled(mesh, corner)) return false;
  switch (mesh.rule(corner)) {
    case VertexRule::smooth:
      return mesh.inner_corners[corner].size() > 2;
    case VertexRule::dart:
      return false;
    case VertexRule::crease:
      return true;
    case VertexRule::corner:
      return is_sharp_edge(mesh, mesh.corner_edges[corner]) &&
             is_sharp_edge(mesh, mesh.corner_edges[mesh.previous_corner(corner)]);
  }
  return false;
}

LocalSample sample_corner(const LocalMesh& mesh, int corner) {
  switch (mesh.rule(corner)) {
    case VertexRule::smooth:
      return sample_smooth(mesh, find_sector(mesh, corner), corner);
    case VertexRule::crease:
      return sample_crease(mesh, find_sector(mesh, corner), corner);
    default:
      return sample_tiny_corner(mesh, corner);
  }
}

LocalSample sample_tiny_corner(const LocalMesh& mesh, int corner) {
  const Vec3d point = mesh.points[corner];
  const Vec3d to_next = spoke_point(mesh, corner) - point;
  const Vec3d to_previous = last_spoke_point(mesh, corner) - point;
  return oriented(point, to_next, to_previous, cross(to_next, to_previous), corner);
}

}  // namespace limitray

#include "limitray/cage/cage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <sstream>
#include <stdexcept>
#include <tuple>

#include "limitray/cage/topology.h"

namespace limitray {

namespace {

// Most edges or faces at a vertex and most sides of a face (OpenSubdiv counts them in 16 bits).
constexpr std::int32_t valence_limit = 65535;

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream text;
  text.precision(9);
  (text << ... << parts);
  throw std::invalid_argument(text.str());
}

template <class... Parts>
void warn(CageWarnings& warnings, const Parts&... parts) {
  std::ostringstream text;
  text.precision(9);
  (text << ... << parts);
  warnings.messages.push_back(text.str());
}

// "1 edge", "2 edges".
std::string counted(std::size_t n, const char* singular, const char* plural) {
  return std::to_string(n) + " " + (n == 1 ? singular : plural);
}

void check_indices(const char* name, std::span<const std::int32_t> indices, std::size_t end) {
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < 0 || static_cast<std::size_t>(indices[i]) >= end) {
      fail(name, "[", i, "]: must be in [0, ", end, "), got ", indices[i]);
    }
  }
}

void check_size(const char* name, std::size_t got, std::size_t wanted, const char* rule) {
  if (got != wanted) fail(name, ": must hold ", rule, " (", wanted, "), got ", got);
}

void check_sharpnesses(const char* name, std::span<const float> sharpnesses) {
  for (std::size_t i = 0; i < sharpnesses.size(); ++i) {
    if (!(sharpnesses[i] >= 0)) {
      fail(name, "[", i, "]: must be a number >= 0 (inf is allowed), got ", sharpnesses[i]);
    }
  }
}

void check_distinct(const char* name, std::span<const std::int32_t> indices, std::size_t end) {
  std::vector<bool> seen(end);
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (seen[indices[i]]) fail(name, "[", i, "]: must name each index once, got ", indices[i]);
    seen[indices[i]] = true;
  }
}

void check_points(const ControlCage& cage) {
  if (cage.points.size() > std::numeric_limits<std::int32_t>::max()) {
    fail("points: must be fewer than 2^31, got ", cage.points.size());
  }
  for (std::size_t i = 0; i < cage.points.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const double value = cage.points[i][axis];
      if (!std::isfinite(value)) fail("points[", i, "][", axis, "]: must be finite, got ", value);
    }
  }
}

void check_counts(const ControlCage& cage) {
  std::size_t corners = 0;
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const std::int32_t count = cage.face_vertex_counts[face];
    if (count < 3 || count > valence_limit) {
      fail("face_vertex_counts[", face, "]: must be in [3, ", valence_limit, "], got ", count);
    }
    corners += static_cast<std::size_t>(count);
  }
  check_size("face_vertex_indices", cage.face_vertex_indices.size(), corners,
             "the sum of face_vertex_counts");
  if (corners > std::numeric_limits<std::int32_t>::max()) {
    fail("face_vertex_indices: must be fewer than 2^31, got ", corners);
  }
}

// Vertices must differ within a face, and none may have more faces than OpenSubdiv can count.
void check_faces(const ControlCage& cage) {
  check_indices("face_vertex_indices", cage.face_vertex_indices, cage.points.size());
  std::vector<std::int32_t> last_face(cage.points.size(), -1), valence(cage.points.size(), 0);
  std::size_t corner = 0;
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    for (std::int32_t i = 0; i < cage.face_vertex_counts[face]; ++i, ++corner) {
      const std::int32_t vertex = cage.face_vertex_indices[corner];
      if (last_face[vertex] == static_cast<std::int32_t>(face)) {
        fail("face_vertex_indices[", corner, "]: must not repeat a vertex of face ", face, ", got ",
             vertex);
      }
      last_face[vertex] = static_cast<std::int32_t>(face);
      if (++valence[vertex] >= valence_limit) {
        fail("face_vertex_indices[", corner, "]: must use a vertex in fewer than ", valence_limit,
             " faces, got ", vertex, " once more");
      }
    }
  }
}

void check_creases(const ControlCage& cage) {
  std::size_t vertices = 0;
  for (std::size_t i = 0; i < cage.crease_lengths.size(); ++i) {
    const std::int32_t length = cage.crease_lengths[i];
    if (length < 2) fail("crease_lengths[", i, "]: must be at least 2, got ", length);
    vertices += static_cast<std::size_t>(length);
  }
  check_size("crease_indices", cage.crease_indices.size(), vertices, "the sum of crease_lengths");
  const std::size_t chains = cage.crease_lengths.size(), edges = vertices - chains;
  if (cage.crease_sharpnesses.size() != chains && cage.crease_sharpnesses.size() != edges) {
    fail("crease_sharpnesses: must hold one value a chain (", chains, ") or one an edge (", edges,
         "), got ", cage.crease_sharpnesses.size());
  }
  check_indices("crease_indices", cage.crease_indices, cage.points.size());
  check_sharpnesses("crease_sharpnesses", cage.crease_sharpnesses);
}

void check_corners_and_holes(const ControlCage& cage) {
  check_size("corner_sharpnesses", cage.corner_sharpnesses.size(), cage.corner_indices.size(),
             "one value a corner index");
  check_indices("corner_indices", cage.corner_indices, cage.points.size());
  check_distinct("corner_indices", cage.corner_indices, cage.points.size());
  check_sharpnesses("corner_sharpnesses", cage.corner_sharpnesses);
  check_indices("hole_indices", cage.hole_indices, cage.face_count());
  check_distinct("hole_indices", cage.hole_indices, cage.face_count());
}

/// How many indices a primvar must have, and in words.
std::pair<std::size_t, const char*> primvar_size(const ControlCage& cage, Interpolation how) {
  switch (how) {
    case Interpolation::constant:
      return {1, "one index"};
    case Interpolation::uniform:
      return {cage.face_count(), "one index a face"};
    case Interpolation::varying:
    case Interpolation::vertex:
      return {cage.points.size(), "one index a point"};
    case Interpolation::face_varying:
      break;
  }
  return {cage.face_vertex_indices.size(), "one index a face corner"};
}

void check_primvar(const ControlCage& cage, const Primvar& primvar) {
  const std::string name = "primvars[\"" + primvar.name + "\"]";
  if (primvar.width < 1) fail(name, ".width: must be at least 1, got ", primvar.width);
  const std::size_t width = static_cast<std::size_t>(primvar.width);
  if (primvar.values.size() % width != 0) {
    fail(name, ".values: must hold whole rows of ", width, ", got ", primvar.values.size(),
         " values");
  }
  for (std::size_t i = 0; i < primvar.values.size(); ++i) {
    if (!std::isfinite(primvar.values[i])) {
      fail(name, ".values[", i / width, "][", i % width, "]: must be finite, got ",
           primvar.values[i]);
    }
  }
  const std::string indices = name + ".indices";
  const auto [size, rule] = primvar_size(cage, primvar.interpolation);
  check_size(indices.c_str(), primvar.indices.size(), size, rule);
  check_indices(indices.c_str(), primvar.indices, primvar.values.size() / width);
}

// The edge of each link of the crease chains must exist; a link named twice must agree.
void check_crease_edges(const ControlCage& cage, const CageTopology& topology,
                        CageWarnings& warnings) {
  constexpr float unset = -1;
  std::vector<float> sharpness(topology.edges.size(), unset);
  std::size_t repeated = 0, index = 0, link = 0;
  const std::vector<CreaseEdge> links = crease_edges(cage);
  for (const std::int32_t length : cage.crease_lengths) {
    for (std::int32_t i = 0; i + 1 < length; ++i, ++index, ++link) {
      const CreaseEdge& crease = links[link];
      const std::int32_t edge = topology.find_edge(crease.v0, crease.v1);
      if (edge < 0) {
        fail("crease_indices[", index, "]: must go on along an edge of the mesh, got (", crease.v0,
             ", ", crease.v1, ")");
      }
      if (sharpness[edge] != unset && sharpness[edge] != crease.sharpness) {
        fail("crease_indices[", index,
             "]: must not crease an edge twice with other sharpness, got (", crease.v0, ", ",
             crease.v1, ") with ", sharpness[edge], " and ", crease.sharpness);
      }
      repeated += sharpness[edge] != unset;
      sharpness[edge] = crease.sharpness;
    }
    ++index;
  }
  if (repeated > 0) {
    warn(warnings, counted(repeated, "crease edge is", "crease edges are"),
         " repeated, with the same sharpness");
  }
}

void check_valences(const CageTopology& topology) {
  for (std::size_t v = 0; v < topology.vertex_edges.size(); ++v) {
    const std::size_t edges = topology.vertex_edges[static_cast<std::int32_t>(v)].size();
    if (edges > valence_limit) {
      fail("face_vertex_indices: must give vertex ", v, " at most ", valence_limit, " edges, got ",
           edges);
    }
  }
}

void warn_about_topology(const CageTopology& topology, CageWarnings& warnings) {
  std::size_t isolated = 0;
  for (std::size_t v = 0; v < topology.vertex_corners.size(); ++v) {
    isolated += topology.vertex_corners[static_cast<std::int32_t>(v)].empty();
  }
  const auto edges =
      std::count(topology.edge_non_manifold.begin(), topology.edge_non_manifold.end(), true);
  const auto vertices =
      std::count(topology.vertex_non_manifold.begin(), topology.vertex_non_manifold.end(), true);
  if (isolated > 0) {
    warn(warnings, counted(isolated, "vertex belongs", "vertices belong"), " to no face");
  }
  if (edges > 0) {
    warn(warnings, counted(edges, "edge is", "edges are"),
         " non-manifold (more than two faces, or faces of opposite winding): infinitely sharp");
  }
  if (vertices > 0) {
    warn(warnings, counted(vertices, "vertex is", "vertices are"),
         " non-manifold: an infinitely sharp corner or crease");
  }
}

// Twice the area vector of a face (Newell's sum), about its first vertex.
Vec3d area_vector(const ControlCage& cage, std::int32_t first, std::int32_t end) {
  Vec3d sum{};
  const Vec3d origin = cage.points[cage.face_vertex_indices[first]];
  for (std::int32_t c = first + 1; c + 1 < end; ++c) {
    sum = sum + cross(cage.points[cage.face_vertex_indices[c]] - origin,
                      cage.points[cage.face_vertex_indices[c + 1]] - origin);
  }
  return sum;
}

void warn_about_faces(const ControlCage& cage, const CageTopology& topology,
                      CageWarnings& warnings) {
  std::size_t degenerate = 0;
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    const Vec3d area =
        area_vector(cage, topology.face_offsets[face], topology.face_offsets[face + 1]);
    degenerate += length(area) == 0;
  }
  if (degenerate > 0) {
    warn(warnings, counted(degenerate, "face has", "faces have"), " no area");
  }
  const std::vector<bool> absent = absent_faces(cage, topology);
  const std::size_t dropped =
      static_cast<std::size_t>(std::count(absent.begin(), absent.end(), true));
  if (dropped > cage.hole_indices.size()) {
    warn(warnings, counted(dropped - cage.hole_indices.size(), "face", "faces"),
         " at an open boundary dropped (interpolate_boundary none)");
  }
  if (dropped == cage.face_count()) warn(warnings, "the surface is empty");
}

}  // namespace

std::vector<CreaseEdge> crease_edges(const ControlCage& cage) {
  std::vector<CreaseEdge> edges;
  const bool one_a_chain = cage.crease_sharpnesses.size() == cage.crease_lengths.size();
  std::size_t first = 0;
  for (std::size_t chain = 0; chain < cage.crease_lengths.size(); ++chain) {
    const std::size_t length = static_cast<std::size_t>(cage.crease_lengths[chain]);
    for (std::size_t i = first; i + 1 < first + length; ++i) {
      const std::size_t value = one_a_chain ? chain : edges.size();
      edges.push_back(
          {cage.crease_indices[i], cage.crease_indices[i + 1], cage.crease_sharpnesses[value]});
    }
    first += length;
  }
  return edges;
}

CageWarnings validate(const ControlCage& cage) {
  check_points(cage);
  check_counts(cage);
  check_faces(cage);
  check_creases(cage);
  check_corners_and_holes(cage);
  for (const Primvar& primvar : cage.primvars) check_primvar(cage, primvar);
  CageWarnings warnings{cage.notes};
  const CageTopology topology = make_topology(cage);
  check_valences(topology);
  check_crease_edges(cage, topology, warnings);
  warn_about_topology(topology, warnings);
  warn_about_faces(cage, topology, warnings);
  return warnings;
}

}  // namespace limitray

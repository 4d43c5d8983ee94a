// Stage: control cage, the input of everything. Names and meanings are UsdGeomMesh's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "limitray/math/vec.h"

namespace limitray {

/// How the surface ends at a boundary edge (UsdGeomMesh interpolateBoundary).
enum class InterpolateBoundary { none, edge_only, edge_and_corner };
/// UsdGeomMesh faceVaryingLinearInterpolation.
enum class FaceVaryingLinearInterpolation {
  none,
  corners_only,
  corners_plus1,
  corners_plus2,
  boundaries,
  all
};
/// Weights of triangles (UsdGeomMesh triangleSubdivisionRule).
enum class TriangleSubdivisionRule { catmull_clark, smooth };
/// How semi-sharp creases decay: uniformly, or by Chaikin's averaging along the crease.
enum class CreasingMethod { uniform, chaikin };
/// Winding that faces outward: counter-clockwise (right-handed) or clockwise (left-handed).
enum class Orientation { right_handed, left_handed };

/// How the values of a primvar spread over the surface (UsdGeomPrimvar).
enum class Interpolation { constant, uniform, varying, vertex, face_varying };

/// Values over the surface: `values` is n x `width`; `indices` into its rows has one entry
/// (constant), one a face (uniform), one a point (varying: linear; vertex: like the points) or one
/// a face corner (face-varying).
struct Primvar {
  std::string name;
  Interpolation interpolation = Interpolation::face_varying;
  int width = 2;
  std::vector<float> values;
  std::vector<std::int32_t> indices;
};

/// Sharpness from which a crease or corner counts as infinitely sharp (OpenSubdiv's rule).
inline constexpr float infinite_sharpness = 10.0f;

/// A polygon mesh with subdivision tags. Plain data: `validate` says whether it can be refined.
struct ControlCage {
  std::vector<Vec3d> points;
  std::vector<std::int32_t> face_vertex_counts;   // one a face, >= 3
  std::vector<std::int32_t> face_vertex_indices;  // sum of counts, into points

  InterpolateBoundary interpolate_boundary = InterpolateBoundary::edge_and_corner;
  FaceVaryingLinearInterpolation face_varying_linear_interpolation =
      FaceVaryingLinearInterpolation::corners_plus1;
  TriangleSubdivisionRule triangle_subdivision_rule = TriangleSubdivisionRule::catmull_clark;
  CreasingMethod creasing_method = CreasingMethod::uniform;
  Orientation orientation = Orientation::right_handed;

  std::vector<std::int32_t> crease_indices;  // vertices of all chains, one after the other
  std::vector<std::int32_t> crease_lengths;  // vertices a chain, >= 2
  std::vector<float> crease_sharpnesses;     // one a chain, or one an edge
  std::vector<std::int32_t> corner_indices;
  std::vector<float> corner_sharpnesses;
  std::vector<std::int32_t> hole_indices;  // faces that are absent from the surface

  std::vector<Primvar> primvars;

  /// What a file reader ignored or repaired, as "file:line: what"; `validate` repeats it.
  std::vector<std::string> notes;

  std::size_t face_count() const { return face_vertex_counts.size(); }
};

/// One edge of a crease, expanded from the chains.
struct CreaseEdge {
  std::int32_t v0, v1;
  float sharpness;
};

/// The crease chains of `cage` as single edges (one value a chain is repeated along it). The
/// crease arrays must be consistent, as `validate` checks.
std::vector<CreaseEdge> crease_edges(const ControlCage& cage);

/// Result of validation that is not an error: things a user should know (`limitray info`).
struct CageWarnings {
  std::vector<std::string> messages;
};

/// Checks every array of `cage` in linear time. Throws std::invalid_argument that names the
/// argument, the rule and the value got, as in
/// "face_vertex_indices[17]: must be in [0, 8), got 9". Refused are: points or primvar values that
/// are not finite; indices out of range; counts that don't add up; faces with fewer than 3 or more
/// than 65535 vertices, or with a repeated vertex; a vertex in 65535 faces or more; negative or NaN
/// sharpness (inf is fine); crease chains that leave the edges of the mesh, or crease an edge
/// twice with different sharpness; repeated corner and hole indices.
///
/// Returns what is allowed but worth a warning: the reader's notes, crease edges repeated with the
/// same sharpness, vertices in no face, faces without area, an empty surface, faces dropped by
/// InterpolateBoundary::none, and non-manifold edges and vertices. The latter work as OpenSubdiv
/// has them: an edge of more than two faces, or of two that wind differently, is an infinitely
/// sharp crease; a vertex whose faces are not one fan is an infinitely sharp corner.
CageWarnings validate(const ControlCage& cage);

}  // namespace limitray

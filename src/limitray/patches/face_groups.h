// Stage: patches (S0). Comes in: a cage. Goes out: small cages that together have all its faces.
//
// A patch depends on the faces around its base face only. So the cage is cut into groups of faces,
// each with its neighbours as a rim, that are refined on their own: in parallel, in little memory,
// in time linear in the size of the group (OpenSubdiv's time for refining a few faces of a large
// cage is not).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/cage/cage.h"
#include "limitray/cage/topology.h"

namespace limitray {

/// A part of a cage with its own numbering of faces and vertices. Their order is the cage's, so
/// that OpenSubdiv adds up the same numbers in the same order in all groups.
struct FaceGroup {
  std::vector<std::int32_t> faces;          // index in the cage, one a face of the group
  std::vector<std::int32_t> own_faces;      // into faces: those that get patches
  std::vector<std::int32_t> refined_faces;  // into faces: those to be refined
  std::vector<std::int32_t> vertices;       // index in the cage, one a vertex of the group
  std::vector<std::int32_t> face_vertex_counts, face_vertex_indices;
  std::vector<std::int32_t> corners;       // index in the cage, one a face corner of the group
  std::vector<std::int32_t> crease_pairs;  // two vertices a crease edge
  std::vector<float> crease_sharpnesses;   // one a crease edge
  std::vector<std::int32_t> corner_indices;
  std::vector<float> corner_sharpnesses;
};

/// Cuts a cage into groups. Absent faces (holes, and what the boundary rule `none` takes away) are
/// in no group, but in rims, where they are ordinary faces.
class FaceGroups {
 public:
  /// `cage` must be valid and live as long as this. Groups are smaller where `deepest_level`, to
  /// which they will be refined, may make very many patches of a face.
  FaceGroups(const ControlCage& cage, int deepest_level);

  std::size_t size() const { return (faces_.size() + group_size_ - 1) / group_size_; }
  /// Makes group `index`, below size(). Thread-safe.
  FaceGroup make(std::size_t index) const;

 private:
  void sharpen_non_manifold_corners();
  void add_faces(FaceGroup& group, std::span<const std::int32_t> own) const;
  void add_topology(FaceGroup& group) const;

  const ControlCage& cage_;
  CageTopology topology_;
  std::vector<std::int32_t> faces_;  // those that have a surface
  std::size_t group_size_;
  std::vector<float> edge_sharpness_, vertex_sharpness_;  // one an edge or vertex of the cage
};

}  // namespace limitray

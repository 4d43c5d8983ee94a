// Stage: patches (S0). See face_groups.h.
#include "limitray/patches/face_groups.h"

#include <algorithm>

namespace limitray {
namespace {

/// Appends all faces at the vertices of `faces` that are not yet there.
void add_ring(const ControlCage& cage, const CageTopology& topology,
              std::vector<std::int32_t>& faces, std::vector<bool>& taken) {
  const std::size_t inner = faces.size();
  for (std::size_t i = 0; i < inner; ++i) {
    for (std::int32_t c = topology.face_offsets[faces[i]]; c < topology.face_offsets[faces[i] + 1];
         ++c) {
      for (const std::int32_t corner : topology.vertex_corners[cage.face_vertex_indices[c]]) {
        const std::int32_t face = topology.corner_faces[corner];
        if (taken[face]) continue;
        taken[face] = true;
        faces.push_back(face);
      }
    }
  }
}

/// Positions in the sorted `all` of the sorted `some`.
std::vector<std::int32_t> positions_in(std::span<const std::int32_t> all,
                                       std::span<const std::int32_t> some) {
  std::vector<std::int32_t> positions;
  auto it = all.begin();
  for (const std::int32_t value : some) {
    it = std::lower_bound(it, all.end(), value);
    positions.push_back(static_cast<std::int32_t>(it - all.begin()));
  }
  return positions;
}

}  // namespace

FaceGroups::FaceGroups(const ControlCage& cage, int deepest_level)
    : cage_(cage),
      topology_(make_topology(cage)),
      edge_sharpness_(topology_.edges.size()),
      vertex_sharpness_(cage.points.size()) {
  const std::vector<bool> absent = absent_faces(cage, topology_);
  for (std::size_t f = 0; f < cage.face_count(); ++f)
    if (!absent[f]) faces_.push_back(static_cast<std::int32_t>(f));
  // A face between unlike creases has some 2^level patches along its edges.
  const std::size_t smallest = deepest_level > 7 ? 1024u >> (deepest_level - 6) : 1024;
  group_size_ = std::clamp<std::size_t>(faces_.size() / 32, smallest, 8 * smallest);

  for (const CreaseEdge& crease : crease_edges(cage))
    edge_sharpness_[topology_.find_edge(crease.v0, crease.v1)] = crease.sharpness;
  for (std::size_t i = 0; i < cage.corner_indices.size(); ++i)
    vertex_sharpness_[cage.corner_indices[i]] = cage.corner_sharpnesses[i];
  sharpen_non_manifold_corners();
}

/// A vertex with more than two infinitely sharp edges does not move. OpenSubdiv's patches know it
/// of manifold vertices only (its subdivision, of all), so here the others are tagged as corners.
void FaceGroups::sharpen_non_manifold_corners() {
  for (std::size_t v = 0; v < vertex_sharpness_.size(); ++v) {
    if (!topology_.vertex_non_manifold[v]) continue;
    const auto edges = topology_.vertex_edges[static_cast<std::int32_t>(v)];
    const auto sharp = std::count_if(edges.begin(), edges.end(), [&](std::int32_t e) {
      return edge_sharpness_[e] >= infinite_sharpness || topology_.edge_non_manifold[e] ||
             topology_.edge_corners[e].size() != 2;
    });
    if (sharp > 2) vertex_sharpness_[v] = infinite_sharpness;
  }
}

FaceGroup FaceGroups::make(std::size_t index) const {
  const std::size_t begin = index * group_size_, end = std::min(faces_.size(), begin + group_size_);
  FaceGroup group;
  add_faces(group, {faces_.data() + begin, end - begin});
  add_topology(group);
  return group;
}

/// All faces around a refined one must be there. Chaikin's rule looks one edge farther for the
/// sharpness, so there the neighbours are refined, too.
void FaceGroups::add_faces(FaceGroup& group, std::span<const std::int32_t> own) const {
  std::vector<bool> taken(cage_.face_count());
  std::vector<std::int32_t> refined(own.begin(), own.end());
  for (const std::int32_t face : own) taken[face] = true;
  const bool chaikin = cage_.creasing_method == CreasingMethod::chaikin;
  if (chaikin) add_ring(cage_, topology_, refined, taken);
  group.faces = refined;
  add_ring(cage_, topology_, group.faces, taken);
  if (chaikin) add_ring(cage_, topology_, group.faces, taken);

  std::sort(group.faces.begin(), group.faces.end());
  std::sort(refined.begin(), refined.end());
  group.own_faces = positions_in(group.faces, own);
  group.refined_faces = positions_in(group.faces, refined);
}

void FaceGroups::add_topology(FaceGroup& group) const {
  for (const std::int32_t face : group.faces) {
    group.face_vertex_counts.push_back(cage_.face_vertex_counts[face]);
    for (std::int32_t c = topology_.face_offsets[face]; c < topology_.face_offsets[face + 1]; ++c)
      group.corners.push_back(c);
  }
  for (const std::int32_t corner : group.corners)
    group.vertices.push_back(cage_.face_vertex_indices[corner]);
  std::sort(group.vertices.begin(), group.vertices.end());
  group.vertices.erase(std::unique(group.vertices.begin(), group.vertices.end()),
                       group.vertices.end());

  std::vector<std::int32_t> local(cage_.points.size());
  for (std::size_t v = 0; v < group.vertices.size(); ++v)
    local[group.vertices[v]] = static_cast<std::int32_t>(v);
  for (const std::int32_t corner : group.corners)
    group.face_vertex_indices.push_back(local[cage_.face_vertex_indices[corner]]);
  for (const std::int32_t vertex : group.vertices) {
    if (vertex_sharpness_[vertex] <= 0) continue;
    group.corner_indices.push_back(local[vertex]);
    group.corner_sharpnesses.push_back(vertex_sharpness_[vertex]);
  }
  for (const std::int32_t corner : group.corners) {
    const std::int32_t edge = topology_.corner_edges[corner];
    if (edge_sharpness_[edge] <= 0) continue;
    group.crease_pairs.push_back(local[topology_.edges[edge].v0]);
    group.crease_pairs.push_back(local[topology_.edges[edge].v1]);
    group.crease_sharpnesses.push_back(edge_sharpness_[edge]);
  }
}

}  // namespace limitray

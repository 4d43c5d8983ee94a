// OpenSubdiv's own limit positions and normals at the vertices of a uniformly refined cage, in
// double, with their places on the base faces: the yardstick of the limit evaluator.
#pragma once

#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefiner.h>

#include <memory>
#include <vector>

#include "limitray/cage/cage.h"

namespace limitray::test {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

/// A point with the interface that PrimvarRefiner wants.
struct RefinedPoint {
  Vec3d p;
  void Clear() { p = {}; }
  void AddWithWeight(const RefinedPoint& other, double weight) { p = p + weight * other.p; }
};

/// A refined vertex as a corner of a refined face: its place on the base face and what is there.
struct RefinedCorner {
  std::int32_t face, sub_quad;
  double u, v;
  int vertex, valence_faces;  // refined vertex and its number of faces
  Sdc::Crease::Rule rule;
  bool settled;  // no semi-sharp feature is left at the vertex
  bool manifold;
  Vec3d limit, tangent1, tangent2;  // tangents are 0 for a cage with non-manifold vertices
};

inline Sdc::Options sdc_options(const ControlCage& cage) {
  Sdc::Options options;
  using Boundary = Sdc::Options::VtxBoundaryInterpolation;
  constexpr Boundary boundaries[] = {Sdc::Options::VTX_BOUNDARY_NONE,
                                     Sdc::Options::VTX_BOUNDARY_EDGE_ONLY,
                                     Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER};
  options.SetVtxBoundaryInterpolation(boundaries[static_cast<int>(cage.interpolate_boundary)]);
  constexpr Sdc::Options::CreasingMethod methods[] = {Sdc::Options::CREASE_UNIFORM,
                                                      Sdc::Options::CREASE_CHAIKIN};
  options.SetCreasingMethod(methods[static_cast<int>(cage.creasing_method)]);
  constexpr Sdc::Options::TriangleSubdivision rules[] = {Sdc::Options::TRI_SUB_CATMARK,
                                                         Sdc::Options::TRI_SUB_SMOOTH};
  options.SetTriangleSubdivision(rules[static_cast<int>(cage.triangle_subdivision_rule)]);
  return options;
}

inline std::unique_ptr<Far::TopologyRefiner> make_refiner(const ControlCage& cage, int level) {
  std::vector<int> crease_pairs;
  std::vector<float> crease_weights;
  for (const CreaseEdge& crease : crease_edges(cage)) {
    crease_pairs.insert(crease_pairs.end(), {crease.v0, crease.v1});
    crease_weights.push_back(crease.sharpness);
  }
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(cage.points.size());
  descriptor.numFaces = static_cast<int>(cage.face_count());
  descriptor.numVertsPerFace = cage.face_vertex_counts.data();
  descriptor.vertIndicesPerFace = cage.face_vertex_indices.data();
  descriptor.numCreases = static_cast<int>(crease_weights.size());
  descriptor.creaseVertexIndexPairs = crease_pairs.data();
  descriptor.creaseWeights = crease_weights.data();
  descriptor.numCorners = static_cast<int>(cage.corner_indices.size());
  descriptor.cornerVertexIndices = cage.corner_indices.data();
  descriptor.cornerWeights = cage.corner_sharpnesses.data();
  descriptor.numHoles = static_cast<int>(cage.hole_indices.size());
  descriptor.holeIndices = cage.hole_indices.data();
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  std::unique_ptr<Far::TopologyRefiner> refiner(
      Factory::Create(descriptor, Factory::Options(Sdc::SCHEME_CATMARK, sdc_options(cage))));
  Far::TopologyRefiner::UniformOptions options(level);
  options.fullTopologyInLastLevel = true;
  refiner->RefineUniform(options);
  return refiner;
}

/// Points of `level`, the last level of `refiner`.
inline std::vector<RefinedPoint> refined_points(const ControlCage& cage,
                                                const Far::TopologyRefiner& refiner) {
  std::vector<RefinedPoint> points;
  for (const Vec3d& p : cage.points) points.push_back({p});
  const Far::PrimvarRefinerReal<double> primvars(refiner);
  for (int level = 1; level <= refiner.GetMaxLevel(); ++level) {
    std::vector<RefinedPoint> next(refiner.GetLevel(level).GetNumVertices());
    primvars.Interpolate(level, points, next);
    points = std::move(next);
  }
  return points;
}

/// A face of the last level: base face, sub-quad and the square it covers.
struct RefinedPlace {
  std::int32_t face = 0, sub_quad = 0;
  double u = 0, v = 0, size = 1;
};

inline RefinedPlace refined_place(const Far::TopologyRefiner& refiner, int level, int face) {
  if (level == 0) return {face, 0, 0, 0, 1};
  const int parent = refiner.GetLevel(level).GetFaceParentFace(face);
  const Far::TopologyLevel& above = refiner.GetLevel(level - 1);
  const Far::ConstIndexArray children = above.GetFaceChildFaces(parent);
  int corner = 0;
  while (children[corner] != face) ++corner;
  RefinedPlace place = refined_place(refiner, level - 1, parent);
  if (above.GetFaceVertices(parent).size() != 4) {
    place.sub_quad = corner;
    return place;
  }
  place.size /= 2;
  if (corner == 1 || corner == 2) place.u += place.size;
  if (corner >= 2) place.v += place.size;
  return place;
}

/// All corners of all faces that are no holes, after `level` >= 1 uniform steps.
inline std::vector<RefinedCorner> refined_corners(const ControlCage& cage, int level) {
  const std::unique_ptr<Far::TopologyRefiner> refiner = make_refiner(cage, level);
  const std::vector<RefinedPoint> points = refined_points(cage, *refiner);
  std::vector<RefinedPoint> limits(points.size()), tangents1(points.size()),
      tangents2(points.size());
  const Far::TopologyLevel& last = refiner->GetLevel(level);
  bool manifold = true;
  for (int v = 0; v < last.GetNumVertices(); ++v) {
    manifold &= !last.IsVertexNonManifold(v) || last.GetVertexFaces(v).empty();
  }
  // OpenSubdiv writes tangent weights out of bounds at vertices with more faces than edges.
  const Far::PrimvarRefinerReal<double> primvars(*refiner);
  if (manifold) {
    primvars.Limit(points, limits, tangents1, tangents2);
  } else {
    primvars.Limit(points, limits);
  }

  std::vector<RefinedCorner> corners;
  for (int face = 0; face < last.GetNumFaces(); ++face) {
    if (last.IsFaceHole(face)) continue;
    const RefinedPlace place = refined_place(*refiner, level, face);
    for (int corner = 0; corner < 4; ++corner) {
      const int vertex = last.GetFaceVertices(face)[corner];
      bool settled = last.GetVertexSharpness(vertex) == 0 || last.GetVertexSharpness(vertex) >= 10;
      for (const int edge : last.GetVertexEdges(vertex)) {
        const float sharpness = last.GetEdgeSharpness(edge);
        settled = settled && (sharpness == 0 || sharpness >= 10);
      }
      const bool right = corner == 1 || corner == 2, upper = corner >= 2;
      corners.push_back({place.face, place.sub_quad, place.u + right * place.size,
                         place.v + upper * place.size, vertex, last.GetVertexFaces(vertex).size(),
                         last.GetVertexRule(vertex), settled, !last.IsVertexNonManifold(vertex),
                         limits[vertex].p, tangents1[vertex].p, tangents2[vertex].p});
    }
  }
  return corners;
}

}  // namespace limitray::test

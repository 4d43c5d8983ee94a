// Cages out of a fuzzer's bytes: a topology (any faces, or a sheet, fan or prism so that most of
// them can be refined), points, tags, rules and a primvar of each kind.
#pragma once

#include "byte_reader.h"
#include "limitray/cage/cage.h"

namespace limitray::fuzz {

inline void add_face(ControlCage& cage, const std::vector<std::int32_t>& vertices) {
  cage.face_vertex_counts.push_back(static_cast<std::int32_t>(vertices.size()));
  cage.face_vertex_indices.insert(cage.face_vertex_indices.end(), vertices.begin(), vertices.end());
}

inline int add_any_faces(ControlCage& cage, ByteReader& bytes) {
  const int points = bytes.below(16);
  for (int faces = bytes.below(12); faces > 0; --faces) {
    std::vector<std::int32_t> vertices;
    for (int sides = bytes.below(8); sides > 0; --sides)
      vertices.push_back(bytes.below(points + 1));
    add_face(cage, vertices);
  }
  return points + 1;
}

inline int add_sheet(ControlCage& cage, ByteReader& bytes) {
  const int columns = 1 + bytes.below(5), rows = 1 + bytes.below(5);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int v = j * (columns + 1) + i, w = v + columns + 1;
      if (bytes.below(4) == 0) {
        add_face(cage, {v, v + 1, w + 1});
        add_face(cage, {v, w + 1, w});
      } else {
        add_face(cage, {v, v + 1, w + 1, w});
      }
    }
  return (columns + 1) * (rows + 1);
}

/// Quads or triangles around a vertex; closed or open.
inline int add_fan(ControlCage& cage, ByteReader& bytes) {
  const int sides = 2 + bytes.below(48), open = bytes.below(2);
  const bool quads = bytes.below(2) == 0;
  const int ring = quads ? 2 * sides : sides;
  for (int i = 0; i + open < sides; ++i) {
    const auto at = [&](int k) { return 1 + k % ring; };
    if (quads)
      add_face(cage, {0, at(2 * i), at(2 * i + 1), at(2 * i + 2)});
    else
      add_face(cage, {0, at(i), at(i + 1)});
  }
  return ring + 1;
}

inline int add_prism(ControlCage& cage, ByteReader& bytes) {
  const int sides = 3 + bytes.below(30);
  std::vector<std::int32_t> bottom, top;
  for (int i = 0; i < sides; ++i) {
    const int next = (i + 1) % sides;
    add_face(cage, {i, next, sides + next, sides + i});
    bottom.insert(bottom.begin(), i);
    top.push_back(sides + i);
  }
  add_face(cage, bottom);
  add_face(cage, top);
  return 2 * sides;
}

/// Creases along edges of the faces, most often.
inline void add_creases(ControlCage& cage, ByteReader& bytes, int points) {
  const int corners = static_cast<int>(cage.face_vertex_indices.size());
  for (int count = bytes.below(8); count > 0; --count) {
    const int corner = corners > 1 ? bytes.below(corners - 1) : 0;
    const bool on_edge = corners > 1 && bytes.below(16) != 0;
    for (int i = 0; i < 2; ++i)
      cage.crease_indices.push_back(on_edge ? cage.face_vertex_indices[corner + i]
                                            : bytes.below(points + 1));
    cage.crease_lengths.push_back(2);
    cage.crease_sharpnesses.push_back(bytes.sharpness());
  }
}

inline void add_tags(ControlCage& cage, ByteReader& bytes, int points) {
  add_creases(cage, bytes, points);
  for (int count = bytes.below(4); count > 0; --count) {
    cage.corner_indices.push_back(bytes.below(points));
    cage.corner_sharpnesses.push_back(bytes.sharpness());
  }
  const int faces = static_cast<int>(cage.face_count());
  for (int count = bytes.below(3); count > 0; --count)
    cage.hole_indices.push_back(bytes.below(faces + 1));
}

/// One value a place, so that the indices are simple.
inline void add_primvar(ControlCage& cage, ByteReader& bytes) {
  Primvar primvar{"st", static_cast<Interpolation>(bytes.below(5)), 1 + bytes.below(4), {}, {}};
  const std::size_t sizes[] = {1, cage.face_count(), cage.points.size(), cage.points.size(),
                               cage.face_vertex_indices.size()};
  const int rows = 1 + bytes.below(9);
  for (int i = 0; i < rows * primvar.width; ++i)
    primvar.values.push_back(static_cast<float>(bytes.coordinate()));
  for (std::size_t i = 0; i < sizes[static_cast<int>(primvar.interpolation)]; ++i)
    primvar.indices.push_back(static_cast<std::int32_t>(i) % rows);
  cage.primvars.push_back(std::move(primvar));
}

inline ControlCage take_cage(ByteReader& bytes) {
  ControlCage cage;
  const int kind = bytes.below(4);
  const int points = kind == 0   ? add_any_faces(cage, bytes)
                     : kind == 1 ? add_sheet(cage, bytes)
                     : kind == 2 ? add_fan(cage, bytes)
                                 : add_prism(cage, bytes);
  cage.interpolate_boundary = static_cast<InterpolateBoundary>(bytes.below(3));
  cage.face_varying_linear_interpolation =
      static_cast<FaceVaryingLinearInterpolation>(bytes.below(6));
  cage.triangle_subdivision_rule = static_cast<TriangleSubdivisionRule>(bytes.below(2));
  cage.creasing_method = static_cast<CreasingMethod>(bytes.below(2));
  cage.orientation = static_cast<Orientation>(bytes.below(2));
  add_tags(cage, bytes, points);
  cage.points.resize(static_cast<std::size_t>(points));
  for (Vec3d& p : cage.points) p = {bytes.coordinate(), bytes.coordinate(), bytes.coordinate()};
  add_primvar(cage, bytes);
  return cage;
}

}  // namespace limitray::fuzz

// Stage: control cage. Semi-sharp creases (DeRose, Kass, Truong: Subdivision Surfaces in Character
// Animation, 1998) with OpenSubdiv's conventions: sharpness is a float, 10 or more is infinite, and
// it falls by one a level, after Chaikin's averaging along the crease if that is asked for.
#pragma once

#include "limitray/cage/cage.h"

namespace limitray {

/// Rule of a vertex by its sharp edges: none, one, two, or more (or a sharp vertex).
enum class VertexRule { smooth, dart, crease, corner };

inline bool is_sharp(float sharpness) { return sharpness > 0; }
inline bool is_infinite(float sharpness) { return sharpness >= infinite_sharpness; }
inline bool is_semi_sharp(float sharpness) {
  return is_sharp(sharpness) && !is_infinite(sharpness);
}

inline VertexRule vertex_rule(float vertex_sharpness, int sharp_edges) {
  if (is_sharp(vertex_sharpness) || sharp_edges > 2) return VertexRule::corner;
  return static_cast<VertexRule>(sharp_edges);
}

/// Sharpness one level on, falling by one.
inline float decayed(float sharpness) {
  if (is_infinite(sharpness)) return infinite_sharpness;
  return sharpness > 1 ? sharpness - 1 : 0;
}

/// Semi-sharp edges at a vertex, which Chaikin's rule averages.
struct SemiSharpEdges {
  float sum = 0;
  int count = 0;

  void add(float sharpness) {
    if (!is_semi_sharp(sharpness)) return;
    sum += sharpness;
    ++count;
  }
};

/// Sharpness of the half of an edge that lies at a vertex, one level on, by Chaikin's rule: three
/// quarters of its own and one quarter of the mean of the others there.
inline float decayed_chaikin(float sharpness, const SemiSharpEdges& at_vertex) {
  if (!is_semi_sharp(sharpness) || at_vertex.count < 2) return decayed(sharpness);
  const float others = (at_vertex.sum - sharpness) / static_cast<float>(at_vertex.count - 1);
  const float mean = 0.75f * sharpness + 0.25f * others - 1;
  return mean > 0 ? mean : 0;
}

}  // namespace limitray

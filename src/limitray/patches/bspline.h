// Stage: patches (S0). Uniform bicubic B-spline control values to Bezier control values. V is a
// number, or a vector of components. Index t*4+s in both nets; the patch is the middle cell of the
// B-spline net.
//
// All products but the last one are with powers of two, hence exact: the result is the same bit for
// bit with and without fused multiply-adds.
#pragma once

#include "limitray/math/isa.h"

namespace limitray {

/// Edges of a patch as bits, in OpenSubdiv's order.
enum PatchEdge : unsigned { edge_t0 = 1, edge_s1 = 2, edge_t1 = 4, edge_s0 = 8 };

inline namespace LIMITRAY_ISA {

/// Replaces the control values beyond the surface boundaries in `edges` by extrapolation, so that
/// the surface ends in the B-spline curve of the boundary row. The corner beyond two boundaries is
/// extrapolated from the rows just filled in, hence rows first, columns after.
template <class V>
void extrapolate_boundaries(V (&p)[16], unsigned edges) {
  for (int i = 0; i < 4; ++i) {
    if (edges & edge_t0) p[i] = 2 * p[4 + i] - p[8 + i];
    if (edges & edge_t1) p[12 + i] = 2 * p[8 + i] - p[4 + i];
  }
  for (int j = 0; j < 16; j += 4) {
    if (edges & edge_s0) p[j] = 2 * p[j + 1] - p[j + 2];
    if (edges & edge_s1) p[j + 3] = 2 * p[j + 2] - p[j + 1];
  }
}

/// One row of a cubic B-spline to six times its Bezier form, in place; `stride` apart. Reversing
/// the input reverses the output bit for bit.
template <class V>
[[gnu::always_inline]] inline void bspline_to_six_bezier(V* p, int stride) {
  const V b0 = p[0], b1 = p[stride], b2 = p[2 * stride], b3 = p[3 * stride];
  p[0] = (b0 + b2) + 4 * b1;
  p[stride] = 4 * b1 + 2 * b2;
  p[2 * stride] = 2 * b1 + 4 * b2;
  p[3 * stride] = (b1 + b3) + 4 * b2;
}

/// A bicubic B-spline net to its Bezier net, in place.
template <class V>
[[gnu::always_inline]] inline void bspline_to_bezier(V (&p)[16]) {
  for (int i = 0; i < 4; ++i) bspline_to_six_bezier(p + i, 4);
  for (int j = 0; j < 16; j += 4) bspline_to_six_bezier(p + j, 1);
  for (V& v : p) v = (1.0 / 36) * v;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

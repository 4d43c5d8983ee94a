// Stage: BVH. Comes in: patches in float. Goes out: boxes that contain their exact surfaces.
#pragma once

#include "limitray/bvh/bvh.h"
#include "limitray/intersect/root_patch.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// How much boxes are padded for a mesh whose control values are at most `radius`.
///
/// Rounding of what the box is made from: storage u R, two restrictions (docs/accuracy.md, section
/// 2) 14 u R. Rounding of the slab test: the origin is in the extent, so a plane is at most D = 2 R
/// from it; origin u R, subtraction u D, reciprocal 2 u D, product u D, together 9 u R. In all 24 u
/// R; 48 leaves room for the higher orders and for the padding itself.
inline float box_padding(double radius) {
  return float(48 * double(unit_roundoff<float>) * radius * (1 + 1e-6));
}

/// The hull of the control values of 4 x 4 subpatches, padded. Twice subdivided nets are within a
/// sixteenth of the first net's distance from the surface.
inline Box patch_bounds(const PatchNet<float>& net, const PatchBump<float>* bump, float padding) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    const Spread<float> columns = spread_columns(load_net(net.c[axis]));
    Net<float> hi = load_net(net.c[axis]), lo = hi;
    for (int i = 0; i < 4; ++i) {
      const Restriction<float> ru = restriction(0.25f * float(i), 0.25f * float(i + 1));
      const Spread<float> rows = spread_rows(restrict_u(columns, ru));
      for (int j = 0; j < 4; ++j) {
        const Restriction<float> rv = restriction(0.25f * float(j), 0.25f * float(j + 1));
        const Net<float> n = restrict_v(rows, rv);
        hi = i + j == 0 ? n : max(hi, n);
        lo = i + j == 0 ? -1.0f * n : max(lo, -1.0f * n);
      }
    }
    const float reach = padding + (bump ? bump_reach<float>(load_quad(bump->c[axis])) : 0.0f);
    const float infinity = std::numeric_limits<float>::infinity();
    box.hi[axis] = std::nextafter(max_value(hi) + reach, infinity);
    box.lo[axis] = std::nextafter(-max_value(lo) - reach, -infinity);
  }
  return box;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

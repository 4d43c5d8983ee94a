// Stage: BVH. Comes in: patches in float. Goes out: boxes that contain their exact surfaces.
#pragma once

#include "limitray/bvh/bvh.h"
#include "limitray/patches/gregory.h"
#include "limitray/patches/patch_values.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// How much hulls are padded for a mesh whose control values are at most `radius`.
///
/// Rounding of what the box is made from (docs/accuracy.md, section 3): storage u R, a chain of
/// ten midpoints 10 u R, the sums with the reach of the bump and the padding 2 u R. Rounding of the
/// slab test: the origin is in the extent, so a plane is at most D = 2 R from it; origin u R, its
/// product u R, reciprocal 2 u D, the plane's product u R, difference u D, together 9 u R. In all
/// 22 u R; 48 leaves room for the higher orders and for the padding itself.
inline float box_padding(double radius) {
  return float(48 * double(unit_roundoff<float>) * radius * (1 + 1e-6));
}

/// The control values of the quarters of a cubic, by de Casteljau at 1/2 and again. Those between
/// two quarters are left out: each is the midpoint of its neighbours.
template <class V>
[[gnu::always_inline]] inline void quarter(const V* p, int stride, V (&out)[10]) {
  const auto mid = [](V a, V b) -> V { return Element<V>(0.5) * (a + b); };
  const auto halve = [&](V a, V b, V c, V d, V* to) {
    const V ab = mid(a, b), bc = mid(b, c), cd = mid(c, d);
    to[0] = ab, to[1] = mid(ab, bc), to[2] = mid(bc, cd), to[3] = cd;
  };
  V half[4];
  out[0] = p[0], out[9] = p[3 * stride];
  halve(out[0], p[stride], p[2 * stride], out[9], half);
  const V middle = mid(half[1], half[2]);
  halve(out[0], half[0], half[1], middle, out + 1);
  halve(middle, half[2], half[3], out[9], out + 5);
}

/// The hull of one component's control values in 4 x 4 subpatches; twice subdivided nets are within
/// a sixteenth of the first net's distance from the surface.
template <class V>
[[gnu::always_inline]] inline ValueRange<V> quartered_range(const V (&p)[16]) {
  V rows[4][10];
  for (int j = 0; j < 4; ++j) quarter(p + 4 * j, 1, rows[j]);
  ValueRange<V> range(rows[0][0]);
  for (int i = 0; i < 10; ++i) {
    V column[10];
    quarter(&rows[0][i], 10, column);
    for (int j = 0; j < 10; j += 2) range.add(column[j], column[j + 1]);
  }
  return range;
}

/// Contains the surface but for rounding.
template <class V>
void make_patch_hull(const PatchValues<V>& patch, PatchHull<V>& hull) {
  for (int axis = 0; axis < 3; ++axis) {
    const ValueRange<V> range = quartered_range(patch.c[axis]);
    const V reach = bump_height<Element<V>> * patch.bumps[axis];
    hull.lo[axis] = range.lo - reach;
    hull.hi[axis] = range.hi + reach;
  }
}

/// The same with room for all rounding.
inline Box padded(const PatchHull<float>& hull, float padding) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lo[axis] = hull.lo[axis] - padding;
    box.hi[axis] = hull.hi[axis] + padding;
  }
  return box;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

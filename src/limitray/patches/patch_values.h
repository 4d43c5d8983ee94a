// Stage: patches. The values of a patch in registers of their own: V is a number, or one for each
// of several patches (math/lanes.h), so that nothing is ever summed or compared across a register.
#pragma once

#include "limitray/math/lanes.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

template <class V>
struct PatchValues {
  V c[3][16];
  V bumps[3];  // sum of the four |bump|, 0 for a Bezier patch
};

/// Sum of the four |bump| of component `axis`; 0 for null.
template <class T>
T sum_bumps(const PatchBump<T>* bump, int axis) {
  return bump ? sum(abs(load_quad(bump->c[axis]))) : T(0);
}

/// `bump` is null for a Bezier patch.
template <class T>
PatchValues<T> values_of(const PatchNet<T>& net, const PatchBump<T>* bump) {
  PatchValues<T> v;
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < 16; ++i) v.c[axis][i] = net.c[axis][i];
    v.bumps[axis] = sum_bumps(bump, axis);
  }
  return v;
}
/// The same for one patch a lane.
inline void load_values(const PatchNet<float>* const (&nets)[lane_count],
                        const PatchBump<float>* const (&bumps)[lane_count], PatchValues<Lanes>& v) {
  for (int axis = 0; axis < 3; ++axis) {
    const float* rows[lane_count];
    float sums[lane_count];
    for (int j = 0; j < lane_count; ++j) {
      rows[j] = nets[j]->c[axis];
      sums[j] = sum_bumps(bumps[j], axis);
    }
    load_by_lane(rows, v.c[axis]);
    v.bumps[axis] = load_lanes(sums);
  }
}

/// Smallest and largest of some values.
template <class V>
struct ValueRange {
  V lo, hi;

  explicit ValueRange(V v) : lo(v), hi(v) {}
  void add(V v) {
    lo = min(lo, v);
    hi = max(hi, v);
  }
  /// Both at once: what comes next waits for half as many steps.
  void add(V a, V b) {
    lo = min(lo, min(a, b));
    hi = max(hi, max(a, b));
  }
  /// Largest |value|.
  V magnitude() const { return max(V(-lo), hi); }
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

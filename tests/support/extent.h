// The extent of a mesh whose control values relative to its centre are at most `radius`.
#pragma once

#include "limitray/intersect/ray.h"

namespace limitray::test {

inline Extent extent_of(double radius, const Vec3d& center = {}) {
  const double half = radius * (1 + 1e-5);
  return {center, {half, half, half}, half};
}

}  // namespace limitray::test

// The box of one patch, as the tree has it.
#pragma once

#include "limitray/bvh/bounds.h"

namespace limitray::test {

/// `bump` is null for a Bezier patch; `radius` as PatchBuffer's.
inline Box box_of(const PatchNet<float>& net, const PatchBump<float>* bump, double radius) {
  PatchHull<float> hull;
  make_patch_hull(values_of(net, bump), hull);
  return padded(hull, box_padding(radius));
}

}  // namespace limitray::test

// Points of a patch in double, written without the kernels: the triangles of the peers are made of
// them.
#pragma once

#include "limitray/math/vec.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray::bench {

/// The surface at (s,t) of a patch (patch_buffer.h gives the formula), relative to the buffer's
/// origin. `bump` is null for a Bezier patch.
Vec3d patch_point(const PatchNet<double>& net, const PatchBump<double>* bump, double s, double t);

}  // namespace limitray::bench

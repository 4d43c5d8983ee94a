// The rays of the comparison: primary and diffuse, the same for all tracers, the same each run.
#pragma once

#include <vector>

#include "limitray/scene.h"
#include "tracer.h"

namespace limitray::bench {

/// Answers in double: the truth for one set of rays.
struct OracleHits {
  std::vector<double> t, normal;  // t = inf for a miss; unit normals, 3 a ray
};
OracleHits ask_oracle(const Scene& scene, const RaySet& rays);

/// Longest side of the scene's bounds: the unit of all errors.
double extent(const Scene& scene);

/// About `count` rays (a whole picture) of a pinhole camera at azimuth 30, elevation 22 degrees,
/// four half diagonals away; the picture's frame is the bounding rectangle of what is seen of the
/// object. One jittered sample a pixel, in scan order.
RaySet primary_rays(const Scene& scene, std::size_t count);

/// As many rays as `primary`, cosine-distributed around the normals at the primary hits, on the
/// viewer's side, shuffled. They start a thousandth of the extent above the surface: coarse
/// tessellations would otherwise swallow their origins.
RaySet diffuse_rays(const Scene& scene, const RaySet& primary, const OracleHits& hits);

}  // namespace limitray::bench

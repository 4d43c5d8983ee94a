// How far the hits of a tracer are from the true surface, judged in double.
#pragma once

#include "limitray/scene.h"
#include "ray_sets.h"
#include "tracer.h"

namespace limitray::bench {

/// Errors are relative to the extent. The distance of a hit from the surface is the smaller of two:
/// along the ray to the oracle's hit, and along the tracer's own normal to the surface (the former
/// alone would count a grazing ray, or one that passes an edge, as far off). A hit beside the rim
/// of an open surface is found by neither: for hits that stand out, lines parallel to the normal, a
/// little aside, are tried, too. It is measured for every k-th ray, so that at most 2e5 rays are.
struct Accuracy {
  double mean_error = 0, max_error = 0;
  std::size_t mismatches = 0;  // of all rays: hit where the oracle misses, or the other way round
  std::size_t strays = 0;  // measured hits with no surface within 1 % of the extent; not in errors
};
Accuracy measure_accuracy(const Scene& oracle, const RaySet& rays, const OracleHits& truth,
                          const HitBuffers& hits);

}  // namespace limitray::bench

#include "accuracy.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limitray::bench {
namespace {

constexpr std::size_t most_samples = 200000;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// Lines through hits along their normals, and how far to look for the surface on either side.
struct Probes {
  std::vector<double> lines, near, far;
  std::vector<double> along_ray;  // distance along the ray; inf if the oracle missed

  void add(const Vec3d& point, const Vec3d& normal, double reach, double ray_distance) {
    for (int axis = 0; axis < 3; ++axis) lines.push_back(point[axis]);
    for (int axis = 0; axis < 3; ++axis) lines.push_back(normal[axis]);
    near.push_back(-reach);
    far.push_back(reach);
    along_ray.push_back(ray_distance);
  }
};

Probes make_probes(const RaySet& rays, const OracleHits& truth, const HitBuffers& hits,
                   double extent) {
  Probes probes;
  const std::size_t step = std::max<std::size_t>(1, rays.size() / most_samples);
  for (std::size_t i = 0; i < rays.size(); i += step) {
    if (!std::isfinite(hits.t[i])) continue;
    const float* r = rays.rays.data() + 6 * i;
    const Vec3d dir{r[3], r[4], r[5]}, point = Vec3d{r[0], r[1], r[2]} + double(hits.t[i]) * dir;
    Vec3d n{hits.normal[3 * i], hits.normal[3 * i + 1], hits.normal[3 * i + 2]};
    n = length(n) > 0 ? (1 / length(n)) * n : (1 / length(dir)) * dir;
    const double along_ray = std::abs(double(hits.t[i]) - truth.t[i]) * length(dir);
    // A little beyond: the surface may lie exactly at the end.
    const double reach = std::min(along_ray, 0.01 * extent) * (1 + 1e-6) + 1e-12 * extent;
    probes.add(point, n, reach, along_ray);
  }
  return probes;
}

}  // namespace

Accuracy measure_accuracy(const Scene& oracle, const RaySet& rays, const OracleHits& truth,
                          const HitBuffers& hits) {
  Accuracy a;
  for (std::size_t i = 0; i < rays.size(); ++i)
    a.mismatches += std::isfinite(hits.t[i]) != std::isfinite(truth.t[i]);

  const double size = extent(oracle);
  const Probes probes = make_probes(rays, truth, hits, size);
  const IntersectionList found =
      oracle.list_intersections({probes.lines, probes.near, probes.far});
  double sum = 0;
  for (std::size_t i = 0; i < probes.along_ray.size(); ++i) {
    double distance = probes.along_ray[i];
    for (std::uint64_t k = found.offsets[i]; k < found.offsets[i + 1]; ++k)
      distance = std::min(distance, std::abs(found.t[k]));
    if (distance > 0.01 * size) {
      ++a.strays;
      continue;
    }
    sum += distance / size;
    a.max_error = std::max(a.max_error, distance / size);
  }
  const std::size_t measured = probes.along_ray.size() - a.strays;
  if (measured) a.mean_error = sum / double(measured);
  return a;
}

}  // namespace limitray::bench

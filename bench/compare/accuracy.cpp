#include "accuracy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace limitray::bench {
namespace {

constexpr std::size_t most_samples = 200000;

/// A hit: where it is, and the best bound known on its distance from the surface.
struct Sample {
  Vec3d point, normal;
  double distance;
};

/// Lines along the normals of samples, which the oracle meets with the surface.
class Probes {
 public:
  /// A line `aside` of sample `i`, followed for `reach` on either side.
  void add(std::size_t i, const Sample& s, const Vec3d& aside, double reach) {
    const Vec3d org = s.point + aside;
    for (int axis = 0; axis < 3; ++axis) lines_.push_back(org[axis]);
    for (int axis = 0; axis < 3; ++axis) lines_.push_back(s.normal[axis]);
    near_.push_back(-reach);
    far_.push_back(reach);
    sample_.push_back(i);
    aside_.push_back(length(aside));
  }

  /// Lowers the samples' distances to what the lines find.
  void measure(const Scene& oracle, std::vector<Sample>& samples) const {
    const IntersectionList list = oracle.list_intersections({lines_, near_, far_});
    for (std::size_t i = 0; i < sample_.size(); ++i)
      for (std::uint64_t k = list.offsets[i]; k < list.offsets[i + 1]; ++k) {
        double& distance = samples[sample_[i]].distance;
        distance = std::min(distance, std::hypot(list.t[k], aside_[i]));
      }
  }

 private:
  std::vector<double> lines_, near_, far_, aside_;
  std::vector<std::size_t> sample_;
};

std::vector<Sample> take_samples(const RaySet& rays, const OracleHits& truth,
                                 const HitBuffers& hits) {
  std::vector<Sample> samples;
  const std::size_t step = std::max<std::size_t>(1, rays.size() / most_samples);
  for (std::size_t i = 0; i < rays.size(); i += step) {
    if (!std::isfinite(hits.t[i])) continue;
    const float* r = rays.rays.data() + 6 * i;
    const Vec3d dir{r[3], r[4], r[5]};
    Vec3d n{hits.normal[3 * i], hits.normal[3 * i + 1], hits.normal[3 * i + 2]};
    n = length(n) > 0 ? (1 / length(n)) * n : (1 / length(dir)) * dir;
    samples.push_back({Vec3d{r[0], r[1], r[2]} + double(hits.t[i]) * dir, n,
                       std::abs(double(hits.t[i]) - truth.t[i]) * length(dir)});
  }
  return samples;
}

void measure_along_normals(const Scene& oracle, double far_off, std::vector<Sample>& samples) {
  Probes probes;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // A little beyond: the surface may lie exactly at the end.
    const double reach = std::min(samples[i].distance, far_off) * (1 + 1e-6) + 1e-10 * far_off;
    probes.add(i, samples[i], {}, reach);
  }
  probes.measure(oracle, samples);
}

/// For samples that stand out, being 20 times as far off as half of all: eight lines around, from a
/// millionth of the largest distance on outward.
void measure_beside_rims(const Scene& oracle, double far_off, std::vector<Sample>& samples) {
  std::vector<double> distances;
  for (const Sample& s : samples) distances.push_back(s.distance);
  const auto middle = distances.begin() + std::ptrdiff_t(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double typical = distances.empty() ? 0 : *middle;

  Probes probes;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    if (s.distance <= 20 * typical) continue;
    const Vec3d n = s.normal, other = std::abs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    Vec3d a = cross(n, other);
    a = (1 / length(a)) * a;
    const Vec3d b = cross(n, a);
    const double reach = std::min(s.distance, far_off);
    for (double aside = 1e-6 * far_off; aside < reach; aside *= 2)
      for (int k = 0; k < 8; ++k) {
        const double angle = k * (std::numbers::pi / 4);
        probes.add(i, s, aside * (std::cos(angle) * a + std::sin(angle) * b), reach);
      }
  }
  probes.measure(oracle, samples);
}

}  // namespace

Accuracy measure_accuracy(const Scene& oracle, const RaySet& rays, const OracleHits& truth,
                          const HitBuffers& hits) {
  Accuracy a;
  for (std::size_t i = 0; i < rays.size(); ++i)
    a.mismatches += std::isfinite(hits.t[i]) != std::isfinite(truth.t[i]);

  const double size = extent(oracle), far_off = 0.01 * size;
  std::vector<Sample> samples = take_samples(rays, truth, hits);
  measure_along_normals(oracle, far_off, samples);
  measure_beside_rims(oracle, far_off, samples);
  double sum = 0;
  for (const Sample& s : samples) {
    if (s.distance > far_off) {
      ++a.strays;
      continue;
    }
    sum += s.distance / size;
    a.max_error = std::max(a.max_error, s.distance / size);
  }
  if (samples.size() > a.strays) a.mean_error = sum / double(samples.size() - a.strays);
  return a;
}

}  // namespace limitray::bench

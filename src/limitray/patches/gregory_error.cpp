// Stage: patches (S0). See gregory_error.h.
#include "limitray/patches/gregory_error.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "limitray/cage/limit.h"
#include "limitray/math/bezier.h"
#include "limitray/patches/gregory.h"
#include "limitray/patches/refine.h"
#include "limitray/patches/sample_cage.h"

namespace limitray {
namespace {

/// The largest error lies elsewhere than at the places compared: on all cages and models of the
/// tests it is at most this much larger (docs/accuracy.md).
constexpr double margin = 2;
/// Places compared on a Gregory patch, as distances along u and v from its extraordinary corner:
/// the error is largest along the edges there, nearer to the corner for a higher valence.
constexpr double places[][2] = {{0.5, 0}, {0, 0.5}, {0.15, 0}, {0, 0.15}, {0.6, 0.6}, {0.3, 0.3}};
constexpr std::int32_t patches_a_centre = 3;  // of those around the middle of a face

Vec3d evaluate(const PatchBuffer<double>& patches, std::size_t i, double s, double t) {
  const Quad<double> bs = bernstein(s), bt = bernstein(t);
  const BumpWeights<double> w = bump_weights(s, t);
  Vec3d p = patches.origin;
  for (int axis = 0; axis < 3; ++axis) {
    const double* net = patches.nets[i].c[axis];
    const double* bump = patches.bumps[patches.infos[i].bump].c[axis];
    for (int k = 0; k < 16; ++k) p[axis] += bs[k % 4] * bt[k / 4] * net[k];
    for (int k = 0; k < 4; ++k) p[axis] += w.g[k] * bump[k];
  }
  return p;
}

/// Distance of `p` from the limit along its normal, at the foot of `p` near (u,v): one step of
/// Newton's method in the tangent plane.
double distance(const LimitEvaluator& limit, const PatchInfo& info, const Vec3d& p, double u,
                double v) {
  const auto at = [&](double x, double y) {
    return limit.evaluate(static_cast<std::int32_t>(info.face), info.sub_quad, x, y);
  };
  const LimitSample q = at(u, v);
  const Vec3d r = p - q.point;
  const double uu = dot(q.dp_du, q.dp_du), uv = dot(q.dp_du, q.dp_dv), vv = dot(q.dp_dv, q.dp_dv);
  const double x = dot(r, q.dp_du), y = dot(r, q.dp_dv), det = uu * vv - uv * uv;
  if (!(det > 1e-12 * uu * vv)) return std::abs(dot(r, q.normal));
  const LimitSample foot = at(std::clamp(u + (vv * x - uv * y) / det, 0.0, 1.0),
                              std::clamp(v + (uu * y - uv * x) / det, 0.0, 1.0));
  return std::min(length(r), std::abs(dot(p - foot.point, foot.normal)));
}

/// Longest side of the box around the points that faces use.
double size_of(const ControlCage& cage) {
  if (cage.face_vertex_indices.empty()) return 0;
  Vec3d low = cage.points[cage.face_vertex_indices[0]], high = low;
  for (const std::int32_t vertex : cage.face_vertex_indices)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], cage.points[vertex][k]);
      high[k] = std::max(high[k], cage.points[vertex][k]);
    }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

/// The sampled part of a cage, measured at one level after the other.
class Sample {
 public:
  explicit Sample(const ControlCage& cage) : size_(size_of(cage)), sample_(sample_cage(cage)) {
    if (sample_.cage.face_count() == 0) return;
    limit_.emplace(sample_.cage);
    first_corner_.push_back(0);
    for (const std::int32_t n : sample_.cage.face_vertex_counts)
      first_corner_.push_back(first_corner_.back() + n);
  }

  /// In units of the cage's size.
  double error(int level) const {
    if (!limit_ || !(size_ > 0)) return 0;
    const ControlCage& cage = sample_.cage;
    const PatchBuffer<double> patches = Refiner(cage, {level}).make_patches(cage.points);
    double largest = 0;
    for (std::size_t i = 0; i < patches.size(); ++i)
      if (patches.infos[i].bump != no_bump && is_chosen(patches.infos[i]))
        largest = std::max(largest, error_of(patches, i));
    return margin * largest / size_;
  }

 private:
  /// Whether the extraordinary vertex at the quad's corner was chosen, or is the middle of a face.
  bool is_chosen(const PatchInfo& info) const {
    const bool right = info.u0 > 0, upper = info.v0 > 0;
    const std::int32_t first = first_corner_[info.face], n = first_corner_[info.face + 1] - first;
    if (n != 4 && right && upper)
      return info.sub_quad % std::max<std::int32_t>(1, n / patches_a_centre) == 0;
    const std::int32_t corner = n != 4 ? info.sub_quad : upper ? (right ? 2 : 3) : right;
    return sample_.chosen_points[sample_.cage.face_vertex_indices[first + corner]];
  }

  double error_of(const PatchBuffer<double>& patches, std::size_t i) const {
    const PatchInfo& info = patches.infos[i];
    const bool right = info.u0 > 0, upper = info.v0 > 0;
    double largest = 0;
    for (const auto& [a, b] : places) {
      const double s = right ? 1 - a : a, t = upper ? 1 - b : b;
      const double u = info.u0 + s * info.du, v = info.v0 + t * info.dv;
      largest = std::max(largest, distance(*limit_, info, evaluate(patches, i, s, t), u, v));
    }
    return largest;
  }

  double size_;
  SampleCage sample_;
  std::vector<std::int32_t> first_corner_;
  std::optional<LimitEvaluator> limit_;
};

}  // namespace

double gregory_error(const ControlCage& cage, int isolation_level) {
  return Sample(cage).error(isolation_level);
}

LevelChoice choose_level(const ControlCage& cage, double tolerance, int highest) {
  const Sample sample(cage);
  LevelChoice choice{lowest_chosen_level, sample.error(lowest_chosen_level)};
  while (choice.error > tolerance && choice.isolation_level < highest) {
    // No error falls faster than sixfold a level.
    const double levels = std::floor(std::log(choice.error / tolerance) / std::log(6.0));
    const int more = static_cast<int>(std::clamp(levels, 1.0, 10.0));
    choice.isolation_level = std::min(highest, choice.isolation_level + more);
    choice.error = sample.error(choice.isolation_level);
  }
  return choice;
}

}  // namespace limitray

// Stage: patches (S0). See gregory_error.h.
#include "limitray/patches/gregory_error.h"

#include <tbb/parallel_for.h>

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
/// tests it is at most this much larger (docs/tolerance.md).
constexpr double margin = 2;
/// Places compared on a Gregory patch, as distances along u and v from its extraordinary corner:
/// the error is largest along the edges there, nearer to the corner for a higher valence.
constexpr double places[][2] = {{0.5, 0},  {0, 0.5},  {0.25, 0},  {0, 0.25},
                                {0.12, 0}, {0, 0.12}, {0.6, 0.6}, {0.3, 0.3}};
/// Places where all patches are compared to find the worst ones, which are measured.
constexpr std::size_t places_to_rank = 2, worst_of_all = 2, measured_at_most = 10;
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

/// A place on a Gregory patch and the point of the patch there.
struct PatchPoint {
  Vec3d point;
  std::int32_t face, sub_quad;
  double u, v;
};

/// The same at `place` of `places`.
PatchPoint point_at(const PatchBuffer<double>& patches, std::size_t i, const double (&place)[2]) {
  const PatchInfo& info = patches.infos[i];
  const double s = info.u0 > 0 ? 1 - place[0] : place[0];
  const double t = info.v0 > 0 ? 1 - place[1] : place[1];
  return {evaluate(patches, i, s, t), static_cast<std::int32_t>(info.face), info.sub_quad,
          info.u0 + s * info.du, info.v0 + t * info.dv};
}

/// Distance of a point from the limit along the normal at (u,v).
double rough_distance(const LimitEvaluator& limit, const PatchPoint& p) {
  const LimitSample q = limit.evaluate(p.face, p.sub_quad, p.u, p.v);
  return std::abs(dot(p.point - q.point, q.normal));
}

/// Distance of a point from the limit along the normal at its foot near (u,v): one step of Newton's
/// method in the tangent plane, if it leads nearer.
double distance(const LimitEvaluator& limit, const PatchPoint& p) {
  const LimitSample q = limit.evaluate(p.face, p.sub_quad, p.u, p.v);
  const Vec3d r = p.point - q.point;
  const double uu = dot(q.dp_du, q.dp_du), uv = dot(q.dp_du, q.dp_dv), vv = dot(q.dp_dv, q.dp_dv);
  const double x = dot(r, q.dp_du), y = dot(r, q.dp_dv), det = uu * vv - uv * uv;
  const double along_normal = std::abs(dot(r, q.normal));
  if (!(det > 1e-12 * uu * vv)) return along_normal;
  const LimitSample foot =
      limit.evaluate(p.face, p.sub_quad, std::clamp(p.u + (vv * x - uv * y) / det, 0.0, 1.0),
                     std::clamp(p.v + (uu * y - uv * x) / det, 0.0, 1.0));
  const Vec3d from_foot = p.point - foot.point;
  return length(from_foot) < length(r) ? std::abs(dot(from_foot, foot.normal)) : along_normal;
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

/// The corner of a quad where a Gregory patch lies, from one level to the next.
struct QuadCorner {
  std::uint32_t face, sub_quad;
  bool right, upper;
  bool operator==(const QuadCorner&) const = default;
};
QuadCorner corner_of(const PatchInfo& info) {
  return {info.face, info.sub_quad, info.u0 > 0, info.v0 > 0};
}

/// The sampled part of a cage, measured at one level after the other.
class Sample {
 public:
  explicit Sample(const ControlCage& cage) : size_(size_of(cage)), sample_(sample_cage(cage)) {
    ControlCage& part = sample_.cage;
    if (part.face_count() == 0 || !(size_ > 0)) return;
    limit_.emplace(part);
    first_corner_.push_back(0);
    for (const std::int32_t n : part.face_vertex_counts)
      first_corner_.push_back(first_corner_.back() + n);
    choose_corners();
    // Only the faces that are measured are refined from now on.
    part.hole_indices.clear();
    for (std::uint32_t face = 0; face < part.face_count(); ++face)
      if (std::none_of(corners_.begin(), corners_.end(),
                       [&](const auto& c) { return c.face == face; }))
        part.hole_indices.push_back(static_cast<std::int32_t>(face));
  }

  /// In units of the cage's size.
  double error(int level) const {
    if (corners_.empty()) return 0;
    const PatchBuffer<double> patches =
        Refiner(sample_.cage, {level}).make_patches(sample_.cage.points);
    std::vector<double> errors(patches.size());
    tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t i) {
      if (patches.infos[i].bump == no_bump) return;
      const QuadCorner corner = corner_of(patches.infos[i]);
      if (std::find(corners_.begin(), corners_.end(), corner) == corners_.end()) return;
      for (const auto& place : places)
        errors[i] = std::max(errors[i], distance(*limit_, point_at(patches, i, place)));
    });
    const double largest = *std::max_element(errors.begin(), errors.end());
    return margin * largest / size_;
  }

 private:
  /// Kind of the extraordinary vertex at a quad's corner, or -n for the middle of a face with n
  /// sides; nothing if the vertex was not chosen.
  std::optional<std::int32_t> kind_of(const QuadCorner& c) const {
    const std::int32_t first = first_corner_[c.face], n = first_corner_[c.face + 1] - first;
    const auto sub_quad = static_cast<std::int32_t>(c.sub_quad);
    if (n != 4 && c.right && c.upper) {
      if (sub_quad % std::max<std::int32_t>(1, n / patches_a_centre) != 0) return {};
      return -n;
    }
    const std::int32_t corner = n != 4 ? sub_quad : c.upper ? (c.right ? 2 : 3) : c.right;
    const std::int32_t kind = sample_.kinds[sample_.cage.face_vertex_indices[first + corner]];
    return kind < 0 ? std::optional<std::int32_t>() : kind;
  }

  /// The worst corners at the lowest level, and the worst of each kind, as errors fall at different
  /// rates.
  void choose_corners() {
    struct Candidate {
      double error;
      QuadCorner corner;
      std::int32_t kind;
    };
    const PatchBuffer<double> patches =
        Refiner(sample_.cage, {lowest_chosen_level}).make_patches(sample_.cage.points);
    std::vector<Candidate> candidates;
    std::vector<std::size_t> patch_of;
    for (std::size_t i = 0; i < patches.size(); ++i) {
      if (patches.infos[i].bump == no_bump) continue;
      const QuadCorner corner = corner_of(patches.infos[i]);
      const std::optional<std::int32_t> kind = kind_of(corner);
      if (!kind) continue;
      candidates.push_back({0, corner, *kind});
      patch_of.push_back(i);
    }
    tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
      double& error = candidates[i].error;
      for (std::size_t k = 0; k < places_to_rank; ++k)
        error = std::max(error, rough_distance(*limit_, point_at(patches, patch_of[i], places[k])));
    });
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.error > b.error; });
    std::vector<std::int32_t> kinds;
    for (std::size_t i = 0; i < candidates.size() && corners_.size() < measured_at_most; ++i) {
      const std::int32_t kind = candidates[i].kind;
      const bool is_new = std::find(kinds.begin(), kinds.end(), kind) == kinds.end();
      if (is_new) kinds.push_back(kind);
      if (is_new || i < worst_of_all) corners_.push_back(candidates[i].corner);
    }
  }

  double size_;
  SampleCage sample_;
  std::vector<std::int32_t> first_corner_;
  std::vector<QuadCorner> corners_;
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

// Rays at the seams of a closed surface, and a count of those that leak.
//
// Two kinds of ray decide by topology alone: from inside a closed surface every ray must hit, and a
// ray from outside to a point inside must hit before it gets there, whatever rounding did to it.
// All rays are aimed at a point of the surface, and must hit at or before it. Where a ray passes
// beyond its target, rounding may have moved it past the surface: it is a leak if the target is
// smooth and met at an angle, or if the double path finds a hit that the ray missed.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "limitray/scene.h"
#include "surface_targets.h"

namespace limitray::test {

enum class RayKind { through_to_inside, from_inside, random_from_inside, grazing, coherent };
inline constexpr int ray_kinds = 5;
/// How many of a hundred rays are of each kind: a grazing ray costs as much as ten others.
inline constexpr int ray_percent[ray_kinds] = {30, 25, 20, 2, 23};
inline const char* name_of(RayKind k) {
  constexpr const char* names[] = {"outside, through the target to a point inside",
                                   "inside, at the target", "inside, anywhere",
                                   "outside, grazing the target", "outside, coherent along a seam"};
  return names[int(k)];
}

struct LeakCounts {
  std::uint64_t rays = 0, leaks = 0;
  std::uint64_t beyond = 0;  // passed the target, and so does the exact ray
  std::uint64_t unresolved = 0;
  void add(const LeakCounts& c) {
    rays += c.rays, leaks += c.leaks, beyond += c.beyond, unresolved += c.unresolved;
  }
};

/// A ray's duties: hit at all by `must_hit_by`; at or before `target_t`, without excuse if
/// `strict`.
struct Duty {
  double must_hit_by = std::numeric_limits<double>::infinity();
  bool must_hit = false, strict = false, aimed = false;
  double target_t = 0, slack = 0;
};

class WatertightCage {
 public:
  WatertightCage(const ControlCage& cage, int isolation_level, std::uint64_t seed)
      : targets_(Refiner(cage, {isolation_level}).make_patches(cage.points)), generator_(seed) {
    scene_.add_mesh(cage, {isolation_level});
    const auto [lo, hi] = scene_.bounds();
    center_ = 0.5 * (lo + hi);
    half_ = 0.5 * (hi - lo);
    radius_ = length(half_);
    find_inside_points();
  }

  Scene& scene() { return scene_; }
  std::size_t inside_points() const { return inside_.size(); }
  /// The first leaking rays, for the report: origin, direction.
  const std::vector<std::string>& examples() const { return examples_; }

  /// Casts one kind's share of `all` rays, rounded to T.
  template <class T>
  LeakCounts run_share(RayKind kind, std::size_t all) {
    return run<T>(kind, all * std::size_t(ray_percent[int(kind)]) / 100);
  }
  /// Casts n rays of one kind, rounded to T.
  template <class T>
  LeakCounts run(RayKind kind, std::size_t n) {
    constexpr std::size_t block = 4096;
    LeakCounts counts;
    for (std::size_t done = 0; done < n; done += block)
      counts.add(run_block<T>(kind, std::min(block, n - done)));
    return counts;
  }

 private:
  double uniform(double lo, double hi) { return lo + (hi - lo) * unit_random(generator_); }
  Vec3d direction() {
    while (true) {
      const Vec3d v{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      const double l = length(v);
      if (l > 1e-3 && l <= 1) return (1 / l) * v;
    }
  }

  /// Points inside by at least `margin`: seven lines around each cross the surface an odd number of
  /// times (in double).
  void find_inside_points() {
    const double tnear = 0, tfar = std::numeric_limits<double>::infinity();
    for (int attempt = 0; attempt < 20000 && inside_.size() < 200; ++attempt) {
      const Vec3d p = center_ + Vec3d{half_.x * uniform(-1, 1), half_.y * uniform(-1, 1),
                                      half_.z * uniform(-1, 1)};
      std::vector<double> rays;
      for (int k = 0; k < 7; ++k) {
        Vec3d q = p, d = direction();
        if (k < 6) q[k / 2] += (k % 2 ? margin : -margin) * radius_;
        rays.insert(rays.end(), {q.x, q.y, q.z, d.x, d.y, d.z});
      }
      std::uint32_t hits[7];
      scene_.count_intersections({rays, {&tnear, 1}, {&tfar, 1}}, hits);
      int odd = 0;
      for (const std::uint32_t h : hits) odd += int(h & 1);
      if (odd == 7) inside_.push_back(p);
    }
  }
  const Vec3d& inside_point() { return inside_[generator_() % inside_.size()]; }

  /// Stores origin and direction rounded to T; direction is towards `to`, which the ray reaches at
  /// t = 1 / scale.
  template <class T>
  void add_ray(std::vector<T>& rays, const Vec3d& from, const Vec3d& to, double scale) {
    Vec3d org;
    for (int i = 0; i < 3; ++i) rays.push_back(T(from[i])), org[i] = double(rays.back());
    for (int i = 0; i < 3; ++i) rays.push_back(T(scale * (to[i] - org[i])));
  }

  /// The target of the next ray: each serves eight.
  const Target& next_target() {
    if (target_uses_++ % 8 == 0)
      target_ = targets_.pick(TargetKind(generator_() % target_kinds), generator_);
    return target_;
  }

  template <class T>
  Duty make_ray(RayKind kind, std::vector<T>& rays) {
    const Target target = next_target();
    const double scale = generator_() % 4 ? 1 : std::pow(10.0, uniform(-3, 3));
    Duty duty;
    duty.aimed = true, duty.target_t = 1 / scale;
    Vec3d from = inside_point();
    switch (kind) {
      case RayKind::through_to_inside: {
        const Vec3d inside = from, d = inside - target.point;
        const double distance = radius_ * std::pow(10.0, uniform(0.4, generator_() % 8 ? 1 : 3));
        from = target.point - (distance / length(d)) * d;
        duty.must_hit = true;
        duty.must_hit_by = (1 + length(d) / distance) / scale;
        break;
      }
      case RayKind::from_inside:
        duty.must_hit = true;
        break;
      case RayKind::random_from_inside:
        add_ray(rays, from, from + radius_ * direction(), scale);
        duty.aimed = false, duty.must_hit = true;
        return duty;
      case RayKind::grazing: {
        const Vec3d side = cross(target.normal, direction());
        const Vec3d tilt = std::pow(10.0, uniform(-7, -0.5)) * target.normal;
        from = target.point + 3 * radius_ * (side + tilt);
        break;
      }
      case RayKind::coherent:
        return make_coherent_ray(rays);
    }
    add_ray(rays, from, target.point, scale);
    set_slack<T>(duty, target, from);
    return duty;
  }

  /// Rays of one origin along one side of a patch, in small steps.
  template <class T>
  Duty make_coherent_ray(std::vector<T>& rays) {
    if (coherent_step_ == 0) {
      coherent_from_ = center_ + 2.5 * radius_ * direction();
      coherent_patch_ = generator_() % targets_.patches().size();
      coherent_side_ = int(generator_() % 4);
    }
    const double x = double(coherent_step_) / 256, end = coherent_side_ & 1;
    coherent_step_ = (coherent_step_ + 1) % 257;
    const Target target = coherent_side_ < 2 ? targets_.at(coherent_patch_, end, x)
                                             : targets_.at(coherent_patch_, x, end);
    Duty duty;
    duty.aimed = true, duty.target_t = 1;
    add_ray(rays, coherent_from_, target.point, 1);
    set_slack<T>(duty, target, coherent_from_);
    return duty;
  }

  /// Strict where the surface is smooth and met at an angle: then the rounded ray meets it within
  /// the rounding of the ray, divided by the sine of the angle.
  template <class T>
  void set_slack(Duty& duty, const Target& target, const Vec3d& from) {
    const Vec3d d = target.point - from;
    const double l = length(d), sine = std::abs(dot(target.normal, d)) / l;
    const double u = std::numeric_limits<T>::epsilon() / 2;
    duty.strict = target.smooth && sine > 0.2;
    duty.slack = duty.target_t * 1000 * u * (1 + (radius_ + length(center_)) / l);
  }

  template <class T>
  LeakCounts run_block(RayKind kind, std::size_t n) {
    std::vector<T> rays;
    std::vector<Duty> duties;
    for (std::size_t i = 0; i < n; ++i) duties.push_back(make_ray(kind, rays));
    std::vector<T> t(n), t_error(n);
    HitArrays<T> hits;
    hits.t = t.data(), hits.t_error = t_error.data();
    const T tnear = 0, tfar = std::numeric_limits<T>::infinity();
    const std::uint64_t unresolved = scene_.statistics().unresolved;
    scene_.cast_rays<T>({rays, {&tnear, 1}, {&tfar, 1}}, hits);
    LeakCounts counts;
    counts.rays = n;
    counts.unresolved = scene_.statistics().unresolved - unresolved;
    for (std::size_t i = 0; i < n; ++i)
      judge(rays.data() + 6 * i, duties[i], double(t[i]), double(t_error[i]), counts);
    return counts;
  }

  template <class T>
  void judge(const T* ray, const Duty& duty, double t, double t_error, LeakCounts& counts) {
    bool leak = duty.must_hit && !(t <= duty.must_hit_by);
    if (!leak && duty.aimed && !(t <= duty.target_t + duty.slack + t_error)) {
      leak = duty.strict || hits_before<T>(ray, t - t_error);
      counts.beyond += !leak;
    }
    counts.leaks += leak;
    if (leak && examples_.size() < 10) {
      char text[400];
      std::snprintf(text, sizeof text,
                    "%.17g %.17g %.17g  %.17g %.17g %.17g  t %.9g target %.9g%s%s", double(ray[0]),
                    double(ray[1]), double(ray[2]), double(ray[3]), double(ray[4]), double(ray[5]),
                    t, duty.target_t, duty.strict ? " strict" : "", duty.must_hit ? " must" : "");
      examples_.push_back(text);
    }
  }
  /// Whether the double path meets the ray, as it was rounded, certainly before t.
  template <class T>
  bool hits_before(const T* ray, double t) {
    const double exact[6] = {double(ray[0]), double(ray[1]), double(ray[2]),
                             double(ray[3]), double(ray[4]), double(ray[5])};
    double td, error;
    HitArrays<double> hits;
    hits.t = &td, hits.t_error = &error;
    const double tnear = 0, tfar = std::numeric_limits<double>::infinity();
    scene_.cast_rays<double>({exact, {&tnear, 1}, {&tfar, 1}}, hits);
    return td + error < t;
  }

  static constexpr double margin = 2e-3;  // of the radius

  SurfaceTargets targets_;
  std::mt19937_64 generator_;
  Scene scene_{1};
  Vec3d center_, half_;
  double radius_ = 0;
  Target target_{};
  std::uint64_t target_uses_ = 0;
  std::vector<Vec3d> inside_;
  std::vector<std::string> examples_;
  int coherent_step_ = 0, coherent_side_ = 0;
  std::size_t coherent_patch_ = 0;
  Vec3d coherent_from_;
};

}  // namespace limitray::test

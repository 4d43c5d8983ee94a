// Batches of rays for the scene tests.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "limitray/scene.h"

namespace limitray::test {

/// Rays, six values each, and everything that a closest hit reports.
template <class T>
struct Rays {
  std::vector<T> values;

  std::size_t size() const { return values.size() / 6; }
  void add(const Vec3d& org, const Vec3d& dir) {
    for (int i = 0; i < 3; ++i) values.push_back(T(org[i]));
    for (int i = 0; i < 3; ++i) values.push_back(T(dir[i]));
  }
  /// Adds the ray from `org` to `target`, reached at t = 1 up to rounding.
  void aim(const Vec3d& org, const Vec3d& target) {
    Vec3d dir;
    for (int i = 0; i < 3; ++i) dir[i] = target[i] - double(T(org[i]));
    add(org, dir);
  }
  Vec3d org(std::size_t i) const { return vec(6 * i); }
  Vec3d dir(std::size_t i) const { return vec(6 * i + 3); }
  Vec3d at(std::size_t i, double t) const { return org(i) + t * dir(i); }

 private:
  Vec3d vec(std::size_t k) const {
    return {double(values[k]), double(values[k + 1]), double(values[k + 2])};
  }
};

template <class T>
struct Hits {
  std::vector<T> t, t_error, uv, normal, point, dp_du, dp_dv;
  std::vector<std::uint32_t> geometry_id, primitive_id, sub_quad, patch_id;

  bool hit(std::size_t i) const { return std::isfinite(t[i]); }
  friend bool operator==(const Hits&, const Hits&) = default;
};

template <class T>
Hits<T> cast(const Scene& scene, const Rays<T>& rays, T tnear = 0,
             T tfar = std::numeric_limits<T>::infinity()) {
  const std::size_t n = rays.size();
  Hits<T> h;
  for (auto* v : {&h.t, &h.t_error}) v->resize(n);
  h.uv.resize(2 * n);
  for (auto* v : {&h.normal, &h.point, &h.dp_du, &h.dp_dv}) v->resize(3 * n);
  for (auto* v : {&h.geometry_id, &h.primitive_id, &h.sub_quad, &h.patch_id}) v->resize(n);
  HitArrays<T> out;
  out.t = h.t.data(), out.t_error = h.t_error.data(), out.uv = h.uv.data();
  out.normal = h.normal.data(), out.point = h.point.data();
  out.dp_du = h.dp_du.data(), out.dp_dv = h.dp_dv.data();
  out.geometry_id = h.geometry_id.data(), out.primitive_id = h.primitive_id.data();
  out.sub_quad = h.sub_quad.data(), out.patch_id = h.patch_id.data();
  scene.cast_rays<T>({rays.values, {&tnear, 1}, {&tfar, 1}}, out);
  return h;
}

inline std::vector<std::uint32_t> count(const Scene& scene, const Rays<double>& rays) {
  std::vector<std::uint32_t> n(rays.size());
  const double tnear = 0, tfar = std::numeric_limits<double>::infinity();
  scene.count_intersections({rays.values, {&tnear, 1}, {&tfar, 1}}, n.data());
  return n;
}

}  // namespace limitray::test

// Stage: scene. See arguments.h.
#include "limitray/arguments.h"

#include <cmath>

namespace limitray {

void check_points(std::span<const Vec3d> points, std::size_t expected) {
  if (points.size() != expected)
    throw std::invalid_argument("points: must have " + std::to_string(expected) +
                                " rows like the mesh, got " + std::to_string(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!std::isfinite(points[i].x) || !std::isfinite(points[i].y) || !std::isfinite(points[i].z))
      throw std::invalid_argument("points[" + std::to_string(i) + "]: must be finite");
}

void check_options(const MeshOptions& options) {
  if (options.isolation_level < 0 || options.isolation_level > 10)
    throw std::invalid_argument("isolation_level: must be 1 to 10, or 0 to choose it, got " +
                                std::to_string(options.isolation_level));
  if (!(options.tolerance > 0))
    throw std::invalid_argument("tolerance: must be above 0, got " +
                                std::to_string(options.tolerance));
}

int highest_chosen_level(const MeshOptions& options) {
  return options.tolerance < default_tolerance ? 10 : 6;
}

Affine inverse(const Affine& a) {
  const auto& m = a.linear;
  const Vec3d c0 = cross(m[1], m[2]), c1 = cross(m[2], m[0]), c2 = cross(m[0], m[1]);
  const double det = dot(m[0], c0);
  Affine r;
  r.linear = {Vec3d{c0.x, c1.x, c2.x}, Vec3d{c0.y, c1.y, c2.y}, Vec3d{c0.z, c1.z, c2.z}};
  for (Vec3d& row : r.linear) row = (1 / det) * row;
  r.offset = -1.0 * r.vector(a.offset);
  const double check = length(r.linear[0]) + length(r.linear[1]) + length(r.linear[2]);
  if (!std::isfinite(check) || !std::isfinite(length(r.offset)))
    throw std::invalid_argument("transform: must be finite and invertible, determinant is " +
                                std::to_string(det));
  return r;
}

bool is_identity(const Affine& a) {
  for (int i = 0; i < 3; ++i) {
    if (a.offset[i] != 0) return false;
    for (int j = 0; j < 3; ++j)
      if (a.linear[std::size_t(i)][j] != (i == j ? 1 : 0)) return false;
  }
  return true;
}

}  // namespace limitray

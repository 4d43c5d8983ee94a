// Stage: scene. Checks of what a caller gives to a scene. Each error names the argument, the rule
// and the value got.
#pragma once

#include <span>
#include <stdexcept>
#include <string>

#include "limitray/scene.h"

namespace limitray {

/// Throws std::invalid_argument unless there are `expected` points, all finite.
void check_points(std::span<const Vec3d> points, std::size_t expected);

/// Throws std::invalid_argument for a level or tolerance out of range.
void check_options(const MeshOptions& options);

/// Deepest level that a tolerance may choose: what the default one costs is limited; who asks for
/// less gets it.
int highest_chosen_level(const MeshOptions& options);

/// Inverse of an affine map. Throws std::invalid_argument if it has none.
Affine inverse(const Affine& a);
bool is_identity(const Affine& a);

/// Throws std::invalid_argument unless the arrays of a batch fit each other.
template <class T>
void check_batch(const RayBatch<T>& rays) {
  const std::size_t n = rays.size();
  if (rays.rays.size() != 6 * n)
    throw std::invalid_argument("rays: must have 6 values a ray, got " +
                                std::to_string(rays.rays.size()) + " values");
  const auto check = [n](std::size_t got, const char* name) {
    if (got != n && got != 1)
      throw std::invalid_argument(std::string(name) + ": must have one value, or one a ray (" +
                                  std::to_string(n) + "), got " + std::to_string(got));
  };
  check(rays.tnear.size(), "tnear");
  check(rays.tfar.size(), "tfar");
}

}  // namespace limitray

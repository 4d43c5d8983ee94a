#include "patch_points.h"

#include <array>

namespace limitray::bench {
namespace {

std::array<double, 4> bernstein_weights(double s) {
  const double r = 1 - s;
  return {r * r * r, 3 * s * r * r, 3 * s * s * r, s * s * s};
}

/// Weights of the four corners' half differences.
std::array<double, 4> bump_weights_at(double s, double t) {
  std::array<double, 4> weights{};
  for (std::size_t k = 0; k < 4; ++k) {
    const double a = k == 1 || k == 2 ? 1 - s : s, b = k >= 2 ? 1 - t : t;
    if (a + b > 0)
      weights[k] = bernstein_weights(a)[1] * bernstein_weights(b)[1] * (a - b) / (a + b);
  }
  return weights;
}

}  // namespace

Vec3d patch_point(const PatchNet<double>& net, const PatchBump<double>* bump, double s, double t) {
  const std::array<double, 4> bs = bernstein_weights(s), bt = bernstein_weights(t);
  Vec3d p{};
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < 16; ++k) p[axis] += bs[k % 4] * bt[k / 4] * net.c[axis][k];
  if (!bump) return p;
  const std::array<double, 4> w = bump_weights_at(s, t);
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < 4; ++k) p[axis] += w[k] * bump->c[axis][k];
  return p;
}

}  // namespace limitray::bench

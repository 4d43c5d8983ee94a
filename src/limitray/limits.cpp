// Stage: scene. See limits.h.
#include "limitray/limits.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace limitray {
namespace {

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  throw std::invalid_argument(text.str());
}

}  // namespace

void check_extent(const ControlCage& cage, std::span<const Vec3d> points) {
  if (cage.face_vertex_indices.empty()) return;
  Vec3d low = points[cage.face_vertex_indices[0]], high = low;
  for (const std::int32_t vertex : cage.face_vertex_indices) {
    for (int axis = 0; axis < 3; ++axis) {
      const double x = points[vertex][axis];
      if (!(std::abs(x) <= largest_coordinate))
        fail("points[", vertex, "][", axis, "]: must be within ", largest_coordinate, " of 0, got ",
             x, "; scale the cage down");
      low[axis] = std::min(low[axis], x);
      high[axis] = std::max(high[axis], x);
    }
  }
  const double extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z}) / 2;
  if (extent > 0 && extent < smallest_extent)
    fail("points: must reach at least ", smallest_extent,
         " from their centre, or be one point, got ", extent, "; scale the cage up");
}

void check_placed(const std::array<Vec3d, 2>& bounds) {
  for (int axis = 0; axis < 3; ++axis) {
    if (bounds[0][axis] > bounds[1][axis]) return;
    const double reach = std::max(std::abs(bounds[0][axis]), std::abs(bounds[1][axis]));
    if (!(reach <= largest_placed_coordinate))
      fail("transform: must keep the surface within ", largest_placed_coordinate, " of 0, got ",
           reach);
  }
}

}  // namespace limitray

// Stage: scene. What sizes a scene can hold, checked before anything is built. Products of four
// lengths and the squares of their errors must fit a float's exponents.
#pragma once

#include <array>
#include <span>

#include "limitray/cage/cage.h"

namespace limitray {

/// Largest |coordinate| of a point that a face uses.
inline constexpr double largest_coordinate = 1e15;
/// Smallest extent (half of the longest side of the box around those points) but 0: a cage whose
/// faces are all in one point is that point.
inline constexpr double smallest_extent = 1e-15;
/// Largest |coordinate| of a surface under its transform.
inline constexpr double largest_placed_coordinate = 1e17;

/// Most threads of a scene: many more than a machine has, fewer than one can start.
inline constexpr int most_threads = 4096;

/// Throws std::invalid_argument unless `points`, as far as faces of `cage` use them, keep the
/// limits above.
void check_extent(const ControlCage& cage, std::span<const Vec3d> points);

/// Throws std::invalid_argument unless `bounds` (lower and upper corner, or inverted for an empty
/// surface) keep the limit above.
void check_placed(const std::array<Vec3d, 2>& bounds);

}  // namespace limitray

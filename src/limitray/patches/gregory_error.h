// Stage: patches (S0). How far Gregory patches are from the true limit surface, and the isolation
// level that keeps that below a tolerance. All other patches are exact.
//
// Measured, not guessed: a few faces at the extraordinary vertices where the cage is roughest, of
// each kind of vertex, are refined on their own and compared with the limit evaluator along its
// normal. The time is that of some hundred evaluations, whatever the size of the cage, and one pass
// over its corners. docs/tolerance.md tells how good the estimate is.
#pragma once

#include "limitray/cage/cage.h"

namespace limitray {

/// Lowest level that is chosen.
inline constexpr int lowest_chosen_level = 2;

struct LevelChoice {
  int isolation_level = lowest_chosen_level;
  double error = 0;  // as gregory_error gives it at that level
};

/// Estimated bound on the distance of the surface at `isolation_level` from the true limit, in
/// units of the longest side of the box around the points that faces use. 0 where no patch is a
/// Gregory patch. `cage` must be valid. Deterministic.
double gregory_error(const ControlCage& cage, int isolation_level);

/// The lowest level from lowest_chosen_level to `highest` with an error of at most `tolerance`;
/// `highest` if none is good enough, which `error` then tells.
LevelChoice choose_level(const ControlCage& cage, double tolerance, int highest);

}  // namespace limitray

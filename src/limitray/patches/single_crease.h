// Stage: patches (S0). A regular patch with one semi-sharp crease edge of uniform sharpness, as
// exact Bezier pieces (Niessner et al. 2012, section 5).
//
// Across the crease the surface is a curve with B-spline coefficients c-1 | c0 c1 c2, c0 on the
// crease, at distance d in [0,1] from it; along the crease it is a plain B-spline. With sharpness
// n + f (n whole, 0 <= f < 1):
//
//   d >= 2^-n                    Q: the curve of the infinitely sharp crease, c-1 = 2 c0 - c1
//   2^-(n+1) <= d <= 2^-n        (1-f) P(n) + f Q
//   d <= 2^-(n+1)                (1-f) P(n) + f P(n+1)
//
// where P(k) is the smooth curve through the coefficients that k steps of infinitely sharp
// subdivision give: the next rule is smooth from then on, and OpenSubdiv blends smooth and sharp
// linearly by f in the one fractional step.
#pragma once

#include <array>
#include <vector>

namespace limitray {

/// Part of a single-crease patch between the distances `begin` and `end` from the crease. Its
/// Bezier coefficients, in the order of growing distance, are `weights` times (c-1, c0, c1, c2).
struct CreasePiece {
  double begin, end;
  std::array<std::array<double, 4>, 4> weights;
};

/// The pieces for a crease of `sharpness` (> 0, finite), nearest first: 3, or 2 when the sharpness
/// is a whole number or below 1.
std::vector<CreasePiece> crease_pieces(double sharpness);

}  // namespace limitray

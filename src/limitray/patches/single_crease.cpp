// Stage: patches (S0). See single_crease.h.
#include "limitray/patches/single_crease.h"

#include <cmath>

#include "limitray/patches/bspline.h"

namespace limitray {
namespace {

using Curve = std::array<double, 4>;

Curve bezier(Curve bspline) {
  bspline_to_six_bezier(bspline.data(), 1);
  for (double& value : bspline) value /= 6;
  return bspline;
}

Curve lerp(const Curve& a, const Curve& b, double f) {
  Curve c;
  for (int i = 0; i < 4; ++i) c[i] = (1 - f) * a[i] + f * b[i];
  return c;
}

struct Halves {
  Curve low, high;
};

/// de Casteljau at x.
Halves split(Curve p, double x) {
  Halves h;
  for (int i = 0; i < 4; ++i) {
    h.low[i] = p[0];
    h.high[3 - i] = p[3 - i];
    for (int j = 0; j < 3 - i; ++j) p[j] += x * (p[j + 1] - p[j]);
  }
  return h;
}

/// The infinitely sharp curve: the crease is a boundary.
Curve sharp_curve(const Curve& c) { return bezier({2 * c[1] - c[2], c[1], c[2], c[3]}); }

/// The smooth curve P(steps), over d in [0, 2^-steps].
Curve smooth_curve(Curve c, int steps) {
  for (int k = 0; k < steps; ++k)
    c = {(c[0] + c[1]) / 2, c[1], (c[1] + c[2]) / 2, (c[1] + 6 * c[2] + c[3]) / 8};
  return bezier(c);
}

/// Bezier coefficients of the pieces, nearest first, for the coefficients `c`.
std::vector<Curve> piece_curves(const Curve& c, int whole, double fraction) {
  const Halves sharp = split(sharp_curve(c), std::ldexp(1.0, -whole));
  const Curve smooth = smooth_curve(c, whole);
  std::vector<Curve> pieces;
  if (fraction > 0) {
    const Halves near_smooth = split(smooth, 0.5), near_sharp = split(sharp.low, 0.5);
    pieces.push_back(lerp(near_smooth.low, smooth_curve(c, whole + 1), fraction));
    pieces.push_back(lerp(near_smooth.high, near_sharp.high, fraction));
  } else {
    pieces.push_back(smooth);
  }
  if (whole > 0) pieces.push_back(sharp.high);
  return pieces;
}

}  // namespace

std::vector<CreasePiece> crease_pieces(double sharpness) {
  const int whole = static_cast<int>(sharpness);
  const double fraction = sharpness - whole;

  std::vector<double> cuts = {0};
  if (fraction > 0) cuts.push_back(std::ldexp(1.0, -whole - 1));
  cuts.push_back(std::ldexp(1.0, -whole));
  if (whole > 0) cuts.push_back(1);

  std::vector<CreasePiece> pieces(cuts.size() - 1);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    pieces[i].begin = cuts[i];
    pieces[i].end = cuts[i + 1];
  }
  for (int column = 0; column < 4; ++column) {
    Curve unit{};
    unit[column] = 1;
    const std::vector<Curve> curves = piece_curves(unit, whole, fraction);
    for (std::size_t i = 0; i < pieces.size(); ++i)
      for (int row = 0; row < 4; ++row) pieces[i].weights[row][column] = curves[i][row];
  }
  return pieces;
}

}  // namespace limitray

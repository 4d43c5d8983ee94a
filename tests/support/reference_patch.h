// Truth for the kernel tests: patches in long double by the textbook formulae (de Casteljau,
// Gregory's rational blend of f+ and f-), sharing no code with src/limitray but the storage of a
// patch.
#pragma once

#include <cmath>

#include "limitray/patches/patch_buffer.h"

namespace limitray::test {

using Real = long double;
/// Where long double is done in software (64-bit Arm), tests take a tenth of their rounds.
inline constexpr int rounds_divisor = __LDBL_MANT_DIG__ > 64 ? 10 : 1;

/// A patch in double, as the refiner hands it out; `bump` counts if `gregory`.
struct Patch {
  PatchNet<double> net{};
  PatchBump<double> bump{};
  bool gregory = false;

  const PatchBump<double>* bump_or_null() const { return gregory ? &bump : nullptr; }
};

/// `p` rounded once to T.
template <class T>
struct RoundedPatch {
  PatchNet<T> net;
  PatchBump<T> bump;
  bool gregory;

  explicit RoundedPatch(const Patch& p) : gregory(p.gregory) {
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 16; ++i) net.c[c][i] = T(p.net.c[c][i]);
      for (int k = 0; k < 4; ++k) bump.c[c][k] = T(p.bump.c[c][k]);
    }
  }
  const PatchBump<T>* bump_or_null() const { return gregory ? &bump : nullptr; }
};

/// Cubic at x by de Casteljau.
inline Real casteljau(Real p0, Real p1, Real p2, Real p3, Real x) {
  const Real y = 1 - x;
  const Real a = y * p0 + x * p1, b = y * p1 + x * p2, c = y * p2 + x * p3;
  const Real d = y * a + x * b, e = y * b + x * c;
  return y * d + x * e;
}

/// One component of a patch at (s,t): Gregory's interior points are blended from the pairs f+, f-.
/// `net` and `bump` may be values of any type; bump may be null.
template <class T>
Real reference_component(const T* net, const T* bump, Real s, Real t) {
  Real p[16];
  for (int i = 0; i < 16; ++i) p[i] = Real(net[i]);
  if (bump) {
    const Real a[4] = {s, t, 1 - s, 1 - t};  // weights of the first point: s, t, 1-s, 1-t
    const Real b[4] = {t, 1 - s, 1 - t, s};
    for (int k = 0; k < 4; ++k) {
      const Real sign = k % 2 == 0 ? 1 : -1;
      const Real f_p = p[interior_index[k]] + sign * Real(bump[k]);
      const Real f_m = p[interior_index[k]] - sign * Real(bump[k]);
      const Real sum = a[k] + b[k];
      if (sum > 0) p[interior_index[k]] = (a[k] * f_p + b[k] * f_m) / sum;
    }
  }
  Real row[4];
  for (int j = 0; j < 4; ++j)
    row[j] = casteljau(p[4 * j], p[4 * j + 1], p[4 * j + 2], p[4 * j + 3], s);
  return casteljau(row[0], row[1], row[2], row[3], t);
}

inline Vec3<Real> reference_point(const Patch& p, Real s, Real t) {
  Vec3<Real> r;
  for (int c = 0; c < 3; ++c)
    r[c] = reference_component(p.net.c[c], p.gregory ? p.bump.c[c] : nullptr, s, t);
  return r;
}

/// Largest |control value|, both points of each Gregory pair included, as the refiner reports it.
inline double radius_of(const Patch& p) {
  double r = 0;
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 16; ++i) r = std::max(r, std::abs(p.net.c[c][i]));
    for (int k = 0; k < 4 && p.gregory; ++k)
      r = std::max(r, std::abs(p.net.c[c][interior_index[k]]) + std::abs(p.bump.c[c][k]));
  }
  return r;
}

}  // namespace limitray::test

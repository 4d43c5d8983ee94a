// Stage: patches (S0). The 20 points of a Gregory patch to a Bezier net and its bump.
//
// OpenSubdiv's order, five a corner k: P = 5k, e+ = 5k+1, e- = 5k+2, f+ = 5k+3, f- = 5k+4.
//
//   t ^   P3 --- e3- --- e2+ --- P2        15   17   11   10
//     |    |   f3-         f2+   |              19   13
//     |   e3+  f3+         f2-  e2-        16   18   14   12
//     |    |   f0-         f1+   |               4    8
//     |   e0-  f0+         f1-  e1+         2    3    9    6
//     |    |                     |
//     |   P0 --- e0+ --- e1- --- P1         0    1    7    5
//     +----------------------------> s
//
// (Loop, Schaefer, Ni, Castano 2009, "Approximating Subdivision Surfaces with Gregory Patches for
// Hardware Tessellation"; the points themselves are OpenSubdiv's, not that paper's.)
#pragma once

#include "limitray/math/isa.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// One component, or a vector of them: `p` are the 20 control values, `net` and `bump` as in
/// patch_buffer.h.
template <class V>
[[gnu::always_inline]] inline void gregory_to_net(const V (&p)[20], V (&net)[16], V (&bump)[4]) {
  constexpr int boundary[16] = {0, 1, 7, 5, 2, -1, -1, 6, 16, -1, -1, 12, 15, 17, 11, 10};
  for (int i = 0; i < 16; ++i)
    if (boundary[i] >= 0) net[i] = p[boundary[i]];

  constexpr int interior[4] = {5, 6, 10, 9};
  for (int k = 0; k < 4; ++k) {
    const V f_p = p[5 * k + 3], f_m = p[5 * k + 4];
    net[interior[k]] = 0.5 * (f_p + f_m);
    bump[k] = 0.5 * (k % 2 == 0 ? f_p - f_m : f_m - f_p);
  }
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

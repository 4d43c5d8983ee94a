// Stage: intersection, S3 and S5. Where the bisection stands, without a stack: a dyadic subdomain
// and two bit trails (Binder and Keller 2015, section 2).
//
// u and v are split in turn, u first. Level l of a direction holds index i: the interval
// [i, i+1] * 2^-l. Each split shifts one bit into that direction's trail: 1 if both children were
// hit, so that a sibling is left to visit, else 0. Bit 0 of a trail belongs to the last split.
//
//   levels   u: 3  v: 2     trail u: 0 1 0     trail v: 1 0
//   order of splits         u0 v0 u1 v1 u2     (u2 is the last)
//   pending siblings           v0 u1           the next subdomain is the sibling at u1: go up one
//                                              level in u and one in v, flip the last bit of index
//                                              u
#pragma once

#include <bit>
#include <cstdint>

#include "limitray/math/isa.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// `Bits` has at least as many bits as there are levels a direction.
template <class Bits>
struct Domain {
  Bits index_u = 0, index_v = 0;
  Bits trail_u = 0, trail_v = 0;
  int level_u = 0, level_v = 0;

  /// The next split is across u (else across v).
  bool splits_u() const { return level_u == level_v; }

  /// S3: go down to child 0 or 1; `both` if the other one is left to visit.
  void descend(bool child, bool both) {
    if (splits_u()) {
      index_u = index_u << 1 | Bits(child);
      trail_u = trail_u << 1 | Bits(both);
      ++level_u;
    } else {
      index_v = index_v << 1 | Bits(child);
      trail_v = trail_v << 1 | Bits(both);
      ++level_v;
    }
  }

  /// S5: go to the sibling left last. False if none is left.
  bool next() {
    if ((trail_u | trail_v) == 0) return false;
    // Levels to go up in each direction to reach the last pending split, were it the only one.
    const int up_u = std::countr_zero(trail_u), up_v = std::countr_zero(trail_v);
    // The split that ends level l of u is number 2l-1, of v number 2l: the later one is next.
    const int split_u = trail_u ? 2 * (level_u - up_u) - 1 : 0;
    const int split_v = trail_v ? 2 * (level_v - up_v) : 0;
    const int split = split_u > split_v ? split_u : split_v;
    const int new_u = (split + 1) / 2, new_v = split / 2;
    index_u >>= level_u - new_u, trail_u >>= level_u - new_u;
    index_v >>= level_v - new_v, trail_v >>= level_v - new_v;
    level_u = new_u, level_v = new_v;
    // The sibling: flip the index's last bit, clear the trail's.
    const Bits in_u = Bits(split & 1), in_v = Bits(~split & 1);
    index_u ^= in_u, trail_u ^= in_u;
    index_v ^= in_v, trail_v ^= in_v;
    return true;
  }
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

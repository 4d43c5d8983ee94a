// Stage: intersection, S3 and S5. Where the bisection stands, without a stack: a dyadic subdomain
// and two bit trails (after Binder and Keller 2015, section 2).
//
// Level l of a direction holds index i: the interval [i, i+1] * 2^-l. Each split shifts one bit
// into both trails; bit 0 belongs to the last split:
//
//   pending   1 if both children were hit, so that a sibling is left to visit
//   turns     1 if the split was across u, 0 if across v
//
//   splits    u v u v u     pending 0 1 1 0 0     turns 1 0 1 0 1
//
//   The last pending split is two splits up, across u. One split across u and one across v are
//   taken back; the last bit of index u is flipped: that is the next subdomain.
//
// Ours differs from the talk in that any split may go either way, not u and v in turn: there one
// trail holds the pending bits of u, the other one those of v.
#pragma once

#include <bit>
#include <cstdint>

#include "limitray/math/isa.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

__extension__ using TrailOf128 = unsigned __int128;

inline int trailing_zeros(std::uint64_t x) { return std::countr_zero(x); }
inline int trailing_zeros(TrailOf128 x) {
  const auto low = std::uint64_t(x);
  return low ? std::countr_zero(low) : 64 + std::countr_zero(std::uint64_t(x >> 64));
}
inline int count_ones(std::uint64_t x) { return std::popcount(x); }
inline int count_ones(TrailOf128 x) {
  return std::popcount(std::uint64_t(x)) + std::popcount(std::uint64_t(x >> 64));
}

/// `Index` has at least as many bits as there are levels a direction, `Trail` more than twice as
/// many.
template <class Index, class Trail>
struct Domain {
  Index index_u = 0, index_v = 0;
  int level_u = 0, level_v = 0;
  Trail pending = 0, turns = 0;

  int splits() const { return level_u + level_v; }

  /// S3: go down to child 0 or 1 of a split; `both` if the other one is left to visit.
  void descend(bool across_u, bool child, bool both) {
    index_u = index_u << across_u | Index(across_u && child);
    index_v = index_v << !across_u | Index(!across_u && child);
    level_u += across_u, level_v += !across_u;
    turns = turns << 1 | Trail(across_u);
    pending = pending << 1 | Trail(both);
  }

  /// S5: go to the sibling left last. False if none is left.
  bool next() {
    if (pending == 0) return false;
    const int up = trailing_zeros(pending);
    const int up_u = count_ones(Trail(turns & ((Trail(1) << up) - 1))), up_v = up - up_u;
    index_u >>= up_u, level_u -= up_u;
    index_v >>= up_v, level_v -= up_v;
    pending >>= up, turns >>= up;
    // The sibling: flip the index's last bit, clear the trail's.
    const Index across_u = Index(turns & 1);
    index_u ^= across_u;
    index_v ^= across_u ^ 1;
    pending ^= 1;
    return true;
  }
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

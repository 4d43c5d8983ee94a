// Stage: intersection, S4. Comes in: subpatches that the bisection cannot tell from a hit. Goes
// out: one hit for all that touch in depth, with the depth that they span.
//
// Near a silhouette the ray runs along the surface: the bounds cannot tell where in a stretch of
// depth of about sqrt(eps) it enters. All subpatches of that stretch are one hit, and its span is
// part of the bound on t. The bisection visits them in the order of growing siblings, so that each
// is about as large as all that was taken before: whatever does not widen the span more than
// twofold is taken whole, and the number of splits stays logarithmic.
#pragma once

#include "limitray/intersect/newton.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

template <class T>
class DepthCluster {
 public:
  bool is_open() const { return lo_ <= hi_; }

  /// Takes `s` in, if it touches what is there and either is a point or adds no more than there is.
  bool absorb(const SubPatch<T>& s, bool is_point) {
    const T lo = min_value(s.z) - s.dz, hi = max_value(s.z) + s.dz;
    const bool touches = is_open() && lo <= hi_ && hi >= lo_;
    if (!touches || !(is_point || hi - lo <= hi_ - lo_)) return false;
    lo_ = std::min(lo_, lo), hi_ = std::max(hi_, hi);
    return true;
  }
  /// Begins with the point `s`; `root` stands for the whole cluster.
  void start(const PatchRoot<T>& root, const SubPatch<T>& s) {
    root_ = root;
    lo_ = min_value(s.z) - s.dz, hi_ = max_value(s.z) + s.dz;
  }
  /// Hands the cluster to `on_hit`, if there is one, and closes it.
  template <class OnHit>
  bool report(OnHit&& on_hit, T& zmax) {
    if (!is_open()) return false;
    root_.spread = std::max(hi_ - root_.z, root_.z - lo_);
    lo_ = 1, hi_ = 0;
    return on_hit(root_, zmax);
  }

 private:
  PatchRoot<T> root_{};
  T lo_ = 1, hi_ = 0;  // empty
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

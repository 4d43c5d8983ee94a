// Points of a refined surface by their place on the cage: all patches that meet there.
#pragma once

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "limitray/patches/patch_buffer.h"
#include "reference_patch.h"

namespace limitray::test {

/// A place on a cage: (u,v) of a face, or of the sub-quad of an n-gon.
struct Place {
  std::int32_t face, sub_quad;
  double u, v;
};

struct PatchPoint {
  std::size_t patch;
  Vec3d point;
  bool gregory;
};

class PatchSampler {
 public:
  explicit PatchSampler(PatchBuffer<double> patches) : patches_(std::move(patches)) {
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const PatchInfo& info = patches_.infos[i];
      quads_[{static_cast<std::int32_t>(info.face), info.sub_quad}].push_back(i);
    }
  }

  const PatchBuffer<double>& patches() const { return patches_; }
  /// Patches of each (face, sub-quad) that has a surface.
  const std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>>& quads() const {
    return quads_;
  }

  Vec3d point(std::size_t patch, double s, double t) const {
    const PatchInfo& info = patches_.infos[patch];
    Patch p{patches_.nets[patch], {}, info.bump != no_bump};
    if (p.gregory) p.bump = patches_.bumps[info.bump];
    return patches_.origin + static_cast<Vec3d>(reference_point(p, s, t));
  }

  /// The surface at `place` by each patch whose closed rectangle contains it.
  std::vector<PatchPoint> at(const Place& place) const {
    std::vector<PatchPoint> points;
    const auto quad = quads_.find({place.face, place.sub_quad});
    if (quad == quads_.end()) return points;
    for (const std::size_t i : quad->second) {
      const PatchInfo& info = patches_.infos[i];
      const double s = (place.u - info.u0) / info.du, t = (place.v - info.v0) / info.dv;
      constexpr double slack = 1e-12;  // of places computed from another patch's parameters
      if (std::min(s, t) < -slack || std::max(s, t) > 1 + slack) continue;
      points.push_back(
          {i, point(i, std::clamp(s, 0.0, 1.0), std::clamp(t, 0.0, 1.0)), info.bump != no_bump});
    }
    return points;
  }

 private:
  PatchBuffer<double> patches_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>> quads_;
};

}  // namespace limitray::test

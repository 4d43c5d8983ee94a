// Points of a refined surface to aim rays at: patch corners, patch edges, places where patches of
// other levels may end, cage edges (creases among them), cage vertices (extraordinary ones among
// them), the interior. Computed in double by sums over Bernstein weights, not by the tracer.
#pragma once

#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "limitray/cage/cage.h"
#include "limitray/patches/refine.h"

namespace limitray::test {

/// Uniform in [0,1): std::uniform_real_distribution costs more than tracing a ray.
template <class Generator>
double unit_random(Generator& g) {
  return double(g() >> 11) * 0x1p-53;
}

/// Whether each edge of `cage` has two faces that wind in opposite directions, and no face is a
/// hole.
inline bool is_closed(const ControlCage& cage) {
  std::map<std::pair<int, int>, int> directed;
  std::size_t begin = 0;
  for (const std::int32_t count : cage.face_vertex_counts) {
    for (std::int32_t i = 0; i < count; ++i)
      ++directed[{cage.face_vertex_indices[begin + std::size_t(i)],
                  cage.face_vertex_indices[begin + std::size_t((i + 1) % count)]}];
    begin += std::size_t(count);
  }
  for (const auto& [edge, uses] : directed) {
    const auto back = directed.find({edge.second, edge.first});
    if (uses != 1 || back == directed.end()) return false;
  }
  return !directed.empty() && cage.hole_indices.empty();
}

enum class TargetKind { patch_corner, patch_edge, t_junction, cage_edge, cage_vertex, interior };
inline constexpr int target_kinds = 6;
inline const char* name_of(TargetKind k) {
  constexpr const char* names[] = {"patch corner", "patch edge",  "T-junction",
                                   "cage edge",    "cage vertex", "interior"};
  return names[int(k)];
}

struct Target {
  Vec3d point, normal;  // normal p_s x p_t of the patch, unit or 0
  bool smooth;          // inside a face of the cage, so that no crease passes through it
};

class SurfaceTargets {
 public:
  explicit SurfaceTargets(PatchBuffer<double> patches) : patches_(std::move(patches)) {
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const PatchInfo& p = patches_.infos[i];
      const bool ends[4] = {p.u0 == 0, p.u0 + p.du == 1, p.v0 == 0, p.v0 + p.dv == 1};
      for (int side = 0; side < 4; ++side)
        if (ends[side]) cage_edges_.push_back({i, side});
      for (int corner = 0; corner < 4; ++corner)
        if (ends[corner & 1] && ends[2 + (corner >> 1)]) cage_corners_.push_back({i, corner});
    }
  }

  const PatchBuffer<double>& patches() const { return patches_; }

  template <class Generator>
  Target pick(TargetKind kind, Generator& g) const {
    std::size_t patch = g() % patches_.size();
    const double x = unit_random(g);
    const double dyadic = double(g() % 17) / 16;
    int side = int(g() % 4), corner = int(g() % 4);
    switch (kind) {
      case TargetKind::patch_corner:
        return at_corner(patch, corner);
      case TargetKind::patch_edge:
        return on_side(patch, side, x);
      case TargetKind::t_junction:
        return on_side(patch, side, dyadic);
      case TargetKind::cage_edge: {
        const auto& e = cage_edges_[g() % cage_edges_.size()];
        return on_side(e.first, e.second, x);
      }
      case TargetKind::cage_vertex: {
        const auto& c = cage_corners_[g() % cage_corners_.size()];
        return at_corner(c.first, c.second);
      }
      case TargetKind::interior:
        break;
    }
    return at(patch, x, unit_random(g));
  }

  /// The surface of patch i at (s,t).
  Target at(std::size_t i, double s, double t) const {
    const PatchInfo& info = patches_.infos[i];
    const double u = info.u0 + s * info.du, v = info.v0 + t * info.dv;
    double bs[4], ds[4], bt[4], dt[4];
    weights(s, bs, ds), weights(t, bt, dt);
    Vec3d p{}, p_s{}, p_t{};
    for (int c = 0; c < 3; ++c) {
      double net[16];
      blended_net(i, c, s, t, net);
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          p[c] += net[4 * j + k] * bs[k] * bt[j];
          p_s[c] += net[4 * j + k] * ds[k] * bt[j];
          p_t[c] += net[4 * j + k] * bs[k] * dt[j];
        }
    }
    const Vec3d n = cross(p_s, p_t);
    const double l = length(n);
    return {p + patches_.origin, l > 0 ? (1 / l) * n : Vec3d{}, u > 0 && u < 1 && v > 0 && v < 1};
  }

 private:
  Target on_side(std::size_t i, int side, double x) const {
    const double end = side & 1;
    return side < 2 ? at(i, end, x) : at(i, x, end);
  }
  Target at_corner(std::size_t i, int corner) const { return at(i, corner & 1, corner >> 1); }

  static void weights(double x, double (&b)[4], double (&d)[4]) {
    const double y = 1 - x;
    b[0] = y * y * y, b[1] = 3 * x * y * y, b[2] = 3 * x * x * y, b[3] = x * x * x;
    d[0] = -3 * y * y, d[1] = 3 * y * (y - 2 * x), d[2] = 3 * x * (2 * y - x), d[3] = 3 * x * x;
  }
  /// The net with Gregory's interior points at (s,t); their derivative is left out of the normal.
  void blended_net(std::size_t i, int c, double s, double t, double (&net)[16]) const {
    for (int k = 0; k < 16; ++k) net[k] = patches_.nets[i].c[c][k];
    const std::uint32_t b = patches_.infos[i].bump;
    if (b == no_bump) return;
    const double a[4] = {s, 1 - s, 1 - s, s}, d[4] = {t, t, 1 - t, 1 - t};
    for (int k = 0; k < 4; ++k)
      if (a[k] + d[k] > 0)
        net[interior_index[k]] += patches_.bumps[b].c[c][k] * (a[k] - d[k]) / (a[k] + d[k]);
  }

  PatchBuffer<double> patches_;
  std::vector<std::pair<std::size_t, int>> cage_edges_, cage_corners_;
};

}  // namespace limitray::test

// Stage: patches. Comes in: a refined cage. Goes out: the only surface data the tracer reads.
//
// A patch is a bicubic Bezier net of 16 control values a component, and, where the surface is
// irregular, a Gregory "bump" of 4 values a component. With s, t in [0,1] the patch parameters,
//
//   S(s,t) = sum_ij B_i(s) B_j(t) net[j*4+i]  +  sum_k b_k (a-b)/(a+b) bump[k],
//
// where corner k is 0 (0,0), 1 (1,0), 2 (1,1), 3 (0,1); a and b are the distances of s and t from
// that corner (a = s or 1-s, b = t or 1-t) and b_k is the Bernstein weight of the interior point
// beside it. The interior point of the net is the mean of the Gregory pair, bump[k] half of the
// pair's difference: (f+ - f-)/2 at corners 0 and 2, (f- - f+)/2 at corners 1 and 3, so that the
// sign is the same at each corner. At a = b = 0 the term is 0 (its Bernstein weight is).
//
// Order of the net: component-major, then rows of t, then columns of s:
//
//   t ^  12 13 14 15        interior points beside corner 0, 1, 2, 3: index 5, 6, 10, 9
//     |   8  9 10 11
//     |   4  5  6  7
//     |   0  1  2  3
//     +-------------> s
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "limitray/math/vec.h"

namespace limitray {

inline constexpr std::uint32_t no_bump = 0xFFFFFFFFu;
inline constexpr std::uint32_t invalid_id = 0xFFFFFFFFu;
/// Index in the net of the interior point beside corner k.
inline constexpr int interior_index[4] = {5, 6, 10, 9};

/// Where a patch lies on the cage. (u,v) of the base face (of sub-quad `sub_quad` if the face is
/// no quad) are u0 + s*du, v0 + t*dv.
struct PatchInfo {
  std::uint32_t face = invalid_id;  // base face
  std::uint16_t sub_quad = 0;       // corner of the n-gon; 0 for quads
  std::uint16_t level = 0;          // depth of refinement, for statistics and pictures
  std::uint32_t bump = no_bump;     // index into PatchBuffer::bumps, no_bump for a Bezier patch
  float u0 = 0, v0 = 0, du = 1, dv = 1;
};
static_assert(sizeof(PatchInfo) == 28);

/// Control values of one patch: [component][index].
template <class T>
struct alignas(64) PatchNet {
  T c[3][16];
};
/// Half differences of the four Gregory pairs: [component][corner].
template <class T>
struct alignas(16) PatchBump {
  T c[3][4];
};

/// A bound >= 0 in half of T's bits, rounded up: the upper half of a float's bits, or a float.
template <class T>
class HalfBound {
 public:
  HalfBound() = default;
  explicit HalfBound(float bound)
      : bits_(std::uint16_t((std::bit_cast<std::uint32_t>(bound) + 0xFFFFu) >> 16)) {}
  float value() const { return std::bit_cast<float>(std::uint32_t(bits_) << 16); }

 private:
  std::uint16_t bits_ = 0;
};
template <>
class HalfBound<double> {
 public:
  HalfBound() = default;
  explicit HalfBound(double bound)
      : bound_(std::nextafter(float(bound), std::numeric_limits<float>::infinity())) {}
  double value() const { return double(bound_); }

 private:
  float bound_ = 0;
};

/// First order model of a patch about its middle (1/2,1/2), and how far the patch is from it: what
/// a ray reads first (S8), one cache line. Made by patches/patch_model.h.
template <class T>
struct alignas(16 * sizeof(T)) PatchModel {
  struct Axis {
    T p, p_u, p_v;          // value and derivatives at the middle
    HalfBound<T> d_u, d_v;  // bound on |derivative - p_u|, |derivative - p_v| anywhere on the patch
  } axis[3];
  T below, above;  // N . (S - p) of the patch is between them, N = p_u x p_v
  T unused = 0;
  T curvature;  // bound on |p_uu|/2 + |p_uv| + |p_vv|/2 of each component
};
static_assert(sizeof(PatchModel<float>) == 64 && sizeof(PatchModel<double>) == 128);

/// The box around a patch, but for rounding. Made by bvh/bounds.h.
template <class T>
struct PatchHull {
  T lo[3], hi[3];
};

/// All patches of a mesh, relative to `origin` (the centre of the cage's extent), so that float
/// rounding scales with the size of the cage and not with its distance from zero.
template <class T>
struct PatchBuffer {
  std::vector<PatchNet<T>> nets;
  std::vector<PatchBump<T>> bumps;
  std::vector<PatchInfo> infos;       // one a net
  std::vector<PatchModel<T>> models;  // one a net once the tracer has made them, else empty
  Vec3d origin{};
  double radius = 0;  // largest |control value| of any component, relative to origin

  std::size_t size() const { return nets.size(); }
  std::size_t bytes() const {
    return nets.size() * sizeof(PatchNet<T>) + bumps.size() * sizeof(PatchBump<T>) +
           infos.size() * sizeof(PatchInfo) + models.size() * sizeof(PatchModel<T>);
  }
};

}  // namespace limitray

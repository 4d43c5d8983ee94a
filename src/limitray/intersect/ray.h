// Stage: intersection, S1. Comes in: a ray in double, in the space of a mesh. Goes out: the frame
// in which patches are met: the ray is the z axis, its origin is near the patches.
//
// After Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection": translate, then shear by
// the dominant axis of the direction. Ours differs in two points. The origin is first moved along
// the ray (in double) into the box of the mesh, so that float rounding scales with the mesh and not
// with the distance of the viewer; a ray that misses the box ends there. And depth is measured
// along the dominant axis, not in units of the direction: no direction is too short or too long.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "limitray/math/lanes.h"
#include "limitray/math/vec.h"

namespace limitray {

/// A ray p(t) = org + t dir, tnear < t <= tfar, in the space of a mesh.
struct ObjectRay {
  Vec3d org, dir;
  double tnear = 0, tfar = std::numeric_limits<double>::infinity();
};

inline namespace LIMITRAY_ISA {

/// Unit roundoff: half of the gap above 1.
template <class T>
inline constexpr T unit_roundoff = std::numeric_limits<T>::epsilon() / 2;

/// z at t, moved to one side by the rounding on the way, that of t itself to T included.
template <class T, class V>
V outward(V t, double side, V t_origin, V z_scale) {
  const V z = (t - t_origin) * z_scale;
  const V rounding = (4 * double(unit_roundoff<T>)) * (abs(z) + abs(t) * z_scale);
  // No surface is that far out (limits.h), and boxes of children that are absent are.
  const V limit = V{} + double(std::numeric_limits<float>::max()) / 2;
  return min(max(V(z + side * rounding), V(-limit)), limit);
}

/// Depth along a ray in its frame, and t.
template <class T>
struct RayDepth {
  double t_origin, t_scale, z_scale;  // t = t_origin + z t_scale, z = (t - t_origin) z_scale
  T eps_z;                            // bound on the rounding of z of a stored control value

  double t_of(double z) const { return t_origin + z * t_scale; }
  /// z at t, moved outward by the rounding on the way, that of t itself to T included.
  T z_above(double t) const { return T(outward<T>(t, 1, t_origin, z_scale)) + eps_z; }
  T z_below(double t) const { return T(outward<T>(t, -1, t_origin, z_scale)) - eps_z; }
};

template <class T>
struct PatchRay : RayDepth<T> {
  T org[3];  // the moved origin, relative to the centre of the mesh, by axis
  T dir[3];  // the direction, scaled so that its dominant component is +1 or -1
  int axis_x, axis_y, axis_z;
  T org_x, org_y, org_z;  // org in the order of these axes
  T shear_x, shear_y;     // x = X + shear_x Z, y = Y + shear_y Z, with X, Y, Z relative to org
  T sign_z;               // z = sign_z Z grows along the ray
  T zmin, zmax;           // interval of z, widened by all rounding
  T z_start;              // a z above it is reported as a t > tnear
  T eps;                  // bound on the rounding of x and y of a stored control value

  /// The frame for the dominant axis z, from org and dir.
  void set_axes(int z) {
    axis_z = z;
    axis_x = z == 2 ? 0 : z + 1;
    axis_y = axis_x == 2 ? 0 : axis_x + 1;
    org_x = org[axis_x], org_y = org[axis_y], org_z = org[axis_z];
    sign_z = dir[axis_z] > 0 ? T(1) : T(-1);
    shear_x = -sign_z * dir[axis_x], shear_y = -sign_z * dir[axis_y];
  }
};

/// x as a float, never below it.
inline float float_up(float x) { return x; }
inline float float_up(double x) {
  const float f = x > double(std::numeric_limits<float>::max())
                      ? std::numeric_limits<float>::infinity()
                      : float(std::max(x, -double(std::numeric_limits<float>::max())));
  return double(f) < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

/// Where a mesh is: the centre its control values are relative to, half of the size by axis of the
/// box that contains it (about that centre, padded), and R: no control value or box is farther out.
struct Extent {
  Vec3d center, half;
  double radius;
};

/// S1 for the mesh in `extent`, in double: for one ray, or for several side by side (V a vector,
/// see math/lanes.h). `meets` is false if a ray cannot meet the mesh, is not finite or has no
/// direction; then the rest says nothing.
///
/// Rounding (docs/accuracy.md, section 1). Let R = radius, u the unit roundoff of T. The moved
/// origin is in the extent, so a control value is off by u R, org by u R, and both are at most D =
/// 2 R apart. The subtraction adds u D for each of X and Z; the shear factor (|shear| <= 1) is off
/// by 2 u, its product by u more, and the sum is at most 2 D. Together |error of x| <= 4u R + 2u D
/// + 3u D + 2u D = 18 u R, first order. The middle of a patch's model is off by 6 u R more in X and
/// in Z: 30 u R; 32 u R covers the higher orders. The move in double adds 8 roundings of the way,
/// the patches as the refiner computes them (within 5 roundings of R in double) 16 more of R:
/// eps_double.
template <class V, class T>
struct RayFrame {
  MaskOf<V> meets;
  MaskOf<V> z_is_1, z_is_2;  // the dominant axis; 0 if neither
  V moved[3], n[3];          // PatchRay's org and dir
  V t_origin, t_scale, z_scale, eps, eps_z;
  V from, to, start;  // zmin, zmax without eps_z, and z_start

  RayFrame(const V (&org)[3], const V (&dir)[3], V tnear, V tfar, const Extent& extent) {
    V o[3], ad[3];
    for (int i = 0; i < 3; ++i) o[i] = org[i] - extent.center[i], ad[i] = abs(dir[i]);
    z_is_1 = ad[1] > ad[0];
    z_scale = max(ad[0], ad[1]);
    z_is_2 = ad[2] > z_scale;
    z_is_1 &= (z_is_2 == (V{} < V{}));
    z_scale = max(ad[2], z_scale);

    // The slabs of the extent, in z. Where the direction is 0, its planes are at +-huge (or at 0 on
    // the border, which is padding only). What is not finite stays so.
    const V huge = V{} + 1e200;
    V entry = -huge, exit = huge, finite = V{};
    for (int i = 0; i < 3; ++i) {
      const V inverse = min(huge, max(V(-huge), V(z_scale / dir[i])));
      const V a = (-extent.half[i] - o[i]) * inverse, b = (extent.half[i] - o[i]) * inverse;
      const V lo = min(a, b);
      entry = max(entry, lo), exit = min(exit, max(a, b));
      finite += lo;
    }
    meets = (finite * 0.0 == 0.0) & (z_scale > 1e-290) & (entry <= exit) &
            (exit >= tnear * z_scale) & (entry <= tfar * z_scale) & (tnear < tfar);

    t_scale = 1.0 / z_scale;
    const V s = min(max(V{}, entry), exit);
    for (int i = 0; i < 3; ++i) n[i] = t_scale * dir[i], moved[i] = o[i] + s * n[i];
    const V far = max(max(V(abs(o[0])), V(abs(o[1]))), V(abs(o[2]))) + abs(s);
    const V eps_double = unit_roundoff<double> * (8.0 * far + 16 * extent.radius);
    const double u_radius = double(unit_roundoff<T>) * extent.radius;
    eps = (32 * u_radius + eps_double) * (1 + 1e-6);
    eps_z = (8 * u_radius + eps_double) * (1 + 1e-6);
    t_origin = s * t_scale;
    from = outward<T>(tnear, -1, t_origin, z_scale);
    start = outward<T>(tnear, 1, t_origin, z_scale);
    to = outward<T>(tfar, 1, t_origin, z_scale);
  }
  /// Rounds the frame of one of the rays.
  void store(int lane, PatchRay<T>& r) const {
    const auto at = [lane](const auto& v) { return lane_of(v, lane); };
    for (int i = 0; i < 3; ++i) r.org[i] = T(at(moved[i])), r.dir[i] = T(at(n[i]));
    r.t_origin = at(t_origin), r.t_scale = at(t_scale), r.z_scale = at(z_scale);
    r.eps = T(at(eps)), r.eps_z = T(at(eps_z));
    r.zmin = T(at(from)) - r.eps_z, r.z_start = T(at(start)), r.zmax = T(at(to)) + r.eps_z;
    r.set_axes(at(z_is_2) ? 2 : at(z_is_1) != 0);
  }
};

/// S1 for one ray. Returns RayFrame::meets.
template <class T>
[[gnu::always_inline]] inline bool make_patch_ray(const ObjectRay& ray, const Extent& extent,
                                                  PatchRay<T>& r) {
  const double org[3] = {ray.org.x, ray.org.y, ray.org.z};
  const double dir[3] = {ray.dir.x, ray.dir.y, ray.dir.z};
  const RayFrame<double, T> f(org, dir, ray.tnear, ray.tfar, extent);
  if (!f.meets) return false;
  f.store(0, r);
  return true;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

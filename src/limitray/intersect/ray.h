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

#include "limitray/math/net.h"
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

template <class T>
struct PatchRay {
  T org[3];  // the moved origin, relative to the centre of the mesh, by axis
  T dir[3];  // the direction, scaled so that its dominant component is +1 or -1
  int axis_x, axis_y, axis_z;
  T org_x, org_y, org_z;  // org in the order of these axes
  T shear_x, shear_y;     // x = X + shear_x Z, y = Y + shear_y Z, with X, Y, Z relative to org
  T sign_z;               // z = sign_z Z grows along the ray
  T zmin, zmax;           // interval of z, widened by all rounding
  T z_start;              // a z above it is reported as a t > tnear
  T eps;                  // bound on the rounding of x and y of a stored control value
  T eps_z;                // the same for z
  double t_origin, t_scale, z_scale;  // t = t_origin + z t_scale, z = (t - t_origin) z_scale

  double t_of(double z) const { return t_origin + z * t_scale; }
  /// z at t, moved outward by the rounding on the way, that of t itself to T included.
  T z_above(double t) const { return outward(t, 1) + eps_z; }
  T z_below(double t) const { return outward(t, -1) - eps_z; }
  /// The same without that of the surface.
  T outward(double t, double side) const {
    const double z = (t - t_origin) * z_scale;
    const double rounding = 4 * double(unit_roundoff<T>) * (std::abs(z) + std::abs(t) * z_scale);
    const double limit = double(std::numeric_limits<T>::max()) / 2;
    return T(std::min(std::max(z + side * rounding, -limit), limit));
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

/// S1 for the mesh in `extent`. Returns false if the ray cannot meet it, is not finite or has no
/// direction.
///
/// Rounding (docs/accuracy.md, section 1). Let R = radius, u the unit roundoff. The moved origin is
/// in the extent, so a control value is off by u R, org by u R, and both are at most D = 2 R apart.
/// The subtraction adds u D for each of X and Z; the shear factor (|shear| <= 1) is off by 2 u, its
/// product by u more, and the sum is at most 2 D. Together |error of x| <= 4u R + 2u D + 3u D + 2u
/// D = 18 u R, first order. The middle of a patch's model is off by 6 u R more in X and in Z: 30 u
/// R; 32 u R covers the higher orders. The move in double adds 8 roundings of the way, the patches
/// as the refiner computes them (within 5 roundings of R in double) 16 more of R: eps_double.
template <class T>
[[gnu::always_inline]] inline bool make_patch_ray(const ObjectRay& ray, const Extent& extent,
                                                  PatchRay<T>& r) {
  using V = Quad<double>;
  const Vec3d& c = extent.center;
  const V o = V{ray.org.x, ray.org.y, ray.org.z, 0} - V{c.x, c.y, c.z, 0};
  const V d{ray.dir.x, ray.dir.y, ray.dir.z, 0};
  const V half{extent.half.x, extent.half.y, extent.half.z, 0};
  const V ad = abs(d);
  int largest = ad[1] > ad[0];
  r.z_scale = std::max(ad[0], ad[1]);
  largest = ad[2] > r.z_scale ? 2 : largest;
  r.z_scale = std::max(r.z_scale, ad[2]);

  // The slabs of the extent, in z. Where the direction is 0, its planes are at +-huge (or at 0 on
  // the border, which is padding only). What is not finite stays so.
  const V huge = V{} + 1e200;
  const V inverse = min(huge, max(V(-huge), V(r.z_scale / d)));
  const V a = (-half - o) * inverse, b = (half - o) * inverse;
  const V lo = min(a, b), hi = max(a, b);
  const double entry = std::max(std::max(lo[0], lo[1]), lo[2]);
  const double exit = std::min(std::min(hi[0], hi[1]), hi[2]);
  const bool finite = (lo[0] + lo[1] + lo[2]) * 0 == 0 && r.z_scale > 1e-290;
  if (!(finite && entry <= exit && exit >= ray.tnear * r.z_scale && entry <= ray.tfar * r.z_scale &&
        ray.tnear < ray.tfar))
    return false;

  r.t_scale = 1 / r.z_scale;
  const V n = r.t_scale * d;
  const double s = std::min(std::max(0.0, entry), exit);
  const V moved = o + s * n;
  const double far = std::max({std::abs(o[0]), std::abs(o[1]), std::abs(o[2])}) + std::abs(s);
  const double eps_double = unit_roundoff<double> * (8 * far + 16 * extent.radius);
  for (int i = 0; i < 3; ++i) r.org[i] = T(moved[i]), r.dir[i] = T(n[i]);
  r.axis_z = largest;
  r.axis_x = largest == 2 ? 0 : largest + 1;
  r.axis_y = r.axis_x == 2 ? 0 : r.axis_x + 1;
  r.org_x = r.org[r.axis_x], r.org_y = r.org[r.axis_y], r.org_z = r.org[r.axis_z];
  r.t_origin = s * r.t_scale;
  r.sign_z = T(n[largest]) > 0 ? T(1) : T(-1);
  r.shear_x = -r.sign_z * r.dir[r.axis_x];
  r.shear_y = -r.sign_z * r.dir[r.axis_y];
  const double radius = extent.radius;
  r.eps = T((32 * double(unit_roundoff<T>) * radius + eps_double) * (1 + 1e-6));
  r.eps_z = T((8 * double(unit_roundoff<T>) * radius + eps_double) * (1 + 1e-6));
  r.zmin = r.z_below(ray.tnear);
  r.z_start = r.outward(ray.tnear, 1);
  r.zmax = r.z_above(ray.tfar);
  return true;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

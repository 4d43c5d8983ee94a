// Stage: intersection, S1. Comes in: a ray in double, in the space of a mesh. Goes out: the frame in
// which patches are met: the ray is the z axis, its origin is near the patches.
//
// After Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection": translate, then shear by
// the dominant axis of the direction. Ours differs in two points. The origin is first moved along
// the ray (in double) to the point nearest to the centre of the mesh, so that float rounding
// scales with the mesh and not with the distance of the viewer. And depth is measured along the
// dominant axis, not in units of the direction: no direction is too short or too long.
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
  T org[3];                // the moved origin, relative to the centre of the mesh, by axis
  int axis_x, axis_y, axis_z;
  T shear_x, shear_y;      // x = X + shear_x Z, y = Y + shear_y Z, with X, Y, Z relative to org
  T sign_z;                // z = sign_z Z grows along the ray
  T zmin, zmax;            // interval of z, rounded outward
  T eps;                   // bound on the rounding of x and y of a stored control value
  T eps_z;                 // the same for z
  double t_origin, t_scale;  // t = t_origin + z * t_scale

  double t_of(double z) const { return t_origin + z * t_scale; }
};

/// x as a float, never below it.
inline float float_up(float x) { return x; }
inline float float_up(double x) {
  const float f = x > double(std::numeric_limits<float>::max())
                      ? std::numeric_limits<float>::infinity()
                      : float(std::max(x, -double(std::numeric_limits<float>::max())));
  return double(f) < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

/// z of the ray at t, rounded to T by one step outward; `up` chooses the side.
template <class T>
T z_of(double t, double t_origin, double t_scale, bool up) {
  const T infinity = std::numeric_limits<T>::infinity();
  const double z = (t - t_origin) / t_scale;
  const T r = z > double(std::numeric_limits<T>::max()) ? infinity
              : z < -double(std::numeric_limits<T>::max()) ? -infinity : T(z);
  return std::nextafter(r, up ? infinity : -infinity);
}

/// S1 for a mesh whose control values, relative to `center`, are at most `radius` in magnitude.
/// Returns false if the ray cannot meet it, is not finite or has no direction.
///
/// Rounding (docs/accuracy.md, section 1). Let R = radius, O = largest |org|, D = R + O, u the unit
/// roundoff. A stored control value is off by u R and org by u O; the subtraction adds u D for each
/// of X and Z; the shear factor (|shear| <= 1) is off by u, so is the product, and the sum is at
/// most 2 D. Together |error of x| <= 2u(R + O) + 2u D + 2u D + 2u D = 8 u D, first order; 9 u D
/// covers the higher orders. The move of the origin in double adds 4 * 2^-53 (|org| + |t dir|).
template <class T>
bool make_patch_ray(const ObjectRay& ray, const Vec3d& center, double radius, PatchRay<T>& r) {
  const Vec3d d = ray.dir;
  const double ax = std::abs(d.x), ay = std::abs(d.y), az = std::abs(d.z);
  r.axis_z = az >= ax && az >= ay ? 2 : (ay >= ax ? 1 : 0);
  r.axis_x = r.axis_z == 2 ? 0 : r.axis_z + 1;
  r.axis_y = r.axis_x == 2 ? 0 : r.axis_x + 1;
  const double dz = d[r.axis_z];
  const Vec3d o = ray.org - center;
  const double finite = (o.x + o.y + o.z) * 0 + (d.x + d.y + d.z) * 0;
  if (!(dz != 0 && finite == 0 && ray.tnear < ray.tfar)) return false;

  // Move the origin to the point nearest to the centre; a far miss ends here.
  const Vec3d n{d.x / std::abs(dz), d.y / std::abs(dz), d.z / std::abs(dz)};
  const double s = -dot(o, n) / dot(n, n);
  const Vec3d moved = o + s * n;
  const double far = std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z)}) + std::abs(s);
  const double eps_move = 8 * unit_roundoff<double> * far;
  const double reach = (1 + 1e-6) * std::sqrt(3.0) * radius + eps_move;
  if (!(dot(moved, moved) <= reach * reach)) return false;

  for (int i = 0; i < 3; ++i) r.org[i] = T(moved[i]);
  r.t_scale = 1 / std::abs(dz);
  r.t_origin = s * r.t_scale;
  r.shear_x = T(-n[r.axis_x] / n[r.axis_z]);
  r.shear_y = T(-n[r.axis_y] / n[r.axis_z]);
  r.sign_z = dz > 0 ? T(1) : T(-1);
  r.zmin = z_of<T>(ray.tnear, r.t_origin, r.t_scale, false);
  r.zmax = z_of<T>(ray.tfar, r.t_origin, r.t_scale, true);

  const double size = radius + std::max({std::abs(moved.x), std::abs(moved.y), std::abs(moved.z)});
  r.eps = T((9 * double(unit_roundoff<T>) * size + eps_move) * (1 + 1e-6));
  r.eps_z = T((4 * double(unit_roundoff<T>) * size + eps_move) * (1 + 1e-6));
  return true;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

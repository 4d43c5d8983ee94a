// Stage: mathematics. Three-component vectors and the affine map of an instance.
#pragma once

#include <array>
#include <cmath>

namespace limitray {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};

  T& operator[](int i) { return (&x)[i]; }
  const T& operator[](int i) const { return (&x)[i]; }

  template <class S>
  explicit operator Vec3<S>() const {
    return {S(x), S(y), S(z)};
  }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <class T>
constexpr Vec3<T> operator+(Vec3<T> a, Vec3<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
constexpr Vec3<T> operator-(Vec3<T> a, Vec3<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
constexpr Vec3<T> operator*(T s, Vec3<T> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
constexpr T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(Vec3<T> a) {
  return std::sqrt(dot(a, a));
}

/// A point as SIMD registers like it; the fourth component is 0.
struct alignas(32) Point4 {
  double c[4];
};

/// Affine map p -> linear * p + offset; `linear` is row-major.
struct Affine {
  std::array<Vec3d, 3> linear{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
  Vec3d offset{};

  Vec3d vector(Vec3d v) const { return {dot(linear[0], v), dot(linear[1], v), dot(linear[2], v)}; }
  Vec3d point(Vec3d p) const { return vector(p) + offset; }
};

}  // namespace limitray

// Random patches for the kernel tests: smooth, wild, folded, flat, degenerate ones.
#pragma once

#include <random>

#include "reference_patch.h"

namespace limitray::test {

using Generator = std::mt19937_64;

inline double uniform(Generator& g, double lo, double hi) {
  return std::uniform_real_distribution<double>(lo, hi)(g);
}
inline Vec3d random_direction(Generator& g) {
  std::normal_distribution<double> normal;
  while (true) {
    const Vec3d v{normal(g), normal(g), normal(g)};
    if (length(v) > 1e-3) return (1 / length(v)) * v;
  }
}

enum class Shape { smooth, wild, folded, flat, collapsed_edge, collapsed_corner, curve, point };
inline constexpr Shape all_shapes[] = {
    Shape::smooth,           Shape::wild,  Shape::folded, Shape::flat, Shape::collapsed_edge,
    Shape::collapsed_corner, Shape::curve, Shape::point};
/// Shapes that are surfaces: a ray may be aimed at any of their points.
inline constexpr Shape surface_shapes[] = {Shape::smooth,         Shape::wild,
                                           Shape::folded,         Shape::flat,
                                           Shape::collapsed_edge, Shape::collapsed_corner};

inline const char* name_of(Shape s) {
  constexpr const char* names[] = {"smooth",           "wild",  "folded", "flat", "collapsed_edge",
                                   "collapsed_corner", "curve", "point"};
  return names[int(s)];
}

/// Control point of a patch of size 1 in a random plane, before noise.
inline Vec3d grid_point(Shape shape, double i, double j, Vec3d e0, Vec3d e1, Vec3d e2) {
  if (shape == Shape::folded) i = i < 0.5 ? 2 * i : 2 - 2 * i;  // goes out and comes back
  if (shape == Shape::collapsed_edge) i *= j;
  if (shape == Shape::curve) j = 0;
  if (shape == Shape::point) i = j = 0;
  const double bend = shape == Shape::folded || shape == Shape::smooth ? 0.3 * i * j : 0;
  return (i - 0.5) * e0 + (j - 0.5) * e1 + bend * e2;
}

/// A patch of about `size` around a random point at most `offset` away from 0.
inline Patch random_patch(Generator& g, Shape shape, bool gregory, double size = 1,
                          double offset = 0) {
  const Vec3d e0 = random_direction(g), d = random_direction(g);
  Vec3d e1 = cross(e0, d);
  e1 = (1 / length(e1)) * e1;
  const Vec3d e2 = cross(e0, e1), o = offset * random_direction(g);
  const double noise = shape == Shape::smooth || shape == Shape::folded ? 0.05
                       : shape == Shape::wild                           ? 0.6
                                                                        : 0;
  Patch p;
  p.gregory = gregory;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      Vec3d v = grid_point(shape, i / 3.0, j / 3.0, e0, e1, e2) + (noise * random_direction(g));
      if (shape == Shape::collapsed_corner && i < 2 && j < 2)
        v = grid_point(shape, 0, 0, e0, e1, e2);
      for (int c = 0; c < 3; ++c) p.net.c[c][4 * j + i] = o[c] + size * v[c];
    }
  const double bump = gregory ? (shape == Shape::wild ? 0.5 : 0.1) * size : 0;
  for (int k = 0; k < 4; ++k) {
    Vec3d v = bump * random_direction(g);
    if (shape == Shape::flat) v = uniform(g, -bump, bump) * e0 + uniform(g, -bump, bump) * e1;
    if (shape == Shape::curve) v = uniform(g, -bump, bump) * e0;
    if (shape == Shape::point) v = {};
    for (int c = 0; c < 3; ++c) p.bump.c[c][k] = v[c];
  }
  return p;
}

/// A parameter: inside, on a border, or on a dyadic line.
inline double random_parameter(Generator& g) {
  switch (g() % 5) {
    case 0:
      return 0;
    case 1:
      return 1;
    case 2:
      return double(g() % 17) / 16;
    default:
      return uniform(g, 0, 1);
  }
}

}  // namespace limitray::test

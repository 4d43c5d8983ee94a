// Boxes of patches (bvh/bounds.h) and the slab test (bvh/bvh.h): dense samples of the exact surface
// lie inside, and a ray through a point of a box always meets the box.
#include <gtest/gtest.h>

#include "../support/box_of.h"
#include "../support/extent.h"
#include "../support/random_patches.h"

namespace limitray {
namespace {

using test::Real;

TEST(BoundsTest, BoxesContainTheExactSurface) {
  test::Generator g{17};
  for (int round = 0; round < 400 / test::rounds_divisor; ++round)
    for (const double size : {1e-4, 1.0, 1e4}) {
      const test::Patch p = test::random_patch(g, test::all_shapes[round % 8], round % 3 != 0, size,
                                               round % 2 * 3 * size);
      const test::RoundedPatch<float> rounded(p);
      const Box box = test::box_of(rounded.net, rounded.bump_or_null(), test::radius_of(p));
      for (int j = 0; j <= 16; ++j)
        for (int i = 0; i <= 16; ++i) {
          const Vec3<Real> s = test::reference_point(p, i / Real(16), j / Real(16));
          for (int c = 0; c < 3; ++c) {
            ASSERT_GT(s[c], Real(box.lo[c]));
            ASSERT_LT(s[c], Real(box.hi[c]));
          }
        }
    }
}

TEST(BoundsTest, BoxesAreTight) {
  test::Generator g{18};
  for (int round = 0; round < 200 / test::rounds_divisor; ++round) {
    const test::Patch p = test::random_patch(g, test::Shape::smooth, false);
    const test::RoundedPatch<float> rounded(p);
    const Box box = test::box_of(rounded.net, nullptr, test::radius_of(p));
    for (int c = 0; c < 3; ++c) {
      Real lo = 1e9L, hi = -1e9L;
      for (int j = 0; j <= 32; ++j)
        for (int i = 0; i <= 32; ++i) {
          const Real v = test::reference_point(p, i / Real(32), j / Real(32))[c];
          lo = std::min(lo, v), hi = std::max(hi, v);
        }
      EXPECT_LT(Real(box.hi[c]) - Real(box.lo[c]), hi - lo + 0.05L);
    }
  }
}

/// A node whose child k is boxes[k].
BvhNode node_of(const Box (&boxes)[bvh_width]) {
  BvhNode n{};
  for (int k = 0; k < bvh_width; ++k)
    for (int c = 0; c < 3; ++c) n.lo[c][k] = boxes[k].lo[c], n.hi[c][k] = boxes[k].hi[c];
  return n;
}

/// Direction of every kind: any, along an axis, almost along one.
Vec3d awkward_direction(test::Generator& g) {
  Vec3d d = test::random_direction(g);
  const int kind = int(g() % 3);
  for (int c = 0; c < 3; ++c)
    if (kind == 1 && c != int(g() % 3)) d[c] *= g() % 2 ? 0.0 : 1e-30;
  if (d.x == 0 && d.y == 0 && d.z == 0) d.x = kind ? 1 : -1;
  return d;
}

template <class T>
void expect_rays_meet_their_boxes(double size) {
  test::Generator g{19};
  for (int round = 0; round < 3000 / test::rounds_divisor; ++round) {
    // Flat or point-like boxes too; the padding is all that holds rounding.
    Box inner[bvh_width], padded[bvh_width];
    const float padding = box_padding(size);
    for (int k = 0; k < bvh_width; ++k)
      for (int c = 0; c < 3; ++c) {
        const double a = test::uniform(g, -size, size),
                     b = g() % 3 == 0 ? a : test::uniform(g, -size, size);
        inner[k].lo[c] = float(std::min(a, b)), inner[k].hi[c] = float(std::max(a, b));
        padded[k].lo[c] = inner[k].lo[c] - padding, padded[k].hi[c] = inner[k].hi[c] + padding;
      }
    const BvhNode node = node_of(padded);
    for (int k = 0; k < bvh_width; ++k) {
      Vec3d target;  // often in a corner or on an edge of the box
      for (int c = 0; c < 3; ++c)
        target[c] = g() % 2 ? double(g() % 2 ? inner[k].lo[c] : inner[k].hi[c])
                            : test::uniform(g, inner[k].lo[c], inner[k].hi[c]);
      const Vec3d d = awkward_direction(g);
      const double far = std::pow(10.0, test::uniform(g, -1, 3)) * size;
      ObjectRay ray{target - far * d, d};
      PatchRay<T> r;
      ASSERT_TRUE(make_patch_ray(ray, test::extent_of(size), r));
      const BoxRay b = make_box_ray(r);
      ChildValues entry;
      const unsigned met = intersect_boxes(NodePlanes(node, b.signs()), b, b.zmax, entry);
      ASSERT_TRUE(met >> k & 1) << round << " " << k;
    }
  }
}

TEST(BoundsTest, RayThroughAPointOfABoxMeetsIt) {
  for (const double size : {1e-4, 1.0, 1e4}) {
    expect_rays_meet_their_boxes<float>(size);
    expect_rays_meet_their_boxes<double>(size);
  }
}

TEST(BoundsTest, AbsentChildrenAreNeverMet) {
  Box boxes[bvh_width];
  for (Box& b : boxes) b = beyond_all;
  test::Generator g{20};
  for (int round = 0; round < 1000 / test::rounds_divisor; ++round) {
    PatchRay<float> r;
    ASSERT_TRUE(make_patch_ray({{0, 0, 0}, awkward_direction(g)}, test::extent_of(1), r));
    const BoxRay b = make_box_ray(r);
    ChildValues entry;
    ASSERT_EQ(intersect_boxes(NodePlanes(node_of(boxes), b.signs()), b, b.zmax, entry), 0u);
  }
}

}  // namespace
}  // namespace limitray

// The patches of every cage, seam by seam: how far the rounded patches that meet in a point are
// apart, against what the tracer's eps covers; and that the tree's boxes contain the exact surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "../support/box_of.h"
#include "../support/reference_patch.h"
#include "../support/surface_targets.h"
#include "cage_files.h"
#include "limitray/bvh/builder.h"
#include "limitray/cage/obj.h"

namespace limitray {
namespace {

using test::Real;
using Point = Vec3<Real>;

constexpr int isolation_level = 3;

/// A point of a seam: where the double patch has it, and where the float and the double patch, as
/// stored, are in exact arithmetic (the double one is `exact` itself).
struct SeamPoint {
  Point exact, rounded;
  std::size_t patch;
};

template <class T>
Point point_of(const PatchBuffer<T>& p, std::size_t i, Real s, Real t) {
  const std::uint32_t b = p.infos[i].bump;
  Point r;
  for (int c = 0; c < 3; ++c)
    r[c] =
        test::reference_component(p.nets[i].c[c], b == no_bump ? nullptr : p.bumps[b].c[c], s, t);
  return r;
}

class CageSeamsTest : public testing::TestWithParam<std::filesystem::path> {
 protected:
  ControlCage cage = read_obj(GetParam());
  PatchBuffer<double> patches = Refiner(cage, {isolation_level}).make_patches(cage.points);
  PatchBuffer<float> rounded = round_patches<float>(patches);

  /// The points of all patches' sides at multiples of 1/128 of an edge of the cage (a sub-quad of
  /// an n-gon has half of one).
  std::vector<SeamPoint> seam_points() const {
    std::vector<SeamPoint> points;
    for (std::size_t i = 0; i < patches.size(); ++i) {
      const PatchInfo& info = patches.infos[i];
      const int grid = cage.face_vertex_counts[info.face] == 4 ? 128 : 64;
      for (int side = 0; side < 4; ++side) {
        const Real begin = side < 2 ? info.v0 : info.u0, length = side < 2 ? info.dv : info.du;
        for (int k = int(std::ceil(begin * grid)); Real(k) / grid <= begin + length; ++k) {
          const Real x = (Real(k) / grid - begin) / length, end = side & 1;
          const Real s = side < 2 ? end : x, t = side < 2 ? x : end;
          points.push_back({point_of(patches, i, s, t), point_of(rounded, i, s, t), i});
        }
      }
    }
    return points;
  }
};

Real distance(const Point& a, const Point& b) {
  return std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)});
}

/// Calls f(a, b) for all pairs of different patches' points closer than `near`.
template <class F>
void for_each_meeting(std::vector<SeamPoint>& points, Real near, const F& f) {
  std::sort(points.begin(), points.end(),
            [](const SeamPoint& a, const SeamPoint& b) { return a.exact.x < b.exact.x; });
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t k = i + 1; k < points.size(); ++k) {
      if (points[k].exact.x - points[i].exact.x > near) break;
      if (points[k].patch != points[i].patch && distance(points[i].exact, points[k].exact) < near)
        f(i, k);
    }
}

// docs/accuracy.md, section 1: of eps, u R in each of X and Z is for the rounding of stored values.
TEST_P(CageSeamsTest, PatchesThatMeetAreCloserThanTheirRounding) {
  if (patches.size() == 0) GTEST_SKIP() << "no surface";
  std::vector<SeamPoint> points = seam_points();
  const Real u = unit_roundoff<float>, u_double = unit_roundoff<double>, r = patches.radius;
  std::vector<bool> met(points.size());
  Real gap = 0, gap_double = 0;
  for_each_meeting(points, 1e-10L * r, [&](std::size_t i, std::size_t k) {
    met[i] = met[k] = true;
    gap = std::max(gap, distance(points[i].rounded, points[k].rounded));
    gap_double = std::max(gap_double, distance(points[i].exact, points[k].exact));
  });
  std::printf("%zu seam points: gap %.2Lf u R in float, %.2Lf u R in double\n", points.size(),
              gap / (u * r), gap_double / (u_double * r));
  EXPECT_LE(gap, 2 * u * r * (1 + 1e-6L)) << "each patch is within u R of the surface";
  EXPECT_LE(gap_double, 32 * u_double * r);
  if (test::is_closed(cage)) {
    EXPECT_EQ(std::count(met.begin(), met.end(), false), 0) << "a side without a neighbour";
  }
}

/// Checks that `p` is inside the box of leaf `leaf` and of every node above it.
struct TreeWalk {
  const Bvh& bvh;
  std::vector<std::vector<Box>> boxes_of_leaf;  // from the root down

  explicit TreeWalk(const Bvh& b) : bvh(b), boxes_of_leaf(b.order.size()) { walk(0, {}); }
  void walk(std::uint32_t node, const std::vector<Box>& above) {
    for (int k = 0; k < bvh_width; ++k) {
      const BvhNode& n = bvh.nodes[node];
      if (n.lo[0][k] == beyond_all.lo[0]) continue;
      std::vector<Box> path = above;
      Box box;
      for (int c = 0; c < 3; ++c) box.lo[c] = n.lo[c][k], box.hi[c] = n.hi[c][k];
      path.push_back(box);
      if (n.child[k] & leaf_flag)
        boxes_of_leaf[n.child[k] & ~leaf_flag] = path;
      else
        walk(n.child[k], path);
    }
  }
};

TEST_P(CageSeamsTest, BoxesContainTheExactSurface) {
  if (patches.size() == 0) GTEST_SKIP() << "no surface";
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < rounded.size(); ++i) {
    const std::uint32_t b = rounded.infos[i].bump;
    boxes.push_back(
        test::box_of(rounded.nets[i], b == no_bump ? nullptr : &rounded.bumps[b], rounded.radius));
  }
  const Bvh bvh = build_bvh(boxes);
  const TreeWalk tree(bvh);
  for (std::size_t leaf = 0; leaf < bvh.order.size(); ++leaf) {
    ASSERT_FALSE(tree.boxes_of_leaf[leaf].empty());
    for (int k = 0; k < 81; ++k) {
      const Point p = point_of(patches, bvh.order[leaf], Real(k % 9) / 8, Real(k / 9) / 8);
      for (const Box& box : tree.boxes_of_leaf[leaf])
        for (int c = 0; c < 3; ++c) {
          ASSERT_GT(p[c], Real(box.lo[c]));
          ASSERT_LT(p[c], Real(box.hi[c]));
        }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cages, CageSeamsTest, testing::ValuesIn(test::cage_files()),
                         [](const auto& i) { return test::test_name(i.param); });

}  // namespace
}  // namespace limitray

// Many rays in a tree at once (bvh/list_walk.h) against one ray alone (bvh/bvh.h): the same leaves
// for each ray, in an order that does not depend on the other rays.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "../support/extent.h"
#include "../support/random_patches.h"
#include "limitray/bvh/list_walk.h"

namespace limitray {
namespace {

/// A random tree over boxes in the unit cube, children in any order, some absent.
struct RandomTree {
  std::vector<BvhNode> nodes;
  std::uint32_t leaves = 0;

  RandomTree(test::Generator& g, int depth) {
    nodes.emplace_back();
    Box all;
    for (int i = 0; i < 3; ++i) all.lo[i] = -1, all.hi[i] = 1;
    fill(g, 0, all, depth);
  }

 private:
  void fill(test::Generator& g, std::uint32_t index, const Box& inside, int depth) {
    for (int k = 0; k < bvh_width; ++k) {
      Box b = beyond_all;
      std::uint32_t child = 0;
      if (g() % 4) {
        for (int i = 0; i < 3; ++i) {
          const double a = test::uniform(g, inside.lo[i], inside.hi[i]);
          const double c = test::uniform(g, inside.lo[i], inside.hi[i]);
          b.lo[i] = float(std::min(a, c)), b.hi[i] = float(std::max(a, c));
        }
        if (depth == 0 || g() % 5 == 0) {
          child = leaf_flag | leaves++;
        } else {
          child = std::uint32_t(nodes.size());
          nodes.emplace_back();
          fill(g, child, b, depth - 1);
        }
      }
      for (int i = 0; i < 3; ++i) nodes[index].lo[i][k] = b.lo[i], nodes[index].hi[i][k] = b.hi[i];
      nodes[index].child[k] = child;
    }
  }
};

/// Rays whose directions have the same signs.
std::vector<BoxRay> rays_of_signs(test::Generator& g, unsigned signs, int count) {
  std::vector<BoxRay> rays;
  while (int(rays.size()) < count) {
    Vec3d d = test::random_direction(g), o = 1.5 * test::random_direction(g);
    for (int i = 0; i < 3; ++i) d[i] = signs >> i & 1 ? -std::abs(d[i]) : std::abs(d[i]);
    ObjectRay ray{o, d};
    if (g() % 3 == 0) ray.tfar = test::uniform(g, 0.1, 2);
    PatchRay<float> r;
    if (make_patch_ray(ray, test::extent_of(1), r)) rays.push_back(make_box_ray(r));
  }
  return rays;
}

using Visits = std::map<std::uint32_t, std::vector<std::uint32_t>>;  // leaves by ray, in order

Visits walk(const RandomTree& tree, const std::vector<BoxRay>& rays, unsigned signs,
            const std::vector<std::uint32_t>& list, std::uint64_t& node_visits) {
  const int n = int(list.size());
  std::vector<std::uint32_t> padded = list, room(list_room(n));
  padded.resize(list.size() + list_slack);
  Visits visits;
  const float along[3] = {signs & 1 ? -1.0f : 1.0f, signs & 2 ? -0.4f : 0.4f, 0.4f};
  walk_lists(
      tree.nodes.data(), rays.data(), signs, along, padded.data(), n, room.data(),
      [&](std::uint32_t leaf, const std::uint32_t* ids, int count) {
        for (int k = 0; k < count; ++k) visits[ids[k]].push_back(leaf);
      },
      [](std::uint32_t) {}, node_visits);
  return visits;
}

std::vector<std::uint32_t> leaves_of(const RandomTree& tree, const BoxRay& ray,
                                     std::uint64_t& node_visits) {
  BvhWalk one;
  one.begin();
  std::vector<std::uint32_t> leaves;
  while (true) {
    const std::uint32_t leaf = next_item(
        tree.nodes.data(), ray, ray.zmax, one, [](std::uint32_t) {}, node_visits);
    if (leaf == no_item) return leaves;
    leaves.push_back(leaf);
  }
}

TEST(ListWalkTest, RaysMeetTheLeavesThatTheyMeetAlone) {
  test::Generator g{31};
  std::size_t met = 0;
  for (int round = 0; round < 40 / std::min(test::rounds_divisor, 4); ++round) {
    const RandomTree tree(g, int(g() % 4));
    const unsigned signs = unsigned(round) % 8;
    for (const int count : {1, 3, 15, 16, 17, 130}) {
      const std::vector<BoxRay> rays = rays_of_signs(g, signs, count);
      std::vector<std::uint32_t> list(rays.size());
      for (std::size_t k = 0; k < list.size(); ++k) list[k] = std::uint32_t(k);
      std::uint64_t together = 0, alone = 0;
      Visits visits = walk(tree, rays, signs, list, together);
      for (std::uint32_t k = 0; k < rays.size(); ++k) {
        std::vector<std::uint32_t> in_turn = visits[k];
        std::vector<std::uint32_t> expected = leaves_of(tree, rays[k], alone);
        std::uint64_t ignored = 0;
        ASSERT_EQ(walk(tree, rays, signs, {k}, ignored)[k], in_turn) << "the same order by itself";
        std::sort(in_turn.begin(), in_turn.end());
        std::sort(expected.begin(), expected.end());
        ASSERT_EQ(in_turn, expected) << round << " " << k;
        met += expected.size();
      }
      EXPECT_EQ(together, alone) << "each ray counts its nodes";
    }
  }
  EXPECT_GT(met, 100u);
}

/// How many meetings of rays and leaves there are if a ray ends at its first leaf, or goes on.
int meetings(const RandomTree& tree, std::vector<BoxRay> rays, unsigned signs, bool end_at_first) {
  const int n = int(rays.size());
  std::vector<std::uint32_t> list(rays.size() + list_slack), room(list_room(n));
  for (std::uint32_t k = 0; k < rays.size(); ++k) list[k] = k;
  std::uint64_t node_visits = 0;
  int met = 0;
  walk_lists(
      tree.nodes.data(), rays.data(), signs, {1, 0.4f, 0.4f}, list.data(), n, room.data(),
      [&](std::uint32_t, const std::uint32_t* ids, int count) {
        met += count;
        for (int k = 0; k < count && end_at_first; ++k)
          rays[ids[k]].zmax = -std::numeric_limits<float>::infinity();
      },
      [](std::uint32_t) {}, node_visits);
  return met;
}

// It may still meet leaves in whose lists it was already, and no others.
TEST(ListWalkTest, ARayThatHasEndedMeetsLess) {
  test::Generator g{32};
  int ended = 0, all = 0;
  for (int round = 0; round < 20; ++round) {
    const RandomTree tree(g, 3);
    const unsigned signs = unsigned(round) % 8;
    const std::vector<BoxRay> rays = rays_of_signs(g, signs, 64);
    ended += meetings(tree, rays, signs, true), all += meetings(tree, rays, signs, false);
  }
  EXPECT_GT(ended, 50);
  EXPECT_LT(ended, all);
}

}  // namespace
}  // namespace limitray

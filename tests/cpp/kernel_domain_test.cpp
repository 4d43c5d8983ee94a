// The two bit trails (intersect/domain.h) against a recursive walk: for random trees and random
// visit orders, the leaves come in the same order, each exactly once.
#include <gtest/gtest.h>

#include <random>
#include <tuple>
#include <vector>

#include "limitray/intersect/domain.h"

namespace limitray {
namespace {

using Shallow = Domain<std::uint32_t, std::uint64_t>;
using Deep = Domain<std::uint64_t, TrailOf128>;

/// Where a subdomain lies: index and level in u, index and level in v.
using Place = std::tuple<std::uint64_t, int, std::uint64_t, int>;

/// A random tree is a function of the place: whether it is split, which children are hit, which
/// child is the nearer one, which way it is split. Neither walk keeps it in memory.
struct Choice {
  bool leaf, hit[2], second_first, across_u;
};
struct RandomTree {
  std::uint64_t seed;
  int depth, both_in_8;  // mean levels a direction; how many of 8 splits hit both children
  unsigned across_u_in_4;
  static constexpr int deepest = 22;

  Choice at(const Place& p) const {
    std::seed_seq s{seed, std::get<0>(p), std::uint64_t(std::get<1>(p)), std::get<2>(p),
                    std::uint64_t(std::get<3>(p))};
    std::uint32_t r[2];
    s.generate(r, r + 2);
    const bool both = int(r[0] % 8) < both_in_8, one = r[0] >> 8 & 1, none = (r[0] >> 16) % 16 == 0;
    Choice c;
    const int lu = std::get<1>(p), lv = std::get<3>(p);
    c.leaf = lu + lv >= 2 * depth || (r[1] % 16 == 0 && lu > 0);
    c.hit[0] = !none && (both || !one), c.hit[1] = !none && (both || one);
    c.second_first = r[1] >> 8 & 1;
    c.across_u = lv == deepest || (lu < deepest && (r[1] >> 16) % 4 < across_u_in_4);
    return c;
  }
};

void walk_recursively(const RandomTree& tree, const Place& p, std::vector<Place>& leaves) {
  const Choice c = tree.at(p);
  if (c.leaf) {
    leaves.push_back(p);
    return;
  }
  const auto [iu, lu, iv, lv] = p;
  for (int k = 0; k < 2; ++k) {
    const bool child = c.hit[0] && c.hit[1] ? (k == 1) != c.second_first : k == 1;
    if (!c.hit[child]) continue;
    walk_recursively(tree,
                     c.across_u ? Place{iu << 1 | std::uint64_t(child), lu + 1, iv, lv}
                                : Place{iu, lu, iv << 1 | std::uint64_t(child), lv + 1},
                     leaves);
  }
}

template <class Domain>
std::vector<Place> walk_by_trails(const RandomTree& tree) {
  std::vector<Place> leaves;
  Domain d;
  while (true) {
    const Place p{d.index_u, d.level_u, d.index_v, d.level_v};
    const Choice c = tree.at(p);
    if (c.leaf) {
      leaves.push_back(p);
    } else if (c.hit[0] || c.hit[1]) {
      const bool both = c.hit[0] && c.hit[1];
      d.descend(c.across_u, both ? c.second_first : c.hit[1], both);
      continue;
    }
    if (!d.next()) return leaves;
  }
}

TEST(DomainTest, TrailsVisitTheLeavesOfTheRecursiveWalkInItsOrder) {
  std::size_t leaves = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed)
    for (const auto& [depth, both] : {std::pair{4, 8}, std::pair{6, 4}, std::pair{20, 1}}) {
      const RandomTree tree{seed, depth, both, unsigned(1 + seed % 3)};
      std::vector<Place> expected;
      walk_recursively(tree, {0, 0, 0, 0}, expected);
      leaves += expected.size();
      ASSERT_EQ(walk_by_trails<Shallow>(tree), expected) << seed << " " << depth;
      ASSERT_EQ(walk_by_trails<Deep>(tree), expected) << seed << " " << depth;
    }
  EXPECT_GT(leaves, 10000u);
}

TEST(DomainTest, EveryCellOfAFullTreeIsVisitedOnce) {
  Shallow d;
  std::vector<int> visits(64 * 64);
  bool more = true;
  while (more) {
    while (d.splits() < 12) d.descend(d.level_u < 6, d.index_u & 1, true);
    ++visits[d.index_v * 64 + d.index_u];
    more = d.next();
  }
  for (int v : visits) ASSERT_EQ(v, 1);
}

template <class Domain>
void expect_levels_to_fit(int levels) {
  Domain d;
  while (d.splits() < 2 * levels) d.descend(d.level_u <= d.level_v, true, true);
  EXPECT_EQ(std::uint64_t(d.index_u), (std::uint64_t(1) << levels) - 1);
  EXPECT_EQ(count_ones(d.pending), 2 * levels);
  EXPECT_EQ(count_ones(d.turns), levels);
  for (int left = 2 * levels; left > 0; --left) ASSERT_TRUE(d.next());
  EXPECT_FALSE(d.next());
  EXPECT_EQ(d.splits(), 1);  // the first split's sibling came last
  EXPECT_EQ(d.index_u, 0u);
}
TEST(DomainTest, TheDeepestLevelsFitTheTrails) {
  expect_levels_to_fit<Shallow>(22);
  expect_levels_to_fit<Deep>(48);
}

}  // namespace
}  // namespace limitray

// The order in which rays are traced (intersect/ray_order.h): every ray once, whatever it is, those
// that go the same way from the same place together.
#include "limitray/intersect/ray_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace limitray {
namespace {

const Extent unit{{0, 0, 0}, {1, 1, 1}, 1};

template <class T>
std::vector<T> random_rays(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<T> uniform(-1, 1);
  std::vector<T> rays(6 * count);
  for (T& x : rays) x = uniform(random);
  return rays;
}

template <class T>
std::vector<std::uint32_t> order_of(const std::vector<T>& rays, std::size_t patches,
                                    std::size_t first = 0) {
  RayOrder order(unit, patches);
  const auto sorted = order.sort(RayBatch<T>{rays, {}, {}}, first, rays.size() / 6 - first);
  return {sorted.begin(), sorted.end()};
}

template <class T>
unsigned octant(const std::vector<T>& rays, std::size_t i) {
  unsigned o = 0;
  for (int c = 0; c < 3; ++c) o |= unsigned(rays[6 * i + 3 + std::size_t(c)] < 0) << c;
  return o;
}

void expect_each_once(std::vector<std::uint32_t> order) {
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) ASSERT_EQ(order[i], i);
}

TEST(RayOrderTest, EachRayOnceByOctant) {
  // More than one slice, and one that is not full; few and many patches.
  for (const std::size_t count : {0u, 1u, 7u, 1000u, 200001u})
    for (const std::size_t patches : {std::size_t(0), std::size_t(100), std::size_t(10'000'000)}) {
      const std::vector<float> rays = random_rays<float>(count, 1);
      const std::vector<std::uint32_t> order = order_of(rays, patches);
      ASSERT_EQ(order.size(), count);
      expect_each_once(order);
      for (std::size_t k = 1; k < order.size(); ++k)
        ASSERT_LE(octant(rays, order[k - 1]), octant(rays, order[k]));
    }
}

TEST(RayOrderTest, KeepsTheOrderOfRaysThatShareADirection) {
  const std::vector<float> rays = random_rays<float>(150000, 2);
  const std::vector<std::uint32_t> order = order_of(rays, 100);
  for (std::size_t k = 1; k < order.size(); ++k)
    if (octant(rays, order[k - 1]) == octant(rays, order[k])) {
      ASSERT_LT(order[k - 1], order[k]);
    }
}

TEST(RayOrderTest, NeighboursOfALargeMeshAreNear) {
  const std::vector<float> rays = random_rays<float>(100000, 3);
  const auto mean_step = [&](const std::vector<std::uint32_t>& order) {
    double sum = 0;
    for (std::size_t k = 1; k < order.size(); ++k)
      for (std::size_t c = 0; c < 3; ++c)
        sum += std::abs(rays[6 * order[k - 1] + c] - rays[6 * order[k] + c]);
    return sum / double(order.size());
  };
  EXPECT_LT(mean_step(order_of(rays, 2'000'000)), 0.3 * mean_step(order_of(rays, 1000)));
}

TEST(RayOrderTest, TakesARangeOfABatchAndDoubles) {
  const std::vector<double> rays = random_rays<double>(1000, 4);
  const std::vector<std::uint32_t> order = order_of(rays, 10'000'000, 300);
  ASSERT_EQ(order.size(), 700u);
  expect_each_once(order);
  for (std::size_t k = 1; k < order.size(); ++k)
    ASSERT_LE(octant(rays, 300 + order[k - 1]), octant(rays, 300 + order[k]));
}

TEST(RayOrderTest, RaysThatAreNoneAreSortedToo) {
  std::vector<float> rays = random_rays<float>(1000, 5);
  std::mt19937 random(6);
  const float inf = std::numeric_limits<float>::infinity();
  const float odd[] = {std::nanf(""), inf, -inf, 1e38f, -1e38f, 0.0f, -0.0f, 1e-45f};
  for (float& x : rays)
    if (random() % 3 == 0) x = odd[random() % 8];
  expect_each_once(order_of(rays, 10'000'000));
  // Nor does a mesh without size trouble it.
  RayOrder flat({{0, 0, 0}, {0, 1, 0}, 1}, 10'000'000);
  const auto order = flat.sort(RayBatch<float>{rays, {}, {}}, 0, 1000);
  expect_each_once({order.begin(), order.end()});
}

}  // namespace
}  // namespace limitray

// The order in which rays are traced (intersect/ray_order.h): every ray once, whatever it is, those
// that go the same way from the same place together; and each gets its own answers back.
#include "limitray/intersect/ray_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace limitray {
namespace {

const Extent unit{{0, 0, 0}, {1, 1, 1}, 1};
constexpr std::size_t few_patches = 100, many_patches = 10'000'000;

template <class T>
std::vector<T> random_values(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<T> uniform(-1, 1);
  std::vector<T> values(count);
  for (T& x : values) x = uniform(random);
  return values;
}

/// Rays of a batch with tnear and tfar of their own, sorted from `first` on.
template <class T>
struct SortedBatch {
  std::vector<T> rays, tnear, tfar;
  std::size_t first;
  SortedRays<T> sorted;

  SortedBatch(std::vector<T> r, std::size_t patches, std::size_t begin = 0,
              const Extent& extent = unit)
      : rays(std::move(r)),
        tnear(random_values<T>(count(), 7)),
        tfar(random_values<T>(count(), 8)),
        first(begin) {
    sorted.sort(RayOrder(extent, patches, count() - first), {rays, tnear, tfar}, first,
                count() - first);
  }
  std::size_t count() const { return rays.size() / 6; }

  /// order()[place] is the ray of the batch that lies there. Each must be there once, bit for bit.
  std::vector<std::size_t> order() const {
    const std::size_t n = count() - first;
    const RayBatch<T> b = sorted.batch();
    EXPECT_EQ(b.size(), n);
    EXPECT_EQ(sorted.places().size(), n);
    std::vector<std::size_t> order(n, count());
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t p = sorted.places()[i], k = first + i;
      if (p >= n || order[p] != count()) {
        ADD_FAILURE() << "ray " << k << " is at " << p;
        return {};
      }
      order[p] = k;
      EXPECT_EQ(std::memcmp(&b.rays[6 * p], &rays[6 * k], 6 * sizeof(T)), 0);
      EXPECT_EQ(b.tnear[p], tnear[k]);
      EXPECT_EQ(b.tfar[p], tfar[k]);
    }
    return order;
  }
  unsigned octant(std::size_t i) const {
    unsigned o = 0;
    for (std::size_t c = 0; c < 3; ++c) o |= unsigned(rays[6 * i + 3 + c] < 0) << c;
    return o;
  }
};

TEST(RayOrderTest, EachRayOnceAndOctantsTogether) {
  // More than one slice, and one that is not full; few and many patches.
  for (const std::size_t count : {0u, 1u, 7u, 1000u, 200001u})
    for (const std::size_t patches : {std::size_t(0), few_patches, many_patches}) {
      const SortedBatch<float> s(random_values<float>(6 * count, 1), patches);
      const auto order = s.order();
      ASSERT_EQ(order.size(), count);
      std::size_t changes = 0, drops = 0;
      for (std::size_t k = 1; k < count; ++k) {
        changes += s.octant(order[k - 1]) != s.octant(order[k]);
        drops += s.octant(order[k - 1]) > s.octant(order[k]);
      }
      // By octant first; in large meshes by place first, if there are rays enough: 16^3 cells.
      const bool place_first = patches == many_patches && count > 1000;
      EXPECT_LE(changes, place_first ? 8u * 4096 : 7u);
      EXPECT_EQ(drops > 0, place_first);
    }
}

TEST(RayOrderTest, KeepsTheOrderOfRaysThatShareDirectionAndPlace) {
  std::vector<float> rays = random_values<float>(6 * 150000, 2);
  for (std::size_t k = 0; k < rays.size(); ++k)
    if (k % 6 < 3) rays[k] *= 1e-3f, rays[k] += 0.1f;  // in one cell
  const SortedBatch<float> s(rays, many_patches);
  const auto order = s.order();
  ASSERT_EQ(order.size(), 150000u);
  for (std::size_t k = 1; k < order.size(); ++k)
    if (s.octant(order[k - 1]) == s.octant(order[k])) {
      ASSERT_LT(order[k - 1], order[k]);
    }
}

TEST(RayOrderTest, NeighboursAreNear) {
  const auto mean_step = [](std::size_t patches, std::size_t count) {
    const SortedBatch<float> s(random_values<float>(6 * count, 3), patches);
    const auto rays = s.sorted.batch().rays;
    double sum = 0;
    for (std::size_t k = 6; k < rays.size(); ++k)
      sum += k % 6 < 3 ? std::abs(rays[k] - rays[k - 6]) : 0;
    return sum / double(s.count());
  };
  // In a grid of 16^3, of 4^3, and without one.
  EXPECT_LT(mean_step(many_patches, 1 << 19), 0.4 * mean_step(few_patches, 1 << 19));
  EXPECT_LT(mean_step(few_patches, 1 << 19), 0.5 * mean_step(many_patches, 500));
}

TEST(RayOrderTest, TakesAPartOfABatchAndDoubles) {
  const SortedBatch<double> s(random_values<double>(6000, 4), many_patches, 300);
  const auto order = s.order();
  ASSERT_EQ(order.size(), 700u);
  for (std::size_t k = 1; k < order.size(); ++k)
    ASSERT_LE(s.octant(order[k - 1]), s.octant(order[k]));
}

TEST(RayOrderTest, RaysThatAreNoneAreSortedToo) {
  std::vector<float> rays = random_values<float>(6000, 5);
  std::mt19937 random(6);
  const float inf = std::numeric_limits<float>::infinity();
  const float odd[] = {std::nanf(""), inf, -inf, 1e38f, -1e38f, 0.0f, -0.0f, 1e-45f};
  for (float& x : rays)
    if (random() % 3 == 0) x = odd[random() % 8];
  EXPECT_EQ(SortedBatch<float>(rays, many_patches).order().size(), 1000u);
  // Nor does a mesh without size trouble it.
  const Extent flat{{0, 0, 0}, {0, 1, 0}, 1};
  EXPECT_EQ(SortedBatch<float>(rays, many_patches, 0, flat).order().size(), 1000u);
}

/// Every answer of ray `ray`, told apart by `column`.
template <class T>
T answer(std::size_t ray, std::size_t column) {
  return T(100 * ray + column);
}

template <class T>
class RayOrderTypedTest : public testing::Test {};
using BothTypes = testing::Types<float, double>;
TYPED_TEST_SUITE(RayOrderTypedTest, BothTypes);

TYPED_TEST(RayOrderTypedTest, EachRayGetsItsAnswersBack) {
  using T = TypeParam;
  constexpr std::size_t n = 70001, first = 11;
  SortedBatch<T> s(random_values<T>(6 * n, 9), many_patches, first);
  const auto order = s.order();

  std::vector<T> t(n, T(-1)), e = t, uv(2 * n, T(-1)), xyz[4];
  for (auto& v : xyz) v.assign(3 * n, T(-1));
  std::vector<std::uint32_t> ids[4];
  for (auto& v : ids) v.assign(n, 7u);
  const HitArrays<T> all{t.data(),      e.data(),      ids[0].data(), ids[1].data(),
                         ids[2].data(), ids[3].data(), uv.data(),     xyz[0].data(),
                         xyz[1].data(), xyz[2].data(), xyz[3].data()};
  const HitArrays<T> here = s.sorted.hits(all);
  for (std::size_t p = 0; p < order.size(); ++p) {
    const std::size_t i = order[p];
    here.t[p] = answer<T>(i, 0), here.t_error[p] = answer<T>(i, 1);
    here.geometry_id[p] = answer<std::uint32_t>(i, 2);
    here.primitive_id[p] = answer<std::uint32_t>(i, 3);
    here.sub_quad[p] = answer<std::uint32_t>(i, 4);
    here.patch_id[p] = answer<std::uint32_t>(i, 5);
    for (std::size_t c = 0; c < 2; ++c) here.uv[2 * p + c] = answer<T>(i, 10 + c);
    T* const vectors[4] = {here.normal, here.point, here.dp_du, here.dp_dv};
    for (std::size_t v = 0; v < 4; ++v)
      for (std::size_t c = 0; c < 3; ++c) vectors[v][3 * p + c] = answer<T>(i, 20 + 10 * v + c);
  }
  s.sorted.restore(all);
  for (std::size_t i = first; i < n; ++i) {
    ASSERT_EQ(t[i], answer<T>(i, 0));
    ASSERT_EQ(e[i], answer<T>(i, 1));
    for (std::size_t k = 0; k < 4; ++k) ASSERT_EQ(ids[k][i], answer<std::uint32_t>(i, 2 + k));
    for (std::size_t c = 0; c < 2; ++c) ASSERT_EQ(uv[2 * i + c], answer<T>(i, 10 + c));
    for (std::size_t v = 0; v < 4; ++v)
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_EQ(xyz[v][3 * i + c], answer<T>(i, 20 + 10 * v + c));
  }
  // What lies before is not touched.
  EXPECT_EQ(t[first - 1], T(-1));
  EXPECT_EQ(xyz[3][3 * first - 1], T(-1));
  EXPECT_EQ(ids[3][first - 1], 7u);
}

TEST(RayOrderTest, OnlyWantedAnswersComeBack) {
  SortedBatch<float> s(random_values<float>(600, 10), few_patches);
  std::vector<float> uv(200);
  HitArrays<float> wanted;
  wanted.uv = uv.data();
  const HitArrays<float> here = s.sorted.hits(wanted);
  EXPECT_NE(here.uv, nullptr);
  EXPECT_EQ(here.t, nullptr);
  EXPECT_EQ(here.dp_dv, nullptr);
  EXPECT_EQ(here.patch_id, nullptr);
  std::fill_n(here.uv, 200, 3.0f);
  s.sorted.restore(wanted);
  EXPECT_EQ(uv, std::vector<float>(200, 3.0f));
}

TEST(RayOrderTest, OnlyTracedRaysGetAnswers) {
  SortedBatch<float> s(random_values<float>(6 * 1000, 12), few_patches);
  std::vector<float> normal(3000, -1.0f);
  std::vector<std::uint8_t> occluded(1000, 9);
  HitArrays<float> wanted;
  wanted.normal = normal.data();
  std::fill_n(s.sorted.hits(wanted).normal, 3000, 1.0f);
  std::fill_n(s.sorted.occluded(), 1000, std::uint8_t(1));
  const RayRange traced[] = {{0, 100}, {300, 450}};
  s.sorted.keep_only(traced);
  s.sorted.restore(wanted);
  s.sorted.restore(occluded.data());
  for (std::size_t i = 0; i < 1000; ++i) {
    const std::size_t p = s.sorted.places()[i];
    const bool kept = p < 100 || (p >= 300 && p < 450);
    ASSERT_EQ(s.sorted.is_kept(p), kept);
    ASSERT_EQ(occluded[i], kept ? 1 : 9);
    for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(normal[3 * i + c], kept ? 1.0f : -1.0f);
  }
}

TEST(RayOrderTest, OcclusionsComeBackAndTheNextPartIsTaken) {
  SortedBatch<float> s(random_values<float>(6 * 5000, 11), few_patches, 1000);
  std::vector<std::uint8_t> out(5000, 2);
  const auto trace = [&](const std::vector<std::size_t>& order) {
    std::uint8_t* here = s.sorted.occluded();
    for (std::size_t p = 0; p < order.size(); ++p) here[p] = std::uint8_t(order[p] % 2);
    s.sorted.restore(out.data());
  };
  trace(s.order());
  EXPECT_EQ(out[999], 2);
  // A smaller part in the same room.
  s.first = 4000;
  s.sorted.sort(RayOrder(unit, many_patches, 1000), {s.rays, s.tnear, s.tfar}, 4000, 1000);
  trace(s.order());
  for (std::size_t i = 1000; i < 5000; ++i) ASSERT_EQ(out[i], i % 2);
}

}  // namespace
}  // namespace limitray

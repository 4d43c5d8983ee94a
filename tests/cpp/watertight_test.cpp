// Nothing leaks: rays aimed at the seams of closed cages, 2 million a cage, from inside and
// outside, grazing and coherent (tests/support/watertight.h says what counts as a leak).
// bench/watertight runs the same at length.
#include "../support/watertight.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

using test::LeakCounts;
using test::RayKind;
using test::WatertightCage;

constexpr int isolation_level = 3;
// Under a sanitizer the same code runs on fewer rays: they look for other faults than leaks.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::size_t rays_divisor = 50;
#else
constexpr std::size_t rays_divisor = 1;
#endif

class WatertightTest : public testing::TestWithParam<const char*> {
 protected:
  WatertightCage cage{read_obj(test::cage_file(GetParam())), isolation_level, 42};

  template <class T>
  LeakCounts run_all_kinds(std::size_t rays) {
    LeakCounts all;
    for (int k = 0; k < test::ray_kinds; ++k) {
      const LeakCounts c = cage.run_share<T>(RayKind(k), rays / rays_divisor);
      EXPECT_EQ(c.leaks, 0u) << name_of(RayKind(k)) << ", " << c.rays << " rays";
      EXPECT_EQ(c.unresolved, 0u) << name_of(RayKind(k));
      all.add(c);
    }
    for (const std::string& ray : cage.examples()) std::printf("leak: %s\n", ray.c_str());
    return all;
  }
};

TEST_P(WatertightTest, TwoMillionRaysInFloat) {
  ASSERT_GT(cage.inside_points(), 0u);
  EXPECT_EQ(run_all_kinds<float>(2'000'000).rays, 2'000'000u / rays_divisor);
}

TEST_P(WatertightTest, Double) {
  ASSERT_GT(cage.inside_points(), 0u);
  run_all_kinds<double>(100'000);
}

TEST_P(WatertightTest, PureBisection) {
  ASSERT_GT(cage.inside_points(), 0u);
  cage.scene().set_newton(false);
  run_all_kinds<float>(50'000);
  run_all_kinds<double>(10'000);
}

INSTANTIATE_TEST_SUITE_P(Cages, WatertightTest,
                         testing::Values("cube", "cube_corners", "cube_inf_loop", "cube_seams",
                                         "cube_semi_2_5", "dart_infinite", "icosahedron", "pole_12",
                                         "star_prism", "torus_creases"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace limitray

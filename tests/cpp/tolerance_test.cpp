// The isolation level that a tolerance chooses: the surface is that near to the true limit wherever
// the scene says so, the choice is the lowest one, and the same each time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

#include "../support/patch_sampler.h"
#include "cage_files.h"
#include "limitray/cage/limit.h"
#include "limitray/cage/obj.h"
#include "limitray/patches/gregory_error.h"
#include "limitray/patches/refine.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

/// Distance of `p` from the limit along its normal: Newton's method in the tangent plane from
/// (u,v), as long as it leads nearer.
double distance(const LimitEvaluator& limit, const PatchInfo& info, Vec3d p, double u, double v) {
  double nearest = INFINITY, along_normal = 0;
  for (int step = 0; step < 5; ++step) {
    const LimitSample q = limit.evaluate(static_cast<std::int32_t>(info.face), info.sub_quad, u, v);
    const Vec3d r = p - q.point;
    if (length(r) >= nearest) break;
    nearest = length(r);
    along_normal = std::abs(dot(r, q.normal));
    const double uu = dot(q.dp_du, q.dp_du), uv = dot(q.dp_du, q.dp_dv), vv = dot(q.dp_dv, q.dp_dv);
    const double x = dot(r, q.dp_du), y = dot(r, q.dp_dv), det = uu * vv - uv * uv;
    if (!(det > 1e-12 * uu * vv)) break;
    u = std::clamp(u + (vv * x - uv * y) / det, 0.0, 1.0);
    v = std::clamp(v + (uu * y - uv * x) / det, 0.0, 1.0);
  }
  return along_normal;
}

double size_of(const ControlCage& cage) {
  double size = 0;
  for (int k = 0; k < 3; ++k) {
    double low = INFINITY, high = -INFINITY;
    for (const std::int32_t v : cage.face_vertex_indices) {
      low = std::min(low, cage.points[v][k]);
      high = std::max(high, cage.points[v][k]);
    }
    size = std::max(size, high - low);
  }
  return size;
}

/// Largest distance at 9 x 9 points of each Gregory patch (of every `stride`th), relative.
double measured_error(const ControlCage& cage, int level, std::size_t at_most) {
  const LimitEvaluator limit(cage);
  const test::PatchSampler sampler(Refiner(cage, {level}).make_patches(cage.points));
  const auto& patches = sampler.patches();
  const std::size_t stride = std::max<std::size_t>(1, patches.bumps.size() / at_most);
  double largest = 0;
  std::size_t met = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const PatchInfo& info = patches.infos[i];
    if (info.bump == no_bump || met++ % stride != 0) continue;
    for (int y = 0; y <= 8; ++y)
      for (int x = 0; x <= 8; ++x) {
        const double s = x / 8.0, t = y / 8.0;
        largest = std::max(largest, distance(limit, info, sampler.point(i, s, t),
                                             info.u0 + s * info.du, info.v0 + t * info.dv));
      }
  }
  return largest / size_of(cage);
}

class ToleranceOfCage : public testing::TestWithParam<std::filesystem::path> {};

TEST_P(ToleranceOfCage, IsKeptWhereTheEstimateSaysSo) {
  const ControlCage cage = read_obj(GetParam().string());
  for (const int level : {2, 4}) {
    const double estimate = gregory_error(cage, level);
    EXPECT_LE(measured_error(cage, level, 60), estimate + 1e-14) << "level " << level;
  }
}

TEST_P(ToleranceOfCage, ChoosesTheLowestLevelThatKeepsIt) {
  const ControlCage cage = read_obj(GetParam().string());
  for (const double tolerance : {1e-3, 1e-5}) {
    const LevelChoice choice = choose_level(cage, tolerance, 6);
    EXPECT_EQ(choice.error, gregory_error(cage, choice.isolation_level));
    EXPECT_TRUE(choice.error <= tolerance || choice.isolation_level == 6);
    if (choice.isolation_level > lowest_chosen_level) {
      EXPECT_GT(gregory_error(cage, choice.isolation_level - 1), tolerance);
    }
  }
}

std::vector<std::filesystem::path> files() {
  std::vector<std::filesystem::path> all = test::cage_files();
  for (const auto& file : test::model_files())
    if (std::filesystem::file_size(file) < 17'000) all.push_back(file);
  return all;
}
std::string case_name(const testing::TestParamInfo<std::filesystem::path>& parameter) {
  return test::test_name(parameter.param) + "_" + std::to_string(parameter.index);
}
INSTANTIATE_TEST_SUITE_P(Files, ToleranceOfCage, testing::ValuesIn(files()), case_name);

TEST(Tolerance, DecidesUnlessALevelIsGiven) {
  Scene scene;
  const ControlCage cage = read_obj(test::cage_file("cube").string());
  scene.add_mesh(cage);
  scene.add_mesh(cage, {3});
  scene.add_mesh(cage, {0, {}, 1e-3});
  scene.add_mesh(cage, {0, {}, 1e-7});
  const int expected[] = {5, 3, 2, 8};
  for (std::uint32_t id = 0; id < 4; ++id)
    EXPECT_EQ(scene.mesh_statistics(id).isolation_level, expected[id]);
  EXPECT_GT(scene.mesh_statistics(0).limit_error, 1e-7);
  EXPECT_LT(scene.mesh_statistics(0).limit_error, 1e-5);
  EXPECT_LT(scene.mesh_statistics(3).limit_error, 1e-7);
}

TEST(Tolerance, OutOfReachIsReported) {
  Scene scene;
  scene.add_mesh(read_obj(test::cage_file("pole_48").string()));
  EXPECT_EQ(scene.mesh_statistics(0).isolation_level, 6);
  EXPECT_GT(scene.mesh_statistics(0).limit_error, 1e-4);
}

TEST(Tolerance, FollowsMovedPoints) {
  Scene scene;
  ControlCage cage = read_obj(test::cage_file("cube").string());
  scene.add_mesh(cage, {3});
  const double before = scene.mesh_statistics(0).limit_error;
  for (Vec3d& p : cage.points) p.z *= 1e-3;
  scene.update_points(0, cage.points);
  EXPECT_LT(scene.mesh_statistics(0).limit_error, 0.01 * before);
}

TEST(Tolerance, IsFreeWhereAllPatchesAreExact) {
  Scene scene;
  scene.add_mesh(read_obj(test::cage_file("torus").string()));
  EXPECT_EQ(scene.mesh_statistics(0).isolation_level, lowest_chosen_level);
  EXPECT_EQ(scene.mesh_statistics(0).limit_error, 0);
}

}  // namespace
}  // namespace limitray

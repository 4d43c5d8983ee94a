// Scene::update_points writes in place what a new scene with the same points would hold, bit for
// bit, and leaves no trace where it fails.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <vector>

#include "cage_files.h"
#include "limitray/bvh/builder.h"
#include "limitray/cage/obj.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}
template <class T>
bool same(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

/// Boxes of the leaves; each box must contain those below it.
std::vector<Box> boxes_of_leaves(const MeshData& mesh) {
  std::vector<Box> leaves(mesh.nets.size());
  const auto walk = [&](const auto& self, std::uint32_t node) -> Box {
    Box all;
    const BvhNode& n = mesh.nodes[node];
    for (int k = 0; k < bvh_width; ++k) {
      if (n.lo[0][k] == beyond_all.lo[0]) continue;
      Box box;
      for (int c = 0; c < 3; ++c) box.lo[c] = n.lo[c][k], box.hi[c] = n.hi[c][k];
      if (n.child[k] & leaf_flag)
        leaves[n.child[k] & ~leaf_flag] = box;
      else
        EXPECT_TRUE(same(box, self(self, n.child[k])));
      all.add(box);
    }
    return all;
  };
  if (mesh.nodes) walk(walk, 0);
  return leaves;
}

/// Everything that is read of each patch, by patch id.
struct PatchData {
  PatchNet<float> net;
  PatchBump<float> bump{};
  PatchModel<float> model;
  PatchInfo info;
  Box box;
};
std::map<std::uint32_t, PatchData> patches_of(const MeshData& mesh) {
  const std::vector<Box> boxes = boxes_of_leaves(mesh);
  std::map<std::uint32_t, PatchData> patches;
  for (std::size_t i = 0; i < mesh.nets.size(); ++i) {
    PatchData p{mesh.nets[i], {}, mesh.models[i], mesh.infos[i], boxes[i]};
    if (p.info.bump != no_bump) p.bump = mesh.bumps[p.info.bump], p.info.bump = 0;
    EXPECT_TRUE(patches.emplace(mesh.patch_ids[i], p).second);
  }
  return patches;
}

ControlCage moved(ControlCage cage) {
  for (Vec3d& p : cage.points)
    p = p + Vec3d{3 + 0.2 * std::sin(5 * p.y), 0.1 * p.z * p.z, -0.3 * p.x * p.y};
  return cage;
}

class SceneUpdateTest : public testing::TestWithParam<const char*> {
 protected:
  ControlCage cage = read_obj(test::cage_file(GetParam()));
};

TEST_P(SceneUpdateTest, GivesTheBitsOfARebuild) {
  const ControlCage bent = moved(cage);
  Scene updated(2), rebuilt(1);
  updated.add_mesh(cage, {4});
  updated.update_points(0, bent.points);
  rebuilt.add_mesh(bent, {4});
  const MeshData a = updated.mesh_data(0), b = rebuilt.mesh_data(0);
  EXPECT_TRUE(same(a.center, b.center));
  EXPECT_EQ(a.radius, b.radius);
  const auto patches = patches_of(a), expected = patches_of(b);
  ASSERT_EQ(patches.size(), expected.size());
  ASSERT_GT(patches.size(), 50u);
  for (const auto& [id, p] : expected) {
    const PatchData& q = patches.at(id);
    ASSERT_TRUE(same(p.net, q.net) && same(p.bump, q.bump) && same(p.info, q.info)) << id;
    ASSERT_TRUE(same(p.model, q.model) && same(p.box, q.box)) << id;
  }
}

TEST_P(SceneUpdateTest, ThatFailsLeavesTheSceneAsItWas) {
  Scene scene(2);
  Affine large;
  for (int i = 0; i < 3; ++i) large.linear[std::size_t(i)][i] = 1e6;
  scene.add_mesh(cage, {3, large});
  const MeshData mesh = scene.mesh_data(0);
  const std::vector<PatchNet<float>> nets(mesh.nets.begin(), mesh.nets.end());
  const std::vector<PatchBump<float>> bumps(mesh.bumps.begin(), mesh.bumps.end());
  const std::vector<PatchModel<float>> models(mesh.models.begin(), mesh.models.end());
  const std::vector<BvhNode> nodes(mesh.nodes, mesh.nodes + mesh.node_count);
  const std::array<Vec3d, 2> bounds = scene.bounds();
  std::vector<Vec3d> far = cage.points;
  for (Vec3d& p : far) p = 1e13 * p;
  EXPECT_THROW(scene.update_points(0, far), std::invalid_argument);  // too large once placed
  const MeshData after = scene.mesh_data(0);
  EXPECT_TRUE(same(after.nets, std::span(nets)));
  EXPECT_TRUE(same(after.bumps, std::span(bumps)));
  EXPECT_TRUE(same(after.models, std::span(models)));
  EXPECT_TRUE(same(std::span(after.nodes, after.node_count), std::span(nodes)));
  EXPECT_TRUE(same(scene.bounds(), bounds));
}

INSTANTIATE_TEST_SUITE_P(Cages, SceneUpdateTest,
                         testing::Values("demo", "cube_semi_2_5", "pole_8", "open_fan"));

}  // namespace
}  // namespace limitray

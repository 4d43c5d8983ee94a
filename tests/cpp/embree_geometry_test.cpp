// The adapter (embree_geometry.h) and a Scene of the same cage give the same hits: what the two
// trees and the arithmetic of t may change is bounded, everything else is equal.
#include "limitray/embree_geometry.h"

#include <gtest/gtest.h>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <vector>

#include "cage_files.h"
#include "limitray/cage/obj.h"
#include "limitray/scene.h"

namespace limitray {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr int isolation_level = 3;

#if RTC_VERSION_MAJOR >= 4
void intersect(RTCScene scene, RTCRayHit& query) { rtcIntersect1(scene, &query); }
void occluded(RTCScene scene, RTCRay& ray) { rtcOccluded1(scene, &ray); }
#else
void intersect(RTCScene scene, RTCRayHit& query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
}
void occluded(RTCScene scene, RTCRay& ray) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
}
#endif

/// Rays from a sphere around the scene towards points of its bounds, tnear and tfar with them.
struct Rays {
  std::vector<float> rays, tnear, tfar;

  explicit Rays(const Scene& scene) {
    const auto [low, high] = scene.bounds();
    const Vec3d middle = 0.5 * (low + high);
    const double reach = length(high - low);
    std::mt19937 random(7);
    std::normal_distribution<double> gauss;
    std::uniform_real_distribution<double> uniform;
    for (int i = 0; i < 4000; ++i) {
      const Vec3d d{gauss(random), gauss(random), gauss(random)};
      const Vec3d org = middle + (reach / length(d)) * d;
      Vec3d target;
      for (int axis = 0; axis < 3; ++axis)
        target[axis] = low[axis] + uniform(random) * (high[axis] - low[axis]);
      for (int axis = 0; axis < 3; ++axis) rays.push_back(float(org[axis]));
      for (int axis = 0; axis < 3; ++axis) rays.push_back(float(target[axis] - org[axis]));
      tnear.push_back(i % 3 ? 0 : 1);  // every third starts inside the bounds
      tfar.push_back(i % 4 ? infinity : 1);
    }
  }
  std::size_t size() const { return tnear.size(); }
  RayBatch<float> batch() const { return {rays, tnear, tfar}; }

  RTCRay ray(std::size_t i) const {
    RTCRay r{};
    const float* p = rays.data() + 6 * i;
    r.org_x = p[0], r.org_y = p[1], r.org_z = p[2];
    r.dir_x = p[3], r.dir_y = p[4], r.dir_z = p[5];
    r.tnear = tnear[i], r.tfar = tfar[i];
    r.mask = 0xFFFFFFFFu;
    return r;
  }
};

/// What Scene answers.
struct SceneHits {
  std::vector<float> t, t_error, uv, normal;
  std::vector<std::uint32_t> face, sub_quad;
  std::vector<std::uint8_t> occluded;

  SceneHits(const Scene& scene, const Rays& rays)
      : t(rays.size()),
        t_error(rays.size()),
        uv(2 * rays.size()),
        normal(3 * rays.size()),
        face(rays.size()),
        sub_quad(rays.size()),
        occluded(rays.size()) {
    HitArrays<float> out;
    out.t = t.data(), out.t_error = t_error.data();
    out.primitive_id = face.data(), out.sub_quad = sub_quad.data();
    out.uv = uv.data(), out.normal = normal.data();
    scene.cast_rays(rays.batch(), out);
    scene.test_occlusions(rays.batch(), occluded.data());
  }
};

/// A committed robust Embree scene with one surface of ours.
class EmbreeWorld {
 public:
  explicit EmbreeWorld(const ControlCage& cage) : surface_(cage, isolation_level) {
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
    id_ = surface_.attach(device_.get(), scene_.get());
    rtcCommitScene(scene_.get());
  }
  RTCScene scene() const { return scene_.get(); }
  unsigned id() const { return id_; }
  const EmbreeGeometry& surface() const { return surface_; }

 private:
  EmbreeGeometry surface_;
  std::unique_ptr<RTCDeviceTy, void (*)(RTCDevice)> device_{rtcNewDevice(nullptr),
                                                            rtcReleaseDevice};
  std::unique_ptr<RTCSceneTy, void (*)(RTCScene)> scene_{rtcNewScene(device_.get()),
                                                         rtcReleaseScene};
  unsigned id_ = RTC_INVALID_GEOMETRY_ID;
};

Scene scene_of(const ControlCage& cage) {
  Scene scene(1);
  scene.add_mesh(cage, {isolation_level});
  return scene;
}

/// Compares all that a hit has; rays that meet an edge of two faces may get either.
void expect_same_hits(const ControlCage& cage) {
  const Scene scene = scene_of(cage);
  const Rays rays(scene);
  const SceneHits ours(scene, rays);
  const EmbreeWorld world(cage);
  std::size_t hits = 0, other_faces = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RTCRayHit query{};
    query.ray = rays.ray(i);
    query.hit.geomID = query.hit.primID = RTC_INVALID_GEOMETRY_ID;
    intersect(world.scene(), query);
    RTCRay shadow = rays.ray(i);
    occluded(world.scene(), shadow);
    const bool hit = query.hit.geomID == world.id();
    ASSERT_EQ(hit, std::isfinite(ours.t[i])) << "ray " << i;
    ASSERT_EQ(shadow.tfar == -infinity, ours.occluded[i] == 1) << "ray " << i;
    if (!hit) continue;
    ++hits;
    ASSERT_NEAR(query.ray.tfar, ours.t[i], 2 * ours.t_error[i]) << "ray " << i;
    if (query.hit.primID != ours.face[i]) {
      ++other_faces;
      continue;
    }
    SubQuadUv at{0, query.hit.u, query.hit.v};
    if (cage.face_vertex_counts[query.hit.primID] != 4) at = decode_uv(query.hit.u, query.hit.v);
    if (at.sub_quad != ours.sub_quad[i]) {
      ++other_faces;
      continue;
    }
    ASSERT_NEAR(at.u, ours.uv[2 * i], 1e-3) << "ray " << i;
    ASSERT_NEAR(at.v, ours.uv[2 * i + 1], 1e-3) << "ray " << i;
    const Vec3f n{query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z};
    const Vec3f m{ours.normal[3 * i], ours.normal[3 * i + 1], ours.normal[3 * i + 2]};
    ASSERT_NEAR(length(n), 1, 1e-5) << "ray " << i;
    ASSERT_GT(dot(n, m), 0.999) << "ray " << i;
  }
  EXPECT_GT(hits, rays.size() / 10);
  EXPECT_LE(other_faces, hits / 500);
}

class EmbreeGeometryTest : public testing::TestWithParam<const char*> {};

TEST_P(EmbreeGeometryTest, HitsAreThoseOfScene) {
  expect_same_hits(read_obj(test::cage_file(GetParam()).string()));
}

TEST_P(EmbreeGeometryTest, LeftHandedHitsToo) {
  ControlCage cage = read_obj(test::cage_file(GetParam()).string());
  cage.orientation = Orientation::left_handed;
  expect_same_hits(cage);
}

TEST_P(EmbreeGeometryTest, FarFromZero) {
  ControlCage cage = read_obj(test::cage_file(GetParam()).string());
  for (Vec3d& p : cage.points) p = p + Vec3d{100, -50, 30};
  expect_same_hits(cage);
}

// Quads, creases, poles, open rims, triangles, pentagons.
INSTANTIATE_TEST_SUITE_P(Cages, EmbreeGeometryTest,
                         testing::Values("cube", "torus_creases", "pole_8", "sheet_edge_only",
                                         "icosahedron", "prism_5"),
                         [](const auto& cage) { return std::string(cage.param); });

TEST(EmbreeGeometryTest, LeftHandedTurnsNormals) {
  ControlCage cage = read_obj(test::cage_file("cube").string());
  Vec3f normal[2];
  for (const bool left : {false, true}) {
    cage.orientation = left ? Orientation::left_handed : Orientation::right_handed;
    const EmbreeWorld world(cage);
    RTCRayHit query{};
    query.ray.org_x = 0.1f, query.ray.org_y = 0.2f, query.ray.org_z = 5;
    query.ray.dir_z = -1, query.ray.tfar = infinity, query.ray.mask = 0xFFFFFFFFu;
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    intersect(world.scene(), query);
    ASSERT_EQ(query.hit.geomID, world.id());
    normal[left] = {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z};
  }
  EXPECT_EQ(normal[0].z, -normal[1].z);
  EXPECT_GT(normal[0].z, 0.9f);
}

TEST(EmbreeGeometryTest, DecodesEachSubQuad) {
  for (std::uint32_t sub_quad : {0u, 1u, 3u, 4u, 7u, 15u, 62u})
    for (float u : {0.0f, 0.25f, 1.0f}) {
      const SubQuadUv at =
          decode_uv(2 * float(sub_quad % 4) + 0.5f + u, 2 * float(sub_quad / 4) + 0.5f + (1 - u));
      EXPECT_EQ(at.sub_quad, sub_quad);
      EXPECT_EQ(at.u, u);
      EXPECT_EQ(at.v, 1 - u);
    }
}

TEST(EmbreeGeometryTest, MovingKeepsTheSurface) {
  EmbreeGeometry first(read_obj(test::cage_file("cube").string()), isolation_level);
  const std::size_t bytes = first.bytes();
  EXPECT_GT(bytes, 0u);
  const EmbreeGeometry second = std::move(first);
  EXPECT_EQ(second.bytes(), bytes);
}

TEST(EmbreeGeometryTest, RejectsWhatSceneRejects) {
  ControlCage cage = read_obj(test::cage_file("cube").string());
  cage.points[3].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(EmbreeGeometry(cage, isolation_level), std::invalid_argument);
}

}  // namespace
}  // namespace limitray

// libFuzzer target: a cage with tags out of any bytes is refused with a message, or becomes a scene
// whose answers are numbers in range, the same for every query that can be compared.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <vector>

#include "fuzz_cage.h"
#include "limitray/cage/limit.h"
#include "limitray/scene.h"

namespace limitray::fuzz {
namespace {

void require(bool holds, const char* rule) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", rule);
  std::abort();
}

/// Rays whose lines pass near the scene's bounds, some exactly along an axis; any numbers, too.
std::vector<double> take_rays(ByteReader& bytes, const std::array<Vec3d, 2>& bounds, int count) {
  const Vec3d middle = 0.5 * bounds[0] + 0.5 * bounds[1], half = 0.5 * bounds[1] - 0.5 * bounds[0];
  std::vector<double> rays;
  for (int i = 0; i < count; ++i) {
    if (bytes.below(16) == 15) {
      for (int k = 0; k < 6; ++k) rays.push_back(bytes.take<double>());
      continue;
    }
    double at[3], from[3];
    const bool along_axis = bytes.below(4) == 0;
    const int axis = i % 3;
    for (int k = 0; k < 3; ++k) {
      at[k] = middle[k] + half[k] * bytes.step() / 120.0;
      from[k] = middle[k] + half[k] * bytes.step() / 40.0;
      if (along_axis && k != axis) from[k] = at[k];
    }
    rays.insert(rays.end(), from, from + 3);
    for (int k = 0; k < 3; ++k) rays.push_back(at[k] - from[k]);
  }
  return rays;
}

/// The answers to n rays, all of them asked for.
template <class T>
struct Answers {
  std::vector<T> t, t_error, uv, normal, point, dp_du, dp_dv;
  std::vector<std::uint32_t> geometry, face, sub_quad, patch;

  explicit Answers(std::size_t n)
      : t(n),
        t_error(n),
        uv(2 * n),
        normal(3 * n),
        point(3 * n),
        dp_du(3 * n),
        dp_dv(3 * n),
        geometry(n),
        face(n),
        sub_quad(n),
        patch(n) {}
  HitArrays<T> arrays() {
    return {t.data(),  t_error.data(), geometry.data(), face.data(),  sub_quad.data(), patch.data(),
            uv.data(), normal.data(),  point.data(),    dp_du.data(), dp_dv.data()};
  }
};

template <class T>
void check_numbers(const Answers<T>& a, std::size_t i, const ControlCage& cage,
                   std::size_t patches) {
  require(a.t[i] > 0 && a.t_error[i] >= 0, "0 < t and 0 <= t_error");
  require(a.geometry[i] == 0 && a.patch[i] < patches, "ids in range");
  require(a.face[i] < cage.face_count(), "face in range");
  const std::uint32_t sides = static_cast<std::uint32_t>(cage.face_vertex_counts[a.face[i]]);
  require(a.sub_quad[i] < (sides == 4 ? 1 : sides), "sub-quad in range");
  for (std::size_t k = 2 * i; k < 2 * i + 2; ++k)
    require(a.uv[k] >= 0 && a.uv[k] <= 1, "(u,v) in [0,1]^2");
  double length = 0;
  for (std::size_t k = 3 * i; k < 3 * i + 3; ++k) {
    require(std::isfinite(a.point[k]) && std::isfinite(a.dp_du[k]) && std::isfinite(a.dp_dv[k]),
            "points and derivatives are finite");
    length += static_cast<double>(a.normal[k]) * static_cast<double>(a.normal[k]);
  }
  require(length == 0 || std::abs(length - 1) < 1e-4, "normals are unit, or 0 where none exist");
}

template <class T>
void check_hits(const Scene& scene, const ControlCage& cage, const std::vector<double>& in_double,
                std::size_t patches) {
  const std::vector<T> rays(in_double.begin(), in_double.end());
  const T near = 0, far = std::numeric_limits<T>::infinity();
  const RayBatch<T> batch{rays, {&near, 1}, {&far, 1}};
  Answers<T> a(batch.size());
  std::vector<std::uint8_t> occluded(batch.size());
  scene.cast_rays(batch, a.arrays());
  scene.test_occlusions(batch, occluded.data());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    require(!std::isnan(a.t[i]), "t is a number");
    require(occluded[i] == std::isfinite(a.t[i]), "occluded where hit");
    if (occluded[i]) check_numbers(a, i, cage, patches);
  }
}

void check_counts(const Scene& scene, const std::vector<double>& rays) {
  const double near = 0, far = std::numeric_limits<double>::infinity();
  const RayBatch<double> batch{rays, {&near, 1}, {&far, 1}};
  std::vector<std::uint32_t> counts(batch.size());
  std::vector<double> t(batch.size());
  HitArrays<double> hits;
  hits.t = t.data();
  scene.cast_rays(batch, hits);
  scene.count_intersections(batch, counts.data());
  const IntersectionList list = scene.list_intersections(batch);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    require((counts[i] > 0) == std::isfinite(t[i]), "intersections are counted where hit");
    require(list.offsets[i + 1] - list.offsets[i] == counts[i], "as many listed as counted");
  }
}

/// The tracer's independent oracle, on the middle of each face.
void check_limit(const ControlCage& cage) {
  const LimitEvaluator limit(cage);
  for (std::size_t face = 0; face < cage.face_count(); ++face) {
    try {
      const LimitSample s = limit.evaluate(static_cast<std::int32_t>(face), 0, 0.5, 0.25);
      for (int k = 0; k < 3; ++k)
        require(std::isfinite(s.point[k]) && std::isfinite(s.normal[k]), "the limit is finite");
    } catch (const std::invalid_argument&) {
      continue;  // a hole
    }
  }
}

void check_primvar(const Scene& scene, const ControlCage& cage) {
  for (const Primvar& primvar : cage.primvars) {
    std::vector<double> values(primvar.width), d_du(primvar.width), d_dv(primvar.width);
    for (std::uint32_t face = 0; face < cage.face_count(); ++face) {
      const std::uint32_t id = 0, sub_quad = 0;
      const double uv[] = {0.25, 1};
      try {
        scene.evaluate_primvar(primvar.name, {{&id, 1}, {&face, 1}, {&sub_quad, 1}, uv},
                               values.data(), d_du.data(), d_dv.data());
      } catch (const std::invalid_argument&) {
        continue;  // a hole
      }
      for (const double x : values) require(std::isfinite(x), "primvars are finite");
    }
  }
}

void run(ByteReader bytes) {
  MeshOptions options;
  options.isolation_level = bytes.below(6);  // 0: chosen
  const bool newton = bytes.below(8) != 0;
  const ControlCage cage = take_cage(bytes);
  Scene scene(1);
  try {
    scene.add_mesh(cage, options);
  } catch (const std::invalid_argument& error) {
    require(error.what()[0] != 0, "errors say what is wrong");
    return;
  }
  scene.set_newton(newton);
  check_primvar(scene, cage);
  check_limit(cage);
  const std::size_t patches = scene.mesh_statistics(0).patches;
  if (patches == 0) return;
  const std::vector<double> rays = take_rays(bytes, scene.bounds(), 8);
  check_hits<float>(scene, cage, rays, patches);
  check_hits<double>(scene, cage, rays, patches);
  check_counts(scene, rays);
}

}  // namespace
}  // namespace limitray::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  limitray::fuzz::run(limitray::fuzz::ByteReader({data, size}));
  return 0;
}

// How far hits are from the true limit surface: prints the tables of docs/accuracy.md, section 6.
//
//   accuracy [--hits N]
//
// The truth is LimitEvaluator, which shares no code with the patches or the tracer. For each hit
// (in double, aimed along the surface's normal) the nearest point of the limit is found by Newton
// steps from the hit's face and (u,v), and the distance along the normal there and the angle
// between the normals are noted: at equal (u,v) a Gregory patch is elsewhere, being parametrized
// differently.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "../tests/support/cast.h"
#include "../tests/support/random_patches.h"
#include "../tests/support/surface_targets.h"
#include "limitray/cage/limit.h"
#include "limitray/cage/obj.h"
#include "limitray/scene.h"

namespace {

using limitray::ControlCage;
using limitray::LimitEvaluator;
using limitray::LimitSample;
using limitray::Vec3d;
namespace test = limitray::test;

/// A dome of n sectors of 3 x 3 quads around a vertex of valence n: all others are regular.
ControlCage pole(int n) {
  ControlCage cage;
  cage.points.push_back({0, 0, 0});
  // Point (j,k) of a sector, j = 1..3, k = 0..3; (0,k) is (k,0) of the next one.
  for (int sector = 0; sector < n; ++sector)
    for (int j = 1; j <= 3; ++j)
      for (int k = 0; k <= 3; ++k) {
        const double angle = 2 * 3.14159265358979323846 / n * (sector + double(k) / (j + k));
        const double r = std::max(j, k) / 3.0;
        cage.points.push_back({r * std::cos(angle), r * std::sin(angle), -0.3 * r * r});
      }
  const auto at = [&](int sector, int j, int k) {
    if (j + k == 0) return 0;
    return j == 0 ? 1 + (sector + 1) % n * 12 + (k - 1) * 4 : 1 + sector * 12 + (j - 1) * 4 + k;
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k)
        cage.face_vertex_indices.insert(
            cage.face_vertex_indices.end(),
            {at(i, j, k), at(i, j + 1, k), at(i, j + 1, k + 1), at(i, j, k + 1)});
  cage.face_vertex_counts.assign(cage.face_vertex_indices.size() / 4, 4);
  return cage;
}

struct Deviation {
  double distance = 0, angle = 0;  // largest, in longest sides of the box, and degrees
  void add(const Deviation& d) {
    distance = std::max(distance, d.distance), angle = std::max(angle, d.angle);
  }
};

/// Newton steps on the limit towards the point nearest to `x`, inside the face.
LimitSample nearest(const LimitEvaluator& limit, int face, int sub_quad, double u, double v,
                    const Vec3d& x) {
  LimitSample s = limit.evaluate(face, sub_quad, u, v);
  for (int step = 0; step < 4; ++step) {
    const Vec3d off = x - s.point;
    const double a = dot(s.dp_du, s.dp_du), b = dot(s.dp_du, s.dp_dv), c = dot(s.dp_dv, s.dp_dv);
    const double det = a * c - b * b, p = dot(off, s.dp_du), q = dot(off, s.dp_dv);
    if (!(det > 1e-12 * a * c)) break;
    u = std::clamp(u + (c * p - b * q) / det, 0.0, 1.0);
    v = std::clamp(v + (a * q - b * p) / det, 0.0, 1.0);
    s = limit.evaluate(face, sub_quad, u, v);
  }
  return s;
}

struct Result {
  Deviation bezier, gregory;
  std::size_t patches = 0, gregory_patches = 0;
};

Result measure(const ControlCage& cage, int level, int count) {
  limitray::Scene scene(1);
  scene.add_mesh(cage, {level});
  const auto [lo, hi] = scene.bounds();
  const double side = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
  const test::SurfaceTargets targets(limitray::Refiner(cage, {level}).make_patches(cage.points));
  const LimitEvaluator limit(cage);
  test::Generator g{9};
  test::Rays<double> rays;
  std::vector<std::size_t> irregular;
  for (std::size_t i = 0; i < targets.patches().size(); ++i)
    if (targets.patches().infos[i].bump != limitray::no_bump) irregular.push_back(i);
  for (int i = 0; i < count; ++i) {
    // Half of the hits on Gregory patches, where there are some.
    const bool on_gregory = i % 2 && !irregular.empty();
    const test::Target t =
        on_gregory
            ? targets.at(irregular[g() % irregular.size()], test::unit_random(g),
                         test::unit_random(g))
            : targets.pick(i % 4 ? test::TargetKind::interior : test::TargetKind::patch_edge, g);
    const Vec3d tilted = t.normal + 0.1 * test::random_direction(g);
    rays.aim(t.point + 0.01 * side * tilted, t.point);
  }
  const auto hits = test::cast(scene, rays);
  Result result;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!hits.hit(i)) continue;
    const Vec3d x = rays.at(i, hits.t[i]);
    const LimitSample s = nearest(limit, int(hits.primitive_id[i]), int(hits.sub_quad[i]),
                                  hits.uv[2 * i], hits.uv[2 * i + 1], x);
    const Vec3d n{hits.normal[3 * i], hits.normal[3 * i + 1], hits.normal[3 * i + 2]};
    const double sine = length(cross(n, s.normal));
    const Deviation d{std::abs(dot(x - s.point, s.normal)) / side,
                      std::asin(std::min(sine, 1.0)) * 57.29577951308232};
    const bool gregory = targets.patches().infos[hits.patch_id[i]].bump != limitray::no_bump;
    (gregory ? result.gregory : result.bezier).add(d);
  }
  result.patches = targets.patches().size();
  result.gregory_patches = targets.patches().bumps.size();
  return result;
}

void valence_table(int hits) {
  const int levels[] = {2, 3, 4, 6, 8};
  std::printf("| valence |");
  for (const int level : levels) std::printf(" level %d |", level);
  std::printf("\n|---|---|---|---|---|---|\n");
  for (const int n : {3, 5, 6, 7, 8, 10, 12, 16, 20, 32, 48, 50}) {
    std::printf("| %d |", n);
    for (const int level : levels) {
      const Deviation d = measure(pole(n), level, hits).gregory;
      std::printf(" %.1e, %.2g° |", d.distance, d.angle);
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

void cage_table(int hits) {
  std::printf("\n| cage | level | patches | of them Gregory | Bezier | Gregory |\n");
  std::printf("|---|---|---|---|---|---|\n");
  const char* names[] = {"cube",          "cube_semi_0_3",   "cube_semi_1",
                         "cube_semi_2_5", "cube_semi_3_7",   "cube_semi_9",
                         "cube_inf_loop", "cube_inf_chain",  "cube_chaikin",
                         "cube_corners",  "dart_semi",       "dart_infinite",
                         "sheet_none",    "sheet_edge_only", "sheet_edge_and_corner",
                         "sheet_creased", "prism_6",         "tetrahedron",
                         "torus_creases", "pole_creased",    "icosahedron_smooth",
                         "demo"};
  for (const char* name : names)
    for (const int level : {3, 5}) {
      const std::string file = std::string(LIMITRAY_TEST_CAGES) + "/" + name + ".obj";
      const Result r = measure(limitray::read_obj(file), level, hits);
      std::printf("| %s | %d | %zu | %zu | %.1e, %.1g° |", name, level, r.patches,
                  r.gregory_patches, r.bezier.distance, r.bezier.angle);
      if (r.gregory_patches)
        std::printf(" %.1e, %.2g° |\n", r.gregory.distance, r.gregory.angle);
      else
        std::printf(" |\n");
      std::fflush(stdout);
    }
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + std::ptrdiff_t(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// Float against double on the same rays, from all around; distances in longest sides of the box.
void precision_table(int count) {
  std::printf(
      "\n| cage | hits | error, median | largest | t_error, median | largest | "
      "before | behind |\n");
  std::printf("|---|---|---|---|---|---|---|---|\n");
  for (const char* name : {"cube", "cube_semi_2_5", "icosahedron", "pole_12", "torus", "demo"}) {
    limitray::Scene scene(1);
    scene.add_mesh(limitray::read_obj(std::string(LIMITRAY_TEST_CAGES) + "/" + name + ".obj"), {4});
    const auto [lo, hi] = scene.bounds();
    const double side = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
    test::Generator g{11};
    test::Rays<float> rays;
    test::Rays<double> exact;
    for (int i = 0; i < 25 * count; ++i) {
      const Vec3d center = 0.5 * (lo + hi);
      rays.aim(center + 2 * side * test::random_direction(g),
               center + 0.3 * side * test::random_direction(g));
      exact.add(rays.org(std::size_t(i)), rays.dir(std::size_t(i)));
    }
    const auto f = test::cast(scene, rays);
    const auto d = test::cast(scene, exact);
    std::vector<double> errors, bounds;
    int before = 0, behind = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!f.hit(i) || !d.hit(i)) continue;
      const double scale = length(rays.dir(i)) / side;
      errors.push_back(std::abs(double(f.t[i]) - d.t[i]) * scale);
      bounds.push_back((double(f.t_error[i]) + d.t_error[i]) * scale);
      if (errors.back() > bounds.back()) ++(double(f.t[i]) < d.t[i] ? before : behind);
    }
    std::printf("| %s | %zu | %.1e | %.1e | %.1e | %.1e | %d | %d |\n", name, errors.size(),
                median(errors), *std::max_element(errors.begin(), errors.end()), median(bounds),
                *std::max_element(bounds.begin(), bounds.end()), before, behind);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int count, char** arguments) {
  int hits = 4000;
  if (count == 3 && std::string(arguments[1]) == "--hits") {
    hits = std::atoi(arguments[2]);
  } else if (count != 1) {
    std::fprintf(stderr, "usage: accuracy [--hits N]\n");
    return 2;
  }
  std::printf(
      "%d hits a place of the table; largest distance, in longest sides of the box; "
      "largest angle of normals\n\n",
      hits);
  valence_table(hits);
  cage_table(hits);
  precision_table(hits);
  return 0;
}

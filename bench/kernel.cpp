// One patch, one ray: what each outcome and each step costs, in time that does not depend on a
// scene.
//
//   kernel.<isa> [--benchmark_filter=REGEX] [--benchmark_repetitions=N]
//
// Compiled once for each instruction set of this machine. Times are a ray's (or a step's); counters
// behind them are the work a ray. Rays and subdomains come from arrays of random ones, so that
// branches are as hard to guess as in a scene.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "limitray/cage/obj.h"
#include "limitray/intersect/intersect_patch.h"
#include "limitray/patches/patch_model.h"
#include "limitray/patches/refine.h"

namespace {

using namespace limitray;

constexpr std::size_t ray_count = 1024;

enum class Kind { hit, miss, grazing };

/// A patch of a cage in float, and what the kernels read beside it.
struct Subject {
  PatchNet<float> net;
  PatchBump<float> bump_values{};
  bool gregory;
  PatchModel<float> model;
  Extent extent;

  const PatchBump<float>* bump() const { return gregory ? &bump_values : nullptr; }
};

/// The first regular patch, or the first Gregory patch, of a cage with a vertex of valence 5.
Subject make_subject(bool gregory) {
  const ControlCage cage = read_obj(LIMITRAY_TEST_CAGES "/pole_5.obj");
  const auto patches = round_patches<float>(Refiner(cage, {3}).make_patches(cage.points));
  std::size_t i = 0;
  while ((patches.infos.at(i).bump != no_bump) != gregory) ++i;
  Subject s;
  s.net = patches.nets[i];
  s.gregory = gregory;
  if (gregory) s.bump_values = patches.bumps[patches.infos[i].bump];
  s.model = make_patch_model(s.net, s.bump());
  const double r = patches.radius;
  s.extent = {{}, {r, r, r}, r};
  return s;
}
const Subject& subject(bool gregory) {
  static const Subject both[2] = {make_subject(false), make_subject(true)};
  return both[gregory];
}

/// Rays at random places of the patch: of all hits from all sides; misses pass beside it by a tenth
/// to one of its size; grazing rays are within a degree of its tangent plane.
std::vector<ObjectRay> make_rays(const Subject& s, Kind kind) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> gauss;
  const auto& a = s.model.axis;
  const Vec3d p{a[0].p, a[1].p, a[2].p}, p_u{a[0].p_u, a[1].p_u, a[2].p_u},
      p_v{a[0].p_v, a[1].p_v, a[2].p_v};
  const Vec3d n = (1 / length(cross(p_u, p_v))) * cross(p_u, p_v);
  const double size = std::max(length(p_u), length(p_v));
  std::vector<ObjectRay> rays;
  while (rays.size() < ray_count) {
    double u = uniform(random) - 0.5, v = uniform(random) - 0.5;
    if (kind == Kind::miss) u += u < 0 ? -0.6 : 0.6;
    Vec3d side{gauss(random), gauss(random), gauss(random)};
    side = (1 / length(side)) * side;
    if (kind != Kind::grazing) side = side + 1.5 * n;
    if (kind == Kind::grazing) side = side - dot(side, n) * n + 0.015 * uniform(random) * n;
    ObjectRay ray;
    ray.org = p + u * p_u + v * p_v + 4 * size * side;
    ray.dir = -1.0 * side;
    rays.push_back(ray);
  }
  return rays;
}

std::vector<PatchRay<float>> set_up(const Subject& s, const std::vector<ObjectRay>& rays) {
  std::vector<PatchRay<float>> out;
  PatchRay<float> r;
  for (const ObjectRay& ray : rays)
    if (make_patch_ray(ray, s.extent, r)) out.push_back(r);
  return out;
}

void add_counts(benchmark::State& state, const PatchCounters& c, std::size_t hits) {
  const auto per_ray = benchmark::Counter::kAvgIterations;
  const auto add = [&](const char* name, double n) {
    state.counters[name] = benchmark::Counter(n, per_ray);
  };
  add("hits", double(hits));
  add("early_outs", c.early_outs);
  add("newton_runs", c.newton_runs);
  add("newton_steps", c.newton_steps);
  add("splits", c.splits);
  add("backtracks", c.backtracks);
}

template <bool use_newton>
void intersect(benchmark::State& state, bool gregory, Kind kind) {
  const Subject& s = subject(gregory);
  const auto rays = set_up(s, make_rays(s, kind));
  PatchCounters count;
  std::size_t i = 0, hits = 0;
  for (auto _ : state) {
    const PatchRay<float>& r = rays[i++ % rays.size()];
    float zmax = r.zmax;
    bool hit = false;
    intersect_patch<float, use_newton>(
        s.net, s.bump(), s.model, r, zmax,
        [&](const PatchRoot<float>& root, float& z) {
          z = root.z;
          hit = true;
          return false;
        },
        count);
    hits += hit;
    benchmark::DoNotOptimize(zmax);
  }
  add_counts(state, count, hits);
}

/// What the steps start from: a patch in the frame of one ray, and a subdomain's place in it.
struct Place {
  PatchRay<float> ray;
  ProjectedModel<float> model;
  RootPatch<float> root;
  SubPatch<float> sub;
  float u, v;
};

std::vector<Place> make_places(const Subject& s) {
  std::mt19937 random(2);
  std::vector<Place> places;
  for (const PatchRay<float>& r : set_up(s, make_rays(s, Kind::hit))) {
    const ProjectedModel<float> m = project(s.model, r);
    RootPatch<float> root = to_ray_frame(s.net, s.bump(), r, m);
    to_local_frame(root, m);
    const float u = float(random() % 4) / 4, v = float(random() % 4) / 4;
    places.push_back({r, m, root, recover(root, u, v, 0.25f, 0.25f), u, v});
  }
  return places;
}

/// Times `step`(place, subject), whose answer is kept.
template <class Step>
void time_step(benchmark::State& state, bool gregory, Step step) {
  const Subject& s = subject(gregory);
  const std::vector<Place> places = make_places(s);
  std::size_t i = 0;
  for (auto _ : state) {
    auto answer = step(places[i++ % places.size()], s);
    benchmark::DoNotOptimize(answer);
  }
}

template <class Step>
void register_step(const std::string& name, Step step) {
  for (const bool gregory : {false, true})
    benchmark::RegisterBenchmark((name + (gregory ? "/gregory" : "/bezier")).c_str(),
                                 [=](benchmark::State& state) { time_step(state, gregory, step); });
}

void set_up_ray(benchmark::State& state) {
  const Subject& s = subject(false);
  const std::vector<ObjectRay> rays = make_rays(s, Kind::hit);
  std::size_t i = 0;
  for (auto _ : state) {
    PatchRay<float> r;
    bool meets = make_patch_ray(rays[i++ % rays.size()], s.extent, r);
    benchmark::DoNotOptimize(meets);
    benchmark::DoNotOptimize(r);
  }
}

/// S5: through all 256 subdomains of four levels a direction, as if each split hit both children.
void next_subdomain(benchmark::State& state) {
  Domain<std::uint32_t, std::uint64_t> domain;
  for (auto _ : state) {
    if (domain.splits() < 8)
      domain.descend(domain.splits() % 2 == 0, false, true);
    else if (!domain.next())
      domain = {};
    benchmark::DoNotOptimize(domain);
  }
}

void register_steps() {
  benchmark::RegisterBenchmark("S1_ray", set_up_ray);
  register_step("S1_project_model",
                [](const Place& p, const Subject& s) { return project(s.model, p.ray); });
  register_step("S1_patch", [](const Place& p, const Subject& s) {
    return to_ray_frame(s.net, s.bump(), p.ray, p.model);
  });
  register_step("S1_local_frame", [](const Place& p, const Subject&) {
    RootPatch<float> root = p.root;
    to_local_frame(root, p.model);
    return root;
  });
  register_step("S2_cull", [](const Place& p, const Subject&) {
    return misses(p.root, p.ray.zmin, p.ray.zmax);
  });
  register_step("S2_cull_subpatch", [](const Place& p, const Subject&) {
    return misses(p.sub, p.ray.zmin, p.ray.zmax);
  });
  register_step("S3_split", [](const Place& p, const Subject&) {
    std::array<SubPatch<float>, 2> child;
    SubPatch<float> both[2];
    split(p.root, p.sub, true, both);
    child[0] = both[0], child[1] = both[1];
    return child;
  });
  register_step("S4_is_point",
                [](const Place& p, const Subject&) { return is_point(p.root, p.sub); });
  benchmark::RegisterBenchmark("S5_next", next_subdomain);
  register_step("S6_S7_recover", [](const Place& p, const Subject&) {
    return recover(p.root, p.u, p.v, 0.25f, 0.25f);
  });
  register_step("S8_evaluate",
                [](const Place& p, const Subject&) { return evaluate(p.root, p.u, p.v); });
  register_step("S8_newton_on_model", [](const Place& p, const Subject& s) {
    PatchRoot<float> root{};
    std::uint32_t runs = 0, steps = 0;
    newton_on_model(p.model, s.model.curvature, s.net, s.bump(), p.ray, root, runs, steps);
    return root;
  });
  register_step("S8_newton_on_subpatch", [](const Place& p, const Subject&) {
    PatchRoot<float> root{};
    std::uint32_t runs = 0, steps = 0;
    newton_on_subpatch(p.root, p.sub, root, runs, steps);
    return root;
  });
}

void register_rays() {
  constexpr const char* kinds[] = {"hit", "miss", "grazing"};
  for (const bool gregory : {false, true})
    for (const Kind kind : {Kind::hit, Kind::miss, Kind::grazing}) {
      const std::string name =
          std::string("/") + kinds[int(kind)] + (gregory ? "/gregory" : "/bezier");
      benchmark::RegisterBenchmark(("ray" + name).c_str(), [=](benchmark::State& state) {
        intersect<true>(state, gregory, kind);
      });
      benchmark::RegisterBenchmark(("ray_bisection" + name).c_str(), [=](benchmark::State& state) {
        intersect<false>(state, gregory, kind);
      });
    }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  register_rays();
  register_steps();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

#include "comparison.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <stdexcept>

#include "limitray/cage/obj.h"
#include "limitray/intersect/ray_order.h"
#include "limitray/patches/gregory_error.h"
#include "limitray/patches/refine.h"
#include "limitray_tracer.h"
#include "machine.h"
#include "peers.h"

namespace limitray::bench {
namespace {

using Report = std::function<void(const std::string&)>;

struct NamedTracer {
  std::string name;
  std::unique_ptr<Tracer> tracer;
};

/// A set of rays with its answers in double.
struct Question {
  RaySet rays;
  OracleHits truth;
};

/// N of a name such as "embree-triangles-8", where `family` is "embree-triangles-"; 0 if it is
/// none.
int rate_of(const std::string& name, const std::string& family) {
  if (name.rfind(family, 0) != 0) return 0;
  const std::string digits = name.substr(family.size());
  const bool number = !digits.empty() && digits.size() < 5 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  return number ? std::stoi(digits) : 0;
}

std::vector<TracerPlan> plan_peers(const PeerInput& input, const std::vector<std::string>& names) {
  std::vector<TracerPlan> plans;
  for (const std::string& name : names) {
    if (const int rate = rate_of(name, "embree-subdivision-"))
      plans.push_back(plan_subdivision(input, rate));
    else if (const int quads = rate_of(name, "embree-triangles-"))
      plans.push_back(plan_triangles(input, quads));
    else if (name == "embree-geometry")
      plans.push_back(plan_user_geometry(input));
    else if (name != "limitray")
      throw std::invalid_argument("--tracers: unknown tracer \"" + name + "\"");
  }
  return plans;
}

Row skipped_row(const std::string& tracer, const std::string& rays, const std::string& reason) {
  Row row;
  row.tracer = tracer;
  row.rays = rays;
  row.skipped = reason;
  return row;
}

/// Makes peers from plans[next] on until the memory is used up; moves `next` past them.
class BatchMaker {
 public:
  BatchMaker(const std::vector<TracerPlan>& plans, std::size_t budget, const Report& report)
      : plans_(plans), budget_(budget), report_(report) {}

  bool done() const { return next_ == plans_.size(); }

  std::vector<NamedTracer> make(std::vector<std::pair<std::string, std::string>>& skipped) {
    std::vector<NamedTracer> batch;
    std::size_t used = 0;
    for (; !done(); ++next_) {
      const TracerPlan& plan = plans_[next_];
      if (plan.estimated_bytes > budget_) {
        skipped.push_back({plan.name, "needs about " + megabytes(plan.estimated_bytes) + ", " +
                                          megabytes(budget_) + " may be used"});
        continue;
      }
      if (used + plan.estimated_bytes > budget_) break;
      used += plan.estimated_bytes;
      report_("building " + plan.name);
      try {
        batch.push_back({plan.name, plan.make()});
      } catch (const std::runtime_error& error) {
        skipped.push_back({plan.name, error.what()});
      }
    }
    return batch;
  }

 private:
  static std::string megabytes(std::size_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

  const std::vector<TracerPlan>& plans_;
  std::size_t budget_;
  const Report& report_;
  std::size_t next_ = 0;
};

Row measured_row(const NamedTracer& tracer, const RaySet& rays, const Timing& time,
                 const Timing& limitray) {
  Row row;
  row.tracer = tracer.name;
  row.rays = rays.name;
  const double n = double(rays.size());
  row.rays_per_second = n / time.median.wall;
  row.fastest = n / time.fastest;
  row.slowest = n / time.slowest;
  row.rays_per_processor_second = n / time.median.processor;
  row.limitray_speedup = time.median.processor / limitray.median.processor;
  row.build = tracer.tracer->build;
  row.bytes = tracer.tracer->bytes;
  return row;
}

/// Times `batch`, whose first tracer is limitray, and judges its hits.
std::vector<Row> measure_batch(const std::vector<NamedTracer>& batch, Scene& scene,
                               const Question& question, int rounds, const Report& report) {
  std::vector<Tracer*> tracers;
  for (const NamedTracer& t : batch) tracers.push_back(t.tracer.get());
  const std::vector<Timing> times = measure_times(tracers, question.rays, rounds, [&](int done) {
    report(question.rays.name + " rays, round " + std::to_string(done) + " of " +
           std::to_string(rounds));
  });
  std::vector<Row> rows;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    Row row = measured_row(batch[i], question.rays, times[i], times[0]);
    HitBuffers hits(question.rays.size(), true);
    scene.reset_statistics();
    tracers[i]->trace(question.rays, hits);
    row.statistics = scene.statistics();
    row.accuracy = measure_accuracy(scene, question.rays, question.truth, hits);
    rows.push_back(row);
  }
  return rows;
}

/// The same rays in the order in which limitray traces them.
RaySet sorted(const Scene& scene, const RaySet& set) {
  const std::array<Vec3d, 2> b = scene.bounds();
  const Vec3d half = 0.5 * (b[1] - b[0]);
  const RayOrder order({0.5 * (b[0] + b[1]), half, 0}, scene.mesh_statistics(0).patches,
                       std::min(set.size(), max_sorted_rays));
  RaySet result = set;
  SortedRays<float> part;
  const float any = 0;
  for (std::size_t first = 0; first < set.size(); first += max_sorted_rays) {
    const std::size_t n = std::min(max_sorted_rays, set.size() - first);
    part.sort(order, {set.rays, {&any, 1}, {&any, 1}}, first, n);
    std::copy_n(part.batch().rays.begin(), 6 * n, result.rays.begin() + std::ptrdiff_t(6 * first));
  }
  return result;
}

std::vector<Question> make_questions(const Scene& scene, const Options& options,
                                     Comparison& result) {
  std::vector<Question> questions;
  const auto add = [&](RaySet set) {
    if (options.sort) set = sorted(scene, set);
    OracleHits truth = ask_oracle(scene, set);
    const auto hits =
        std::count_if(truth.t.begin(), truth.t.end(), [](double t) { return std::isfinite(t); });
    result.ray_counts.push_back(set.size());
    result.hit_rates.push_back(set.size() ? double(hits) / double(set.size()) : 0);
    questions.push_back({std::move(set), std::move(truth)});
  };
  add(primary_rays(scene, options.rays));
  add(diffuse_rays(scene, questions[0].rays, questions[0].truth));
  if (questions[1].rays.size() == 0)
    throw std::runtime_error("the surface is empty: no ray meets it");
  return questions;
}

/// The same mesh on all threads, and, where these are several, on one.
struct OwnScenes {
  Scene scene;
  std::optional<Scene> single;
  BuildTimes times;

  OwnScenes(const ControlCage& cage, const Options& o, int threads)
      : scene(o.threads), times(measure_build(cage, o.isolation_level, o.threads)) {
    scene.add_mesh(cage, {o.isolation_level});
    if (threads == 1) return;
    single.emplace(1);
    single->add_mesh(cage, {o.isolation_level});
  }
};

/// Puts limitray's own tracers in front of a batch; returns how many.
std::size_t add_limitray(std::vector<NamedTracer>& batch, const OwnScenes& own_scenes) {
  const Scene& scene = own_scenes.scene;
  const Seconds& build = own_scenes.times.build;
  std::vector<NamedTracer> all;
  all.push_back({"limitray", std::make_unique<LimitrayTracer>(scene, build, false)});
  all.push_back({"limitray-normals", std::make_unique<LimitrayTracer>(scene, build, true)});
  if (own_scenes.single)
    all.push_back(
        {"limitray-1-thread", std::make_unique<LimitrayTracer>(*own_scenes.single, build, false)});
  const std::size_t own = all.size();
  std::move(batch.begin(), batch.end(), std::back_inserter(all));
  batch = std::move(all);
  return own;
}

/// limitray's rows come from the first batch alone.
void add_rows(Comparison& result, std::vector<Row> rows, bool first_batch, std::size_t own) {
  rows.erase(rows.begin(), rows.begin() + std::ptrdiff_t(first_batch ? 0 : own));
  result.rows.insert(result.rows.end(), rows.begin(), rows.end());
}

}  // namespace

Comparison compare(const Options& given, const Report& report) {
  Comparison result;
  const ControlCage cage = read_obj(given.model);
  Options options = given;
  if (options.tolerance > 0)
    options.isolation_level = choose_level(cage, options.tolerance, 10).isolation_level;
  result.faces = cage.face_count();
  tbb::task_arena arena(options.threads ? options.threads : int(tbb::task_arena::automatic));
  result.threads = arena.max_concurrency();

  report("building limitray");
  OwnScenes own_scenes(cage, options, result.threads);
  Scene& scene = own_scenes.scene;
  result.mesh = scene.mesh_statistics(0);
  result.build_times = own_scenes.times;
  report("asking the oracle");
  const std::vector<Question> questions = make_questions(scene, options, result);

  const PatchBuffer<double> patches =
      Refiner(cage, {options.isolation_level}).make_patches(cage.points);
  const PeerInput input{arena, options.robust, cage, patches, options.isolation_level};
  const std::vector<TracerPlan> plans = plan_peers(input, options.tracers);
  BatchMaker batches(plans, available_memory() / 2, report);
  bool first = true;
  do {
    std::vector<std::pair<std::string, std::string>> skipped;
    std::vector<NamedTracer> batch = batches.make(skipped);
    const std::size_t own = add_limitray(batch, own_scenes);
    for (const Question& question : questions) {
      add_rows(result, measure_batch(batch, scene, question, options.rounds, report), first, own);
      for (const auto& [name, reason] : skipped)
        result.rows.push_back(skipped_row(name, question.rays.name, reason));
    }
    first = false;
  } while (!batches.done());
  return result;
}

}  // namespace limitray::bench

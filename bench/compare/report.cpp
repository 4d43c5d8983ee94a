#include "report.h"

#include <iomanip>
#include <thread>

#include "commit.h"
#include "json.h"
#include "machine.h"

namespace limitray::bench {
namespace {

void write_machine(JsonWriter& json) {
  json.open('{', "machine");
  json.value("cpu", cpu_model());
  json.value("cores", std::thread::hardware_concurrency());
  json.value("system", operating_system());
  json.value("compiler", compiler());
  json.value("flags", LIMITRAY_BENCH_FLAGS);
  json.value("isa", Scene::isa());
  json.value("embree", embree_version());
  json.value("commit", LIMITRAY_COMMIT);
  json.close('}');
}

/// Counts a ray: they do not depend on the machine.
void write_statistics(JsonWriter& json, const Statistics& s) {
  const double rays = double(s.rays);
  json.open('{', "per_ray");
  json.value("node_visits", double(s.node_visits) / rays);
  json.value("patch_tests", double(s.patch_tests) / rays);
  json.value("early_outs", double(s.early_outs) / rays);
  json.value("newton_runs", double(s.newton_runs) / rays);
  json.value("newton_steps", double(s.newton_steps) / rays);
  json.value("splits", double(s.splits) / rays);
  json.value("backtracks", double(s.backtracks) / rays);
  json.value("unresolved", double(s.unresolved) / rays);
  json.close('}');
}

void write_row(JsonWriter& json, const Row& row) {
  json.open('{');
  json.value("tracer", row.tracer);
  json.value("rays", row.rays);
  if (!row.skipped.empty()) {
    json.value("skipped", row.skipped);
    json.close('}');
    return;
  }
  json.value("mrays_per_s", row.rays_per_second / 1e6);
  json.value("mrays_per_s_fastest", row.fastest / 1e6);
  json.value("mrays_per_s_slowest", row.slowest / 1e6);
  json.value("mrays_per_processor_s", row.rays_per_processor_second / 1e6);
  json.value("limitray_speedup", row.limitray_speedup);
  json.value("build_s", row.build.wall);
  json.value("build_processor_s", row.build.processor);
  json.value("bytes", row.bytes);
  json.value("mean_error", row.accuracy.mean_error);
  json.value("max_error", row.accuracy.max_error);
  json.value("mismatches", row.accuracy.mismatches);
  json.value("strays", row.accuracy.strays);
  if (row.statistics.rays) write_statistics(json, row.statistics);
  json.close('}');
}

}  // namespace

void write_json(std::ostream& out, const Comparison& c, const Options& o,
                const std::string& command) {
  JsonWriter json(out);
  json.open('{');
  json.value("command", command);
  json.value("model", o.model);
  json.value("faces", c.faces);
  json.value("isolation_level", c.mesh.isolation_level);
  json.value("patches", c.mesh.patches);
  json.value("gregory_patches", c.mesh.gregory_patches);
  json.value("update_points_s", c.build_times.update.wall);
  json.value("update_points_processor_s", c.build_times.update.processor);
  json.value("threads", c.threads);
  json.value("rounds", o.rounds);
  json.value("primary_rays", c.ray_counts[0]);
  json.value("primary_hit_rate", c.hit_rates[0]);
  json.value("diffuse_rays", c.ray_counts[1]);
  json.value("diffuse_hit_rate", c.hit_rates[1]);
  json.value("embree_scene_flags", o.robust ? "robust" : "none");
  write_machine(json);
  json.open('[', "rows");
  for (const Row& row : c.rows) write_row(json, row);
  json.close(']');
  json.close('}');
}

void write_table(std::ostream& out, const Comparison& c) {
  out << std::left << std::setw(24) << "tracer" << std::setw(9) << "rays" << std::right
      << std::setw(9) << "Mray/s" << std::setw(9) << "a CPU s" << std::setw(10) << "limitray"
      << std::setw(10) << "build s" << std::setw(10) << "MiB" << std::setw(12) << "mean error"
      << std::setw(12) << "max error" << std::setw(12) << "mismatches" << '\n';
  for (const Row& r : c.rows) {
    out << std::left << std::setw(24) << r.tracer << std::setw(9) << r.rays << std::right;
    if (!r.skipped.empty()) {
      out << "  skipped: " << r.skipped << '\n';
      continue;
    }
    out << std::fixed << std::setprecision(2) << std::setw(9) << r.rays_per_second / 1e6
        << std::setw(9) << r.rays_per_processor_second / 1e6 << std::setw(9) << r.limitray_speedup
        << 'x' << std::setprecision(3) << std::setw(10) << r.build.wall << std::setprecision(1)
        << std::setw(10) << double(r.bytes) / (1 << 20) << std::scientific << std::setprecision(1)
        << std::setw(12) << r.accuracy.mean_error << std::setw(12) << r.accuracy.max_error
        << std::setw(12) << r.accuracy.mismatches << '\n';
  }
}

}  // namespace limitray::bench

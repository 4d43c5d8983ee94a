// How watertight the tracer is, as a number: rays at the seams of closed cages (see
// tests/support/watertight.h for the kinds of ray and for what counts as a leak).
//
//   watertight [--rays N] [--level L] [--seed S] [--double] [--bisection] [--json FILE] CAGE.obj
//   ...
//
// N rays a cage, shared out over the kinds. LIMITRAY_ISA chooses the instruction set. Prints a
// table;
// --json appends one line a cage to FILE. Exit code 1 if a ray leaked or stayed unresolved.
#include "../tests/support/watertight.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "limitray/cage/obj.h"

namespace {

using limitray::Scene;
using limitray::test::LeakCounts;
using limitray::test::RayKind;
using limitray::test::WatertightCage;

struct Options {
  double rays = 1e6;
  int level = 3;
  std::uint64_t seed = 1;
  bool in_double = false, bisection = false;
  std::string json;
  std::vector<std::string> cages;
};

Options parse(int count, char** arguments) {
  Options o;
  for (int i = 1; i < count; ++i) {
    const std::string a = arguments[i];
    const auto value = [&]() -> std::string {
      if (++i == count) throw std::invalid_argument(a + ": needs a value");
      return arguments[i];
    };
    if (a == "--rays")
      o.rays = std::stod(value());
    else if (a == "--level")
      o.level = std::stoi(value());
    else if (a == "--seed")
      o.seed = std::stoull(value());
    else if (a == "--double")
      o.in_double = true;
    else if (a == "--bisection")
      o.bisection = true;
    else if (a == "--json")
      o.json = value();
    else if (a.starts_with("-"))
      throw std::invalid_argument(a + ": no such option");
    else
      o.cages.push_back(a);
  }
  if (o.cages.empty()) throw std::invalid_argument("no cage given");
  return o;
}

struct Row {
  LeakCounts counts;
  double seconds;
};

Row run(WatertightCage& cage, RayKind kind, const Options& o) {
  const auto start = std::chrono::steady_clock::now();
  const auto n = std::size_t(o.rays);
  const LeakCounts c =
      o.in_double ? cage.run_share<double>(kind, n) : cage.run_share<float>(kind, n);
  return {c, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()};
}

void append_json(const Options& o, const std::string& name, const LeakCounts& all) {
  if (o.json.empty()) return;
  std::FILE* f = std::fopen(o.json.c_str(), "a");
  if (!f) throw std::runtime_error(o.json + ": cannot be written");
  std::fprintf(f,
               "{\"cage\":\"%s\",\"isa\":\"%s\",\"type\":\"%s\",\"search\":\"%s\",\"level\":%d,"
               "\"seed\":%llu,\"rays\":%llu,\"leaks\":%llu,\"beyond\":%llu,\"unresolved\":%llu}\n",
               name.c_str(), Scene::isa().c_str(), o.in_double ? "double" : "float",
               o.bisection ? "bisection" : "newton", o.level, (unsigned long long)o.seed,
               (unsigned long long)all.rays, (unsigned long long)all.leaks,
               (unsigned long long)all.beyond, (unsigned long long)all.unresolved);
  std::fclose(f);
}

/// Runs one cage; true if nothing leaked.
bool run_cage(const std::string& path, const Options& o) {
  const std::string name = std::filesystem::path(path).stem().string();
  const limitray::ControlCage control = limitray::read_obj(path);
  if (!limitray::test::is_closed(control))
    throw std::invalid_argument(path + ": must be closed, without holes");
  WatertightCage cage(control, o.level, o.seed);
  if (cage.inside_points() == 0) throw std::invalid_argument(path + ": has no inside");
  cage.scene().set_newton(!o.bisection);
  LeakCounts all;
  for (int k = 0; k < limitray::test::ray_kinds; ++k) {
    const Row row = run(cage, RayKind(k), o);
    std::printf("%-16s %-44s %12llu %7llu %10llu %10llu %8.2f\n", name.c_str(), name_of(RayKind(k)),
                (unsigned long long)row.counts.rays, (unsigned long long)row.counts.leaks,
                (unsigned long long)row.counts.beyond, (unsigned long long)row.counts.unresolved,
                double(row.counts.rays) / row.seconds / 1e6);
    std::fflush(stdout);
    all.add(row.counts);
  }
  for (const std::string& ray : cage.examples()) std::printf("leak: %s\n", ray.c_str());
  append_json(o, name, all);
  return all.leaks == 0 && all.unresolved == 0;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    const Options o = parse(count, arguments);
    std::printf("%s, %s, %s, level %d, seed %llu\n", Scene::isa().c_str(),
                o.in_double ? "double" : "float", o.bisection ? "bisection" : "newton", o.level,
                (unsigned long long)o.seed);
    std::printf("%-16s %-44s %12s %7s %10s %10s %8s\n", "cage", "rays", "number", "leaks", "beyond",
                "unresolved", "Mray/s");
    bool tight = true;
    for (const std::string& path : o.cages) tight = run_cage(path, o) && tight;
    return tight ? 0 : 1;
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "watertight: %s\n", e.what());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "watertight: %s\n", e.what());
    return 1;
  }
}

#include "options.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace limitray::bench {

const char* const usage =
    R"(usage: limitray_bench MODEL [options]

Traces the same rays with limitray and with Embree, and says how fast and how exact each is.

  MODEL                 cage: a Wavefront OBJ file (with `t` tags)
  --threads N           threads, 0 for all cores (default 0)
  --isolation-level L   how deep limitray isolates irregular features, 1 to 10 (default 4)
  --tolerance T         instead: the lowest level at which patches are within T of the limit,
                        relative to the longest side of the cage's box
  --rays N              rays a set, such as 1e6 (default 1e6)
  --rounds N            interleaved repetitions, of which the median counts (default 7)
  --tracers A,B,..      what limitray is compared with: embree-subdivision-N (tessellation
                        rate), embree-triangles-N (N x N quads a patch), embree-geometry,
                        limitray for nothing (default: rates 4, 8, 16, 32, quads 4, 8, 16
                        and embree-geometry)
  --sort                sort the rays as limitray does before any tracer gets them; without it
                        limitray sorts on the clock, and Embree gets them in their order
  --robust              Embree's robust scenes (default: its default, RTC_SCENE_FLAG_NONE)
  --json FILE           write the figures to FILE, "-" for standard output

Progress goes to standard error. Exit codes: 0 done, 1 failed, 2 wrong usage.
)";

namespace {

/// A whole number in [low, high], 1e6 and the like allowed.
long long parse_count(const std::string& name, const std::string& text, double low, double high) {
  std::istringstream in(text);
  double x = 0;
  if (!(in >> x) || !in.eof() || x != std::floor(x) || x < low || x > high)
    throw std::invalid_argument(name + ": must be a whole number from " +
                                std::to_string((long long)low) + " to " +
                                std::to_string((long long)high) + ", got \"" + text + "\"");
  return (long long)x;
}

std::vector<std::string> split_at_commas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');)
    if (!part.empty()) parts.push_back(part);
  return parts;
}

/// A number above 0.
double parse_positive(const std::string& name, const std::string& text) {
  std::istringstream in(text);
  double x = 0;
  if (!(in >> x) || !in.eof() || !(x > 0))
    throw std::invalid_argument(name + ": must be a number above 0, got \"" + text + "\"");
  return x;
}

}  // namespace

Options parse_options(const std::vector<std::string>& arguments) {
  Options o;
  bool has_level = false;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    const auto value = [&]() -> const std::string& {
      if (i + 1 == arguments.size()) throw std::invalid_argument(name + ": needs a value");
      return arguments[++i];
    };
    if (name == "--help" || name == "-h") {
      o.help = true;
    } else if (name == "--threads") {
      o.threads = int(parse_count(name, value(), 0, 4096));
    } else if (name == "--isolation-level") {
      o.isolation_level = int(parse_count(name, value(), 1, 10));
      has_level = true;
    } else if (name == "--tolerance") {
      o.tolerance = parse_positive(name, value());
    } else if (name == "--rays") {
      o.rays = std::size_t(parse_count(name, value(), 1, 1e9));
    } else if (name == "--rounds") {
      o.rounds = int(parse_count(name, value(), 1, 1000));
    } else if (name == "--tracers") {
      o.tracers = split_at_commas(value());
    } else if (name == "--sort") {
      o.sort = true;
    } else if (name == "--robust") {
      o.robust = true;
    } else if (name == "--json") {
      o.json = value();
    } else if (name.rfind("-", 0) == 0 || !o.model.empty()) {
      throw std::invalid_argument("unknown argument \"" + name + "\"");
    } else {
      o.model = name;
    }
  }
  if (has_level && o.tolerance > 0)
    throw std::invalid_argument("--isolation-level and --tolerance: exclude each other");
  if (o.model.empty() && !o.help) throw std::invalid_argument("MODEL: is missing");
  return o;
}

}  // namespace limitray::bench

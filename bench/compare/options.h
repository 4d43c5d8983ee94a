// The command line of limitray_bench.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace limitray::bench {

struct Options {
  std::string model;
  int threads = 0;  // 0: all cores
  int isolation_level = 4;
  double tolerance = 0;  // chooses the level if above 0
  std::size_t rays = 1000000;
  int rounds = 7;
  std::string json;  // file to write, empty for none
  // Names of the peers.
  std::vector<std::string> tracers{"embree-subdivision-4",  "embree-subdivision-8",
                                   "embree-subdivision-16", "embree-subdivision-32",
                                   "embree-triangles-4",    "embree-triangles-8",
                                   "embree-triangles-16",   "embree-geometry"};
  bool robust = false;
  bool sort = false;
  bool help = false;
};

/// Throws std::invalid_argument naming the argument, the rule and the value got.
Options parse_options(const std::vector<std::string>& arguments);

extern const char* const usage;

}  // namespace limitray::bench

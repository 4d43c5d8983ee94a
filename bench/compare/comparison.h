// The whole comparison: cage in, one row a tracer and set of rays out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "accuracy.h"
#include "limitray/scene.h"
#include "measure.h"
#include "options.h"
#include "updates.h"

namespace limitray::bench {

/// One line of the result. A skipped tracer has a reason and no figures.
struct Row {
  std::string tracer, rays;
  std::string skipped;
  double rays_per_second = 0, fastest = 0, slowest = 0;
  double rays_per_processor_second = 0;
  double limitray_speedup = 0;  // processor time over limitray's in the same rounds
  Seconds build;
  std::size_t bytes = 0;
  Accuracy accuracy;
  Statistics statistics;  // of limitray alone: the work of one pass
};

struct Comparison {
  std::vector<Row> rows;
  MeshStatistics mesh;
  BuildTimes build_times;
  std::size_t faces = 0;
  int threads = 1;
  std::vector<std::size_t> ray_counts;  // primary, diffuse
  std::vector<double> hit_rates;        // the same
};

/// `report` gets lines for a person who waits.
Comparison compare(const Options& options, const std::function<void(const std::string&)>& report);

}  // namespace limitray::bench

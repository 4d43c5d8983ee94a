#include "measure.h"

#include <algorithm>
#include <chrono>
#include <ctime>

namespace limitray::bench {
namespace {

struct Seconds {
  std::vector<double> wall, processor;  // one a round
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

void time_once(Tracer& tracer, const RaySet& rays, HitBuffers& hits, Seconds& seconds) {
  const std::clock_t processor = std::clock();
  const auto start = std::chrono::steady_clock::now();
  tracer.trace(rays, hits);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  seconds.wall.push_back(wall.count());
  seconds.processor.push_back(double(std::clock() - processor) / CLOCKS_PER_SEC);
}

Timing summarize(const Seconds& s) {
  return {median(s.wall), *std::min_element(s.wall.begin(), s.wall.end()),
          *std::max_element(s.wall.begin(), s.wall.end()), median(s.processor)};
}

}  // namespace

std::vector<Timing> measure_times(const std::vector<Tracer*>& tracers, const RaySet& rays,
                                  int rounds, const std::function<void(int)>& on_round) {
  HitBuffers hits(rays.size(), false);
  for (Tracer* tracer : tracers) tracer->trace(rays, hits);

  std::vector<Seconds> seconds(tracers.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < tracers.size(); ++k) {
      const std::size_t i = (k + std::size_t(round)) % tracers.size();
      time_once(*tracers[i], rays, hits, seconds[i]);
    }
    on_round(round + 1);
  }
  std::vector<Timing> timings;
  for (const Seconds& s : seconds) timings.push_back(summarize(s));
  return timings;
}

}  // namespace limitray::bench

#include "measure.h"

#include <algorithm>
#include <chrono>

namespace limitray::bench {
namespace {

double time_once(Tracer& tracer, const RaySet& rays, HitBuffers& hits) {
  const auto start = std::chrono::steady_clock::now();
  tracer.trace(rays, hits);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Timing summarize(std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  const std::size_t n = seconds.size();
  return {0.5 * (seconds[(n - 1) / 2] + seconds[n / 2]), seconds.front(), seconds.back()};
}

}  // namespace

std::vector<Timing> measure_times(const std::vector<Tracer*>& tracers, const RaySet& rays,
                                  int rounds, const std::function<void(int)>& on_round) {
  HitBuffers hits(rays.size(), false);
  for (Tracer* tracer : tracers) tracer->trace(rays, hits);

  std::vector<std::vector<double>> seconds(tracers.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < tracers.size(); ++k) {
      const std::size_t i = (k + std::size_t(round)) % tracers.size();
      seconds[i].push_back(time_once(*tracers[i], rays, hits));
    }
    on_round(round + 1);
  }
  std::vector<Timing> timings;
  for (const auto& s : seconds) timings.push_back(summarize(s));
  return timings;
}

}  // namespace limitray::bench

#include "measure.h"

#include <algorithm>

namespace limitray::bench {
namespace {

Timing summarize(const std::vector<Seconds>& times) {
  const auto [low, high] =
      std::minmax_element(times.begin(), times.end(),
                          [](const Seconds& a, const Seconds& b) { return a.wall < b.wall; });
  return {median(times), low->wall, high->wall};
}

}  // namespace

std::vector<Timing> measure_times(const std::vector<Tracer*>& tracers, const RaySet& rays,
                                  int rounds, const std::function<void(int)>& on_round) {
  HitBuffers hits(rays.size(), false);
  for (Tracer* tracer : tracers) tracer->trace(rays, hits);

  std::vector<std::vector<Seconds>> times(tracers.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < tracers.size(); ++k) {
      const std::size_t i = (k + std::size_t(round)) % tracers.size();
      const Stopwatch watch;
      tracers[i]->trace(rays, hits);
      times[i].push_back(watch.read());
    }
    on_round(round + 1);
  }
  std::vector<Timing> timings;
  for (const std::vector<Seconds>& t : times) timings.push_back(summarize(t));
  return timings;
}

}  // namespace limitray::bench

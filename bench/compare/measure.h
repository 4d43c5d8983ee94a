// Interleaved timing: every tracer takes its turn in every round, and the median of its rounds
// counts, so that a disturbance of the machine meets all of them alike.
#pragma once

#include <functional>
#include <vector>

#include "tracer.h"

namespace limitray::bench {

/// Seconds that `tracers[i]` took for all rays: median, least and greatest over the rounds, and the
/// median of the processor time of all threads, which does not count the neighbours of a shared
/// machine.
struct Timing {
  double median = 0, fastest = 0, slowest = 0, processor = 0;
};

/// One untimed pass each, then `rounds` rounds, each starting with another tracer.
/// `on_round(done)` is called after each.
std::vector<Timing> measure_times(const std::vector<Tracer*>& tracers, const RaySet& rays,
                                  int rounds, const std::function<void(int)>& on_round);

}  // namespace limitray::bench

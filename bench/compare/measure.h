// Interleaved timing: every tracer takes its turn in every round, and the median of its rounds
// counts, so that a disturbance of the machine meets all of them alike.
#pragma once

#include <functional>
#include <vector>

#include "tracer.h"

namespace limitray::bench {

/// What `tracers[i]` took for all rays: the median, and the least and greatest wall-clock seconds
/// of a round.
struct Timing {
  Seconds median;
  double fastest = 0, slowest = 0;
};

/// One untimed pass each, then `rounds` rounds, each starting with another tracer.
/// `on_round(done)` is called after each.
std::vector<Timing> measure_times(const std::vector<Tracer*>& tracers, const RaySet& rays,
                                  int rounds, const std::function<void(int)>& on_round);

}  // namespace limitray::bench

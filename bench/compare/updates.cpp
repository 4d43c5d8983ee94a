#include "updates.h"

#include <utility>
#include <vector>

#include "limitray/scene.h"

namespace limitray::bench {

BuildTimes measure_build(const ControlCage& cage, int isolation_level, int threads) {
  std::vector<Seconds> builds, updates;
  for (int round = 0; round < 3; ++round) {
    Scene scene(threads);
    ControlCage copy = cage;
    const Stopwatch build;
    const std::uint32_t mesh = scene.add_mesh(std::move(copy), {isolation_level});
    builds.push_back(build.read());
    const Stopwatch update;
    scene.update_points(mesh, cage.points);
    updates.push_back(update.read());
  }
  return {median(builds), median(updates)};
}

}  // namespace limitray::bench

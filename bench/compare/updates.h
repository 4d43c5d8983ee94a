// What it costs to make limitray's patches and tree, and to move the points of a mesh.
#pragma once

#include "limitray/cage/cage.h"
#include "seconds.h"

namespace limitray::bench {

/// Medians of three rounds: `build` is Scene::add_mesh into a new scene (refinement of the
/// topology, patches, tree), `update` is Scene::update_points of every point of it.
struct BuildTimes {
  Seconds build, update;
};
BuildTimes measure_build(const ControlCage& cage, int isolation_level, int threads);

}  // namespace limitray::bench

// The tracers that limitray is compared with, as plans: made one after the other while memory
// lasts.
#pragma once

#include <tbb/task_arena.h>

#include <memory>
#include <vector>

#include "limitray/cage/cage.h"
#include "limitray/patches/patch_buffer.h"
#include "tracer.h"

namespace limitray::bench {

struct PeerInput {
  tbb::task_arena& arena;
  bool robust;  // RTC_SCENE_FLAG_ROBUST instead of RTC_SCENE_FLAG_NONE, Embree's default
  const ControlCage& cage;
  const PatchBuffer<double>& patches;  // at the isolation level of the comparison
  int isolation_level;
};

/// Embree's subdivision geometry, `rate` quads an edge of a face: same creases, corners, holes and
/// boundary rule. What it does not know (Chaikin creases, smooth triangles, faces of more than 15
/// sides) is refused when the tracer is made.
TracerPlan plan_subdivision(const PeerInput& input, int rate);

/// Triangles: every patch of limitray evaluated in double at (quads+1)^2 points, 2 quads^2
/// triangles a patch, indexed; patches share no vertices.
TracerPlan plan_triangles(const PeerInput& input, int quads);

/// limitray's own surface as an Embree user geometry: Embree's tree instead of ours.
TracerPlan plan_user_geometry(const PeerInput& input);

}  // namespace limitray::bench

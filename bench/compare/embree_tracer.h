// An Embree scene as a tracer: a device of its own, so that its memory is counted apart, commit on
// the given threads, one rtcIntersect1 a ray.
#pragma once

#include <tbb/task_arena.h>

#include <atomic>
#include <functional>

#include "embree.h"
#include "tracer.h"

namespace limitray::bench {

class EmbreeTracer : public Tracer {
 public:
  /// `fill` attaches geometry to the empty scene. Filling is timed apart from the commit: it copies
  /// what the application has (a cage, triangles) into Embree's buffers. Throws std::runtime_error
  /// with Embree's message if it refuses.
  EmbreeTracer(tbb::task_arena& arena, bool robust,
               const std::function<void(RTCDevice, RTCScene)>& fill);
  ~EmbreeTracer() override;

  void trace(const RaySet& rays, HitBuffers& hits) override;

 private:
  void trace_block(const RaySet& rays, std::size_t begin, std::size_t end, HitBuffers& hits) const;

  tbb::task_arena& arena_;
  std::atomic<std::ptrdiff_t> allocated_{0};  // by the device, as its memory monitor tells
  EmbreeDevice device_;
  EmbreeScene scene_;
};

}  // namespace limitray::bench

// limitray itself as a tracer of the comparison, and as its judge: the same scene in double.
#pragma once

#include "limitray/scene.h"
#include "tracer.h"

namespace limitray::bench {

/// Traces `scene` in float. With `with_normal` the unit limit normal is computed even where nobody
/// measures errors: a second row that shows its price.
class LimitrayTracer : public Tracer {
 public:
  LimitrayTracer(const Scene& scene, const Seconds& build_time, bool with_normal);
  void trace(const RaySet& rays, HitBuffers& hits) override;

 private:
  const Scene& scene_;
  bool with_normal_;
  std::vector<float> normals_;
};

}  // namespace limitray::bench

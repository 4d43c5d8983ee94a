#include "embree_tracer.h"
#include "limitray/embree_geometry.h"
#include "peers.h"

namespace limitray::bench {
namespace {

/// The adapter's surface with the tracer around it: it must outlive Embree's scene.
class UserGeometryTracer : public Tracer {
 public:
  explicit UserGeometryTracer(const PeerInput& input)
      : surface_(input.cage, input.isolation_level),
        tracer_(input.arena, input.robust,
                [this](RTCDevice device, RTCScene scene) { surface_.attach(device, scene); }) {
    build = watch_.read();
    bytes = tracer_.bytes + surface_.bytes();
  }

  void trace(const RaySet& rays, HitBuffers& hits) override { tracer_.trace(rays, hits); }

 private:
  Stopwatch watch_;  // from before the patches are made
  limitray::EmbreeGeometry surface_;
  EmbreeTracer tracer_;
};

}  // namespace

TracerPlan plan_user_geometry(const PeerInput& input) {
  return {"embree-geometry", input.patches.size() * 1000,
          [&input] { return std::make_unique<UserGeometryTracer>(input); }};
}

}  // namespace limitray::bench

#include "limitray_tracer.h"

#include <limits>

namespace limitray::bench {

LimitrayTracer::LimitrayTracer(const Scene& scene, const Seconds& build_time, bool with_normal)
    : scene_(scene), with_normal_(with_normal) {
  build = build_time;
  const MeshStatistics s = scene.mesh_statistics(0);
  bytes = s.patch_bytes + s.bvh_bytes;
}

void LimitrayTracer::trace(const RaySet& rays, HitBuffers& hits) {
  if (with_normal_) normals_.resize(3 * rays.size());
  HitArrays<float> out;
  out.t = hits.t.data();
  out.primitive_id = hits.id.data();
  out.uv = hits.uv.data();
  out.normal = !hits.normal.empty() ? hits.normal.data() : with_normal_ ? normals_.data() : nullptr;
  const float tnear = 0, tfar = std::numeric_limits<float>::infinity();
  scene_.cast_rays<float>({rays.rays, {&tnear, 1}, {&tfar, 1}}, out);
}

}  // namespace limitray::bench

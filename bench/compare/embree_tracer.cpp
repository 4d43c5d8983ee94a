#include "embree_tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include <limits>
#include <stdexcept>
#include <string>

namespace limitray::bench {
namespace {

/// Flushes denormal numbers to zero while it lives, as Embree recommends for its callers.
class FlushDenormals {
 public:
#if defined(__SSE2__)
  FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }
  ~FlushDenormals() { _mm_setcsr(saved_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned saved_;
#endif
};

bool add_bytes(void* counter, ssize_t bytes, bool) {
  *static_cast<std::atomic<std::ptrdiff_t>*>(counter) += bytes;
  return true;
}

void throw_on_error(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error != RTC_ERROR_NONE)
    throw std::runtime_error("Embree failed with error " + std::to_string(error));
}

}  // namespace

EmbreeTracer::EmbreeTracer(tbb::task_arena& arena, bool robust,
                           const std::function<void(RTCDevice, RTCScene)>& fill)
    : arena_(arena),
      device_(rtcNewDevice(nullptr), rtcReleaseDevice),
      scene_(nullptr, rtcReleaseScene) {
  rtcSetDeviceMemoryMonitorFunction(device_.get(), add_bytes, &allocated_);
  scene_.reset(rtcNewScene(device_.get()));
  rtcSetSceneFlags(scene_.get(), robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  fill(device_.get(), scene_.get());
  throw_on_error(device_.get());

  const Stopwatch watch;
  arena_.execute([&] { rtcJoinCommitScene(scene_.get()); });
  build = watch.read();
  throw_on_error(device_.get());
  bytes = static_cast<std::size_t>(allocated_.load());
}

EmbreeTracer::~EmbreeTracer() {
  scene_.reset();
  rtcSetDeviceMemoryMonitorFunction(device_.get(), nullptr, nullptr);
}

void EmbreeTracer::trace(const RaySet& rays, HitBuffers& hits) {
  arena_.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, rays.size(), rays_per_block),
        [&](const auto& range) { trace_block(rays, range.begin(), range.end(), hits); },
        tbb::simple_partitioner());
  });
}

void EmbreeTracer::trace_block(const RaySet& rays, std::size_t begin, std::size_t end,
                               HitBuffers& hits) const {
  const FlushDenormals flush;
  EmbreeQuery intersect(rays.coherent);
  for (std::size_t i = begin; i < end; ++i) {
    const float* r = rays.rays.data() + 6 * i;
    RTCRayHit query{};
    query.ray.org_x = r[0], query.ray.org_y = r[1], query.ray.org_z = r[2];
    query.ray.dir_x = r[3], query.ray.dir_y = r[4], query.ray.dir_z = r[5];
    query.ray.tfar = std::numeric_limits<float>::infinity();
    query.ray.mask = 0xFFFFFFFFu;
    query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect(scene_.get(), query);
    const bool hit = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    hits.t[i] = hit ? query.ray.tfar : std::numeric_limits<float>::infinity();
    hits.id[i] = hit ? query.hit.primID : RTC_INVALID_GEOMETRY_ID;
    hits.uv[2 * i] = query.hit.u, hits.uv[2 * i + 1] = query.hit.v;
    if (hits.normal.empty()) continue;
    hits.normal[3 * i] = query.hit.Ng_x;
    hits.normal[3 * i + 1] = query.hit.Ng_y;
    hits.normal[3 * i + 2] = query.hit.Ng_z;
  }
}

}  // namespace limitray::bench

// Embree 3 and 4 under one name for the peers: the few places where the two differ.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <memory>

namespace limitray::bench {

using EmbreeDevice = std::unique_ptr<RTCDeviceTy, void (*)(RTCDevice)>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, void (*)(RTCScene)>;
using GeometryHandle = std::unique_ptr<RTCGeometryTy, void (*)(RTCGeometry)>;

/// rtcIntersect1 with the flags Embree recommends for coherent (or incoherent) rays.
class EmbreeQuery {
 public:
  explicit EmbreeQuery(bool coherent) {
#if RTC_VERSION_MAJOR >= 4
    rtcInitIntersectArguments(&arguments_);
    arguments_.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
#else
    rtcInitIntersectContext(&arguments_);
    arguments_.flags =
        coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
#endif
  }

  void operator()(RTCScene scene, RTCRayHit& ray) {
#if RTC_VERSION_MAJOR >= 4
    rtcIntersect1(scene, &ray, &arguments_);
#else
    rtcIntersect1(scene, &arguments_, &ray);
#endif
  }

 private:
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments_;
#else
  RTCIntersectContext arguments_;
#endif
};

}  // namespace limitray::bench

// Stage: beside the scene, for people who already run Embree. Comes in: a cage. Goes out: an Embree
// user geometry, one primitive a patch, that meets Embree's own geometries in the same scene.
//
//   const limitray::EmbreeGeometry surface(limitray::read_obj("spot.obj"));
//   const unsigned geometry_id = surface.attach(device, scene);
//   rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
//   rtcCommitScene(scene);
//   ... rtcIntersect1(scene, ...), rtcOccluded4, packets, instances: as with any geometry
//
// Embree's boxes are as good as ours only in a robust scene; without the flag rays that pass
// exactly between two boxes may be lost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "limitray/cage/cage.h"

// Embree's handles, RTCDevice and RTCScene, are pointers to these.
struct RTCDeviceTy;
struct RTCSceneTy;

namespace limitray {

struct EmbreeSurface;

class EmbreeGeometry {
 public:
  /// Makes the patches. Throws std::invalid_argument as Scene::add_mesh does.
  explicit EmbreeGeometry(const ControlCage& cage, int isolation_level = 4);
  ~EmbreeGeometry();
  EmbreeGeometry(EmbreeGeometry&&) noexcept;
  EmbreeGeometry& operator=(EmbreeGeometry&&) noexcept;

  /// Attaches the surface to `scene` of `device`, which must be committed afterwards, and returns
  /// its geometry id there. This object must outlive the scene's use of the geometry. Throws
  /// std::runtime_error if Embree refuses.
  ///
  /// A hit fills RTCRay::tfar and RTCHit: `Ng` is the unit normal of the limit surface on the side
  /// given by the winding, `primID` the base face, `u` and `v` as Embree has them for subdivision
  /// geometry: in [0,1]^2 for a quad, for another face with the sub-quad encoded (decode_uv).
  /// Filter functions are not called.
  unsigned attach(RTCDeviceTy* device, RTCSceneTy* scene) const;

  /// Memory of the patches; Embree's tree is counted by Embree.
  std::size_t bytes() const;

 private:
  std::unique_ptr<EmbreeSurface> surface_;
};

/// (u,v) of sub-quad `sub_quad` of a face that is no quad.
struct SubQuadUv {
  std::uint32_t sub_quad;
  float u, v;
};

/// Embree's encoding: sub-quad 4 h + l is the square [2l + 1/2, 2l + 3/2] x [2h + 1/2, 2h + 3/2].
SubQuadUv decode_uv(float u, float v);

}  // namespace limitray

#include "limitray/embree_geometry.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "limitray/geometry.h"

namespace limitray {

/// What the callbacks read.
struct EmbreeSurface {
  PatchBuffer<float> patches;
  GeometryView<float> view;   // of `patches`
  std::vector<bool> is_quad;  // one a base face
  Hulls hulls;
  float padding;  // of the hulls
};

namespace {

const EmbreeSurface& surface_of(void* user_pointer) {
  return *static_cast<const EmbreeSurface*>(user_pointer);
}

/// a + b rounded outward.
float add_outward(double a, float b, bool up) {
  const float infinity = std::numeric_limits<float>::infinity();
  return std::nextafter(static_cast<float>(a + double(b)), up ? infinity : -infinity);
}

/// All patches in one box.
Box union_of(const std::vector<Box>& boxes) {
  Box all;
  for (const Box& box : boxes) all.add(box);
  return all;
}

void bounds(const RTCBoundsFunctionArguments* a) {
  const EmbreeSurface& s = surface_of(a->geometryUserPtr);
  const Box box = padded(s.hulls[a->primID], s.padding);
  const Vec3d& o = s.patches.origin;
  RTCBounds& out = *a->bounds_o;
  out.lower_x = add_outward(o.x, box.lo[0], false), out.upper_x = add_outward(o.x, box.hi[0], true);
  out.lower_y = add_outward(o.y, box.lo[1], false), out.upper_y = add_outward(o.y, box.hi[1], true);
  out.lower_z = add_outward(o.z, box.lo[2], false), out.upper_z = add_outward(o.z, box.hi[2], true);
}

ObjectRay load_ray(RTCRayN* r, unsigned n, unsigned i) {
  return {{RTCRayN_org_x(r, n, i), RTCRayN_org_y(r, n, i), RTCRayN_org_z(r, n, i)},
          {RTCRayN_dir_x(r, n, i), RTCRayN_dir_y(r, n, i), RTCRayN_dir_z(r, n, i)},
          RTCRayN_tnear(r, n, i),
          RTCRayN_tfar(r, n, i)};
}

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

void store_hit(RTCHitN* h, unsigned n, unsigned i, unsigned geometry_id, const EmbreeSurface& s,
               const PatchInfo& info, const PatchHit& hit, const QueryContext& context) {
  const bool quad = s.is_quad[info.face];
  RTCHitN_Ng_x(h, n, i) = hit.normal.x;
  RTCHitN_Ng_y(h, n, i) = hit.normal.y;
  RTCHitN_Ng_z(h, n, i) = hit.normal.z;
  RTCHitN_u(h, n, i) = quad ? hit.u : float(2 * (info.sub_quad % 4)) + 0.5f + hit.u;
  RTCHitN_v(h, n, i) = quad ? hit.v : float(2 * (info.sub_quad / 4)) + 0.5f + hit.v;
  RTCHitN_primID(h, n, i) = info.face;
  RTCHitN_geomID(h, n, i) = geometry_id;
  for (unsigned l = 0; l < RTC_MAX_INSTANCE_LEVEL_COUNT; ++l)
    RTCHitN_instID(h, n, i, l) = context.instID[l];
}

void intersect(const RTCIntersectFunctionNArguments* a) {
  const EmbreeSurface& s = surface_of(a->geometryUserPtr);
  RTCRayN* rays = RTCRayHitN_RayN(a->rayhit, a->N);
  for (unsigned i = 0; i < a->N; ++i) {
    PatchHit hit;
    if (!a->valid[i] || !kernels().closest_patch(s.view, a->primID, load_ray(rays, a->N, i), hit))
      continue;
    RTCRayN_tfar(rays, a->N, i) = static_cast<float>(hit.t);
    store_hit(RTCRayHitN_HitN(a->rayhit, a->N), a->N, i, a->geomID, s, s.view.infos[a->primID], hit,
              *a->context);
  }
}

void occluded(const RTCOccludedFunctionNArguments* a) {
  const EmbreeSurface& s = surface_of(a->geometryUserPtr);
  for (unsigned i = 0; i < a->N; ++i)
    if (a->valid[i] && kernels().occluded_patch(s.view, a->primID, load_ray(a->ray, a->N, i)))
      RTCRayN_tfar(a->ray, a->N, i) = -std::numeric_limits<float>::infinity();
}

}  // namespace

EmbreeGeometry::EmbreeGeometry(const ControlCage& cage, int isolation_level)
    : surface_(std::make_unique<EmbreeSurface>()) {
  validate(cage);
  EmbreeSurface& s = *surface_;
  const Refiner refiner(cage, {isolation_level});
  s.patches = unwritten_patches(refiner);
  s.hulls = write_patches(refiner, cage.points, {}, s.patches);
  s.view.nets = s.patches.nets.data();
  s.view.bumps = s.patches.bumps.data();
  s.view.infos = s.patches.infos.data();
  s.view.models = s.patches.models.data();
  s.view.left_handed = cage.orientation == Orientation::left_handed;
  for (std::int32_t sides : cage.face_vertex_counts) s.is_quad.push_back(sides == 4);
  s.view.extent =
      extent_of(union_of(boxes_of(s.hulls, s.patches)), s.patches.origin, s.patches.radius);
  // Embree's boxes are not relative to the surface's centre.
  const Vec3d& o = s.patches.origin;
  s.padding =
      box_padding(s.patches.radius + std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z)}));
}
EmbreeGeometry::~EmbreeGeometry() = default;
EmbreeGeometry::EmbreeGeometry(EmbreeGeometry&&) noexcept = default;
EmbreeGeometry& EmbreeGeometry::operator=(EmbreeGeometry&&) noexcept = default;

unsigned EmbreeGeometry::attach(RTCDeviceTy* device, RTCSceneTy* scene) const {
  const std::unique_ptr<RTCGeometryTy, void (*)(RTCGeometry)> geometry(
      rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER), rtcReleaseGeometry);
  const unsigned id = geometry ? rtcAttachGeometry(scene, geometry.get()) : RTC_INVALID_GEOMETRY_ID;
  if (id == RTC_INVALID_GEOMETRY_ID)
    throw std::runtime_error("EmbreeGeometry::attach: Embree failed with error " +
                             std::to_string(rtcGetDeviceError(device)));
  rtcSetGeometryUserPrimitiveCount(geometry.get(), static_cast<unsigned>(surface_->patches.size()));
  rtcSetGeometryUserData(geometry.get(), surface_.get());
  rtcSetGeometryBoundsFunction(geometry.get(), bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry.get(), intersect);
  rtcSetGeometryOccludedFunction(geometry.get(), occluded);
  rtcCommitGeometry(geometry.get());
  return id;
}

std::size_t EmbreeGeometry::bytes() const { return surface_->patches.bytes(); }

SubQuadUv decode_uv(float u, float v) {
  const float l = std::floor(0.5f * u), h = std::floor(0.5f * v);
  return {static_cast<std::uint32_t>(4 * h + l), u - 2 * l - 0.5f, v - 2 * h - 0.5f};
}

}  // namespace limitray

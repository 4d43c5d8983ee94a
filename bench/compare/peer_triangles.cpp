#include <tbb/parallel_for.h>

#include <string>

#include "embree_tracer.h"
#include "patch_points.h"
#include "peers.h"

namespace limitray::bench {
namespace {

void write_vertices(const PatchBuffer<double>& patches, std::size_t patch, int quads, float* out) {
  const std::uint32_t bump = patches.infos[patch].bump;
  for (int j = 0; j <= quads; ++j)
    for (int i = 0; i <= quads; ++i) {
      const Vec3d p = patches.origin + patch_point(patches.nets[patch],
                                                   bump == no_bump ? nullptr : &patches.bumps[bump],
                                                   double(i) / quads, double(j) / quads);
      for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(p[axis]);
    }
}

void write_triangles(unsigned first_vertex, int quads, unsigned* out) {
  const unsigned row = static_cast<unsigned>(quads) + 1;
  for (unsigned j = 0; j + 1 < row; ++j)
    for (unsigned i = 0; i + 1 < row; ++i) {
      const unsigned a = first_vertex + j * row + i, b = a + 1, c = a + row, d = c + 1;
      for (unsigned vertex : {a, b, d, a, d, c}) *out++ = vertex;
    }
}

void fill_scene(RTCDevice device, RTCScene scene, const PatchBuffer<double>& patches, int quads) {
  const std::size_t n = patches.size();
  const std::size_t vertices =
      static_cast<std::size_t>(quads + 1) * static_cast<std::size_t>(quads + 1);
  const std::size_t triangles =
      2 * static_cast<std::size_t>(quads) * static_cast<std::size_t>(quads);
  const GeometryHandle geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE),
                                rtcReleaseGeometry);
  RTCGeometry g = geometry.get();
  auto* points = static_cast<float*>(
      rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, n * vertices));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, n * triangles));
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t patch) {
    write_vertices(patches, patch, quads, points + 3 * patch * vertices);
    write_triangles(static_cast<unsigned>(patch * vertices), quads,
                    indices + 3 * patch * triangles);
  });
  rtcCommitGeometry(g);
  rtcAttachGeometry(scene, g);
}

}  // namespace

TracerPlan plan_triangles(const PeerInput& input, int quads) {
  // About 150 bytes a triangle while Embree builds, buffers and tree together.
  const std::size_t triangles =
      2 * static_cast<std::size_t>(quads) * static_cast<std::size_t>(quads);
  return {"embree-triangles-" + std::to_string(quads), input.patches.size() * triangles * 150,
          [&input, quads]() -> std::unique_ptr<Tracer> {
            return std::make_unique<EmbreeTracer>(
                input.arena, input.robust, [&input, quads](RTCDevice device, RTCScene scene) {
                  input.arena.execute([&] { fill_scene(device, scene, input.patches, quads); });
                });
          }};
}

}  // namespace limitray::bench

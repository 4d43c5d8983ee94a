#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "embree_tracer.h"
#include "peers.h"

namespace limitray::bench {
namespace {

constexpr int most_sides = 15;  // of a face in Embree

void refuse_what_embree_lacks(const ControlCage& cage) {
  for (int sides : cage.face_vertex_counts)
    if (sides > most_sides)
      throw std::runtime_error("a face of " + std::to_string(sides) +
                               " sides, Embree has at most " + std::to_string(most_sides));
  if (cage.creasing_method == CreasingMethod::chaikin)
    throw std::runtime_error("Embree has no Chaikin creases");
  const bool triangles = std::find(cage.face_vertex_counts.begin(), cage.face_vertex_counts.end(),
                                   3) != cage.face_vertex_counts.end();
  if (cage.triangle_subdivision_rule == TriangleSubdivisionRule::smooth && triangles)
    throw std::runtime_error("Embree has no smooth triangle rule");
}

RTCSubdivisionMode boundary_mode(InterpolateBoundary rule) {
  switch (rule) {
    case InterpolateBoundary::none:
      return RTC_SUBDIVISION_MODE_NO_BOUNDARY;
    case InterpolateBoundary::edge_only:
      return RTC_SUBDIVISION_MODE_SMOOTH_BOUNDARY;
    default:
      return RTC_SUBDIVISION_MODE_PIN_CORNERS;
  }
}

float embree_sharpness(float sharpness) {
  return sharpness >= infinite_sharpness ? std::numeric_limits<float>::infinity() : sharpness;
}

/// A buffer that Embree allocates, so that its memory monitor counts it.
template <class T>
T* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t count,
              int values_an_item = 1) {
  return static_cast<T*>(rtcSetNewGeometryBuffer(
      geometry, type, 0, format, sizeof(T) * static_cast<std::size_t>(values_an_item), count));
}

template <class T, class From>
void fill_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const From& values) {
  if (values.empty()) return;
  T* out = new_buffer<T>(geometry, type, format, values.size());
  std::transform(values.begin(), values.end(), out, [](auto x) { return static_cast<T>(x); });
}

void fill_features(RTCGeometry g, const ControlCage& cage) {
  const std::vector<CreaseEdge> creases = crease_edges(cage);
  if (!creases.empty()) {
    auto* index = new_buffer<unsigned>(g, RTC_BUFFER_TYPE_EDGE_CREASE_INDEX, RTC_FORMAT_UINT2,
                                       creases.size(), 2);
    auto* weight =
        new_buffer<float>(g, RTC_BUFFER_TYPE_EDGE_CREASE_WEIGHT, RTC_FORMAT_FLOAT, creases.size());
    for (std::size_t i = 0; i < creases.size(); ++i) {
      index[2 * i] = static_cast<unsigned>(creases[i].v0);
      index[2 * i + 1] = static_cast<unsigned>(creases[i].v1);
      weight[i] = embree_sharpness(creases[i].sharpness);
    }
  }
  std::vector<float> corners = cage.corner_sharpnesses;
  std::transform(corners.begin(), corners.end(), corners.begin(), embree_sharpness);
  fill_buffer<unsigned>(g, RTC_BUFFER_TYPE_VERTEX_CREASE_INDEX, RTC_FORMAT_UINT,
                        cage.corner_indices);
  fill_buffer<float>(g, RTC_BUFFER_TYPE_VERTEX_CREASE_WEIGHT, RTC_FORMAT_FLOAT, corners);
  fill_buffer<unsigned>(g, RTC_BUFFER_TYPE_HOLE, RTC_FORMAT_UINT, cage.hole_indices);
}

void fill_scene(RTCDevice device, RTCScene scene, const ControlCage& cage, int rate) {
  const GeometryHandle geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SUBDIVISION),
                                rtcReleaseGeometry);
  RTCGeometry g = geometry.get();
  fill_buffer<unsigned>(g, RTC_BUFFER_TYPE_FACE, RTC_FORMAT_UINT, cage.face_vertex_counts);
  fill_buffer<unsigned>(g, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT, cage.face_vertex_indices);
  auto* points =
      new_buffer<float>(g, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, cage.points.size(), 3);
  for (std::size_t i = 0; i < 3 * cage.points.size(); ++i)
    points[i] = static_cast<float>(cage.points[i / 3][static_cast<int>(i % 3)]);
  fill_features(g, cage);
  rtcSetGeometrySubdivisionMode(g, 0, boundary_mode(cage.interpolate_boundary));
  rtcSetGeometryTessellationRate(g, static_cast<float>(rate));
  rtcCommitGeometry(g);
  rtcAttachGeometry(scene, g);
}

}  // namespace

TracerPlan plan_subdivision(const PeerInput& input, int rate) {
  // About 40 bytes a grid vertex; an n-gon is n quads of half the rate.
  const std::size_t grid = static_cast<std::size_t>(rate + 1) * static_cast<std::size_t>(rate + 1);
  return {"embree-subdivision-" + std::to_string(rate), input.cage.face_count() * grid * 40,
          [&input, rate]() -> std::unique_ptr<Tracer> {
            refuse_what_embree_lacks(input.cage);
            return std::make_unique<EmbreeTracer>(input.arena, input.robust,
                                                  [&input, rate](RTCDevice device, RTCScene scene) {
                                                    fill_scene(device, scene, input.cage, rate);
                                                  });
          }};
}

}  // namespace limitray::bench

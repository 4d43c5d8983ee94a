#include "ray_sets.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace limitray::bench {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr unsigned seed = 20150809;

Vec3d normalized(const Vec3d& v) { return (1 / length(v)) * v; }

/// A rectangle of the picture plane at distance 1 in front of the eye.
struct Frame {
  double left = infinity, right = -infinity, bottom = infinity, top = -infinity;

  void add(double x, double y) {
    left = std::min(left, x), right = std::max(right, x);
    bottom = std::min(bottom, y), top = std::max(top, y);
  }
};

struct Camera {
  Vec3d eye, right, up, forward;
  Frame frame;

  Vec3d direction(double x, double y) const { return forward + x * right + y * up; }
};

/// Looks at the middle of the bounds, which the frame encloses.
Camera look_at_bounds(const Scene& scene) {
  const auto [low, high] = scene.bounds();
  const Vec3d centre = 0.5 * (low + high);
  const double azimuth = 30 * std::numbers::pi / 180, elevation = 22 * std::numbers::pi / 180;
  Camera c;
  c.forward = {-std::sin(azimuth) * std::cos(elevation), -std::sin(elevation),
               -std::cos(azimuth) * std::cos(elevation)};
  c.right = normalized(cross(c.forward, Vec3d{0, 1, 0}));
  c.up = cross(c.right, c.forward);
  c.eye = centre - (2 * length(high - low)) * c.forward;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d p = low;
    for (int axis = 0; axis < 3; ++axis)
      if (corner >> axis & 1) p[axis] = high[axis];
    const Vec3d d = p - c.eye;
    c.frame.add(dot(d, c.right) / dot(d, c.forward), dot(d, c.up) / dot(d, c.forward));
  }
  return c;
}

/// One ray a pixel of a picture, jittered around the centre by up to `jitter` pixels.
RaySet shoot(const Camera& c, int width, int height, double jitter) {
  RaySet set{"primary", true, {}};
  set.rays.reserve(6 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> offset(-jitter, jitter);
  const double dx = (c.frame.right - c.frame.left) / width;
  const double dy = (c.frame.top - c.frame.bottom) / height;
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i) {
      const double x = c.frame.left + (i + 0.5 + offset(random)) * dx;
      const double y = c.frame.top - (j + 0.5 + offset(random)) * dy;
      const Vec3d d = c.direction(x, y);
      for (int axis = 0; axis < 3; ++axis) set.rays.push_back(float(c.eye[axis]));
      for (int axis = 0; axis < 3; ++axis) set.rays.push_back(float(d[axis]));
    }
  return set;
}

/// The rectangle of the pixels in which a coarse picture sees the object.
Frame seen_frame(const Scene& scene, const Camera& camera) {
  constexpr int size = 128;
  const OracleHits hits = ask_oracle(scene, shoot(camera, size, size, 0));
  const double dx = (camera.frame.right - camera.frame.left) / size;
  const double dy = (camera.frame.top - camera.frame.bottom) / size;
  Frame seen;
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      if (!std::isfinite(hits.t[std::size_t(j) * size + std::size_t(i)])) continue;
      const double x = camera.frame.left + i * dx, y = camera.frame.top - j * dy;
      seen.add(x, y - dy);
      seen.add(x + dx, y);
    }
  return seen.left < seen.right ? seen : camera.frame;
}

}  // namespace

OracleHits ask_oracle(const Scene& scene, const RaySet& set) {
  const std::vector<double> rays(set.rays.begin(), set.rays.end());
  OracleHits answer{std::vector<double>(set.size()), std::vector<double>(3 * set.size())};
  HitArrays<double> out;
  out.t = answer.t.data();
  out.normal = answer.normal.data();
  const double tnear = 0, tfar = infinity;
  scene.cast_rays<double>({rays, {&tnear, 1}, {&tfar, 1}}, out);
  return answer;
}

double extent(const Scene& scene) {
  const auto [low, high] = scene.bounds();
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

RaySet primary_rays(const Scene& scene, std::size_t count) {
  Camera camera = look_at_bounds(scene);
  camera.frame = seen_frame(scene, camera);
  const Frame& f = camera.frame;
  const double aspect = std::clamp((f.right - f.left) / (f.top - f.bottom), 0.125, 8.0);
  const double width = std::max(1.0, std::round(std::sqrt(double(count) * aspect)));
  return shoot(camera, int(width), int(std::max(1.0, std::round(double(count) / width))), 0.5);
}

RaySet diffuse_rays(const Scene& scene, const RaySet& primary, const OracleHits& hits) {
  std::mt19937 random(seed + 1);
  std::vector<std::size_t> starts;
  for (std::size_t i = 0; i < primary.size(); ++i)
    if (std::isfinite(hits.t[i])) starts.push_back(i);
  std::shuffle(starts.begin(), starts.end(), random);

  RaySet set{"diffuse", false, {}};
  if (starts.empty()) return set;
  const double lift = 1e-3 * extent(scene);
  std::normal_distribution<double> gauss;
  for (std::size_t k = 0; k < primary.size(); ++k) {
    const std::size_t i = starts[k % starts.size()];
    const float* r = primary.rays.data() + 6 * i;
    const Vec3d dir{r[3], r[4], r[5]};
    Vec3d n{hits.normal[3 * i], hits.normal[3 * i + 1], hits.normal[3 * i + 2]};
    if (dot(n, dir) > 0) n = -1.0 * n;
    const Vec3d org = Vec3d{r[0], r[1], r[2]} + hits.t[i] * dir + lift * n;
    const Vec3d out = n + normalized({gauss(random), gauss(random), gauss(random)});
    for (int axis = 0; axis < 3; ++axis) set.rays.push_back(float(org[axis]));
    for (int axis = 0; axis < 3; ++axis) set.rays.push_back(float(out[axis]));
  }
  return set;
}

}  // namespace limitray::bench

// What the comparison runs: a set of rays, and tracers that answer it into the same arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "seconds.h"

namespace limitray::bench {

/// Rays a block: all tracers are called by the same TBB loop over blocks of this many.
inline constexpr std::size_t rays_per_block = 512;

struct RaySet {
  std::string name;  // "primary" or "diffuse"
  bool coherent;
  std::vector<float> rays;  // 6 a ray: origin, direction; 0 < t <= inf

  std::size_t size() const { return rays.size() / 6; }
};

/// What every tracer writes, one row a ray: t (inf for a miss), a face or primitive id, (u,v).
/// `normal` is written only if it is not empty, for the measurement of errors.
struct HitBuffers {
  std::vector<float> t, uv, normal;
  std::vector<std::uint32_t> id;

  HitBuffers(std::size_t rays, bool with_normal)
      : t(rays), uv(2 * rays), normal(with_normal ? 3 * rays : 0), id(rays) {}
};

class Tracer {
 public:
  virtual ~Tracer() = default;
  /// Traces all rays on the threads that the tracer was made for.
  virtual void trace(const RaySet& rays, HitBuffers& hits) = 0;

  Seconds build;
  std::size_t bytes = 0;  // all that tracing needs
};

/// A tracer that can be made. `make` throws std::runtime_error if the tracer cannot represent the
/// cage; `estimated_bytes` guards the memory before it is called.
struct TracerPlan {
  std::string name;
  std::size_t estimated_bytes;
  std::function<std::unique_ptr<Tracer>()> make;
};

}  // namespace limitray::bench

// Stage: control cage. The true limit surface, evaluated without the tracer and without
// OpenSubdiv: Catmull-Clark's rules applied to the neighbourhood of one face until the wanted point
// lies in a regular (B-spline) patch, limit masks where it never does. Slow and exact: the truth
// that the tests compare with, and `Mesh.limit` in Python.
#pragma once

#include <cstdint>
#include <memory>

#include "limitray/cage/cage.h"

namespace limitray {

/// A point of the limit surface. Derivatives are with respect to (u,v) of the base face, or of the
/// sub-quad of an n-gon. `normal` is unit and on the side given by the winding and orientation; it
/// is the limit of the normals where the derivatives vanish or do not exist.
struct LimitSample {
  Vec3d point, normal, dp_du, dp_dv;
};

class LimitEvaluator {
 public:
  /// Keeps a copy of `cage`. Throws std::invalid_argument where `validate` does.
  explicit LimitEvaluator(ControlCage cage);
  ~LimitEvaluator();
  LimitEvaluator(LimitEvaluator&&) noexcept;
  LimitEvaluator& operator=(LimitEvaluator&&) noexcept;

  /// The limit at (u,v) in [0,1]^2 of `face` (of the sub-quad at corner `sub_quad` of a face with
  /// other than 4 sides: (0,0) is the corner, as in OpenSubdiv's ptex faces). Thread-safe.
  /// Throws std::invalid_argument for a face, sub-quad or parameter out of range, or a hole.
  LimitSample evaluate(std::int32_t face, std::int32_t sub_quad, double u, double v) const;

 private:
  struct Topology;
  std::unique_ptr<Topology> topology_;
};

}  // namespace limitray

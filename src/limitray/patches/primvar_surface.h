// Stage: primvars. Comes in: a cage and one of its primvars. Goes out: its value and derivatives at
// a place of the surface, in double.
//
// Vertex primvars live on the patches of the positions, face-varying ones on OpenSubdiv's
// face-varying patches: both are nets and bumps as in patch_buffer.h, with any number of
// components. What is linear (varying, and face-varying under the rule `all`) or constant is read
// off the cage.
#pragma once

#include <cstdint>
#include <vector>

#include "limitray/cage/cage.h"
#include "limitray/patches/patch_lookup.h"
#include "limitray/patches/refine.h"

namespace limitray {

class PrimvarSurface {
 public:
  /// `primvar` is one of those of `cage`, which must be valid. `positions` are the cage's own
  /// patches, and `options` what they were refined with. Keeps copies of what it needs.
  PrimvarSurface(const ControlCage& cage, const Primvar& primvar, const Refiner& positions,
                 const RefineOptions& options);

  /// Components of a value.
  int width() const { return width_; }
  std::size_t bytes() const { return (nets_.size() + bumps_.size()) * sizeof(double); }

  /// Writes `width()` numbers each: the value at (u,v) in [0,1]^2 of `face` (of its sub-quad), and
  /// its derivatives by u and v. Thread-safe. Throws std::invalid_argument if the face or sub-quad
  /// is out of range or has no surface.
  void evaluate(std::uint32_t face, std::uint32_t sub_quad, double u, double v, double* value,
                double* d_du, double* d_dv) const;

 private:
  void add_patches(const Primvar& primvar, const std::vector<std::int32_t>& rows,
                   const Refiner& refiner);
  void evaluate_patch(std::uint32_t patch, double u, double v, double* value, double* d_du,
                      double* d_dv) const;
  void evaluate_linear(std::uint32_t face, std::uint32_t sub_quad, double u, double v,
                       double* value, double* d_du, double* d_dv) const;
  /// Mean of the corner values of a linear face over its corners [first, first + count).
  double mean(std::uint32_t face, std::uint32_t first, std::uint32_t count, int k) const;

  int width_;
  QuadNumbers quads_;

  // On patches: for each one 16 control values a component, and 4 where it has a bump.
  PatchLookup lookup_;
  std::vector<PatchInfo> infos_;
  std::vector<double> nets_, bumps_;

  // Linear: the row of each corner of each face.
  std::vector<float> values_;
  std::vector<std::uint32_t> first_corner_;
  std::vector<std::int32_t> corner_rows_;
};

}  // namespace limitray

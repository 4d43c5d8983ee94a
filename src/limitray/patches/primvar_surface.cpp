// Stage: primvars. See primvar_surface.h.
#include "limitray/patches/primvar_surface.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "limitray/math/bezier.h"
#include "limitray/patches/gregory.h"

namespace limitray {
namespace {

bool is_linear(const ControlCage& cage, const Primvar& primvar) {
  if (primvar.interpolation == Interpolation::face_varying)
    return cage.face_varying_linear_interpolation == FaceVaryingLinearInterpolation::all;
  return primvar.interpolation != Interpolation::vertex;
}

/// Row of `primvar.values` at corner `corner` of the cage, which belongs to `face`.
std::int32_t row_at(const ControlCage& cage, const Primvar& primvar, std::size_t face,
                    std::size_t corner) {
  switch (primvar.interpolation) {
    case Interpolation::constant:
      return primvar.indices[0];
    case Interpolation::uniform:
      return primvar.indices[face];
    case Interpolation::varying:
    case Interpolation::vertex:
      return primvar.indices[cage.face_vertex_indices[corner]];
    case Interpolation::face_varying:
      break;
  }
  return primvar.indices[corner];
}

}  // namespace

PrimvarSurface::PrimvarSurface(const ControlCage& cage, const Primvar& primvar,
                               const Refiner& positions, const RefineOptions& options)
    : width_(primvar.width), quads_(cage.face_vertex_counts) {
  if (is_linear(cage, primvar)) {
    values_ = primvar.values;
    first_corner_.push_back(0);
    std::size_t corner = 0;
    for (std::size_t f = 0; f < cage.face_count(); ++f) {
      for (std::int32_t k = 0; k < cage.face_vertex_counts[f]; ++k)
        corner_rows_.push_back(row_at(cage, primvar, f, corner++));
      first_corner_.push_back(static_cast<std::uint32_t>(corner));
    }
  } else if (primvar.interpolation == Interpolation::vertex) {
    add_patches(primvar, primvar.indices, positions);
  } else {
    std::vector<std::int32_t> rows(primvar.values.size() / static_cast<std::size_t>(width_));
    std::iota(rows.begin(), rows.end(), 0);
    add_patches(primvar, rows, Refiner(cage, primvar, options));
  }
}

void PrimvarSurface::add_patches(const Primvar& primvar, const std::vector<std::int32_t>& rows,
                                 const Refiner& refiner) {
  std::vector<Vec3d> points(rows.size());
  for (int first = 0; first < width_; first += 3) {
    const int count = std::min(3, width_ - first);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const float* row = primvar.values.data() + static_cast<std::size_t>(rows[i]) * width_ + first;
      for (int k = 0; k < count; ++k) points[i][k] = row[k];
    }
    const PatchBuffer<double> patches = refiner.make_patches(points);
    if (first == 0) {
      infos_ = patches.infos;
      lookup_ = PatchLookup(quads_, infos_);
      nets_.resize(16 * patches.nets.size() * width_);
      bumps_.resize(4 * patches.bumps.size() * width_);
    }
    for (int k = 0; k < count; ++k) {
      for (std::size_t p = 0; p < patches.nets.size(); ++p)
        std::transform(patches.nets[p].c[k], patches.nets[p].c[k] + 16,
                       nets_.data() + 16 * (p * width_ + first + k),
                       [&](double x) { return x + patches.origin[k]; });
      for (std::size_t b = 0; b < patches.bumps.size(); ++b)
        std::copy_n(patches.bumps[b].c[k], 4, bumps_.data() + 4 * (b * width_ + first + k));
    }
  }
}

void PrimvarSurface::evaluate(std::uint32_t face, std::uint32_t sub_quad, double u, double v,
                              double* value, double* d_du, double* d_dv) const {
  if (face >= quads_.face_count())
    throw std::invalid_argument("face: must be below " + std::to_string(quads_.face_count()) +
                                ", got " + std::to_string(face));
  if (sub_quad >= quads_.count(face))
    throw std::invalid_argument("sub_quad: must be below " + std::to_string(quads_.count(face)) +
                                ", got " + std::to_string(sub_quad));
  if (!corner_rows_.empty()) {
    evaluate_linear(face, sub_quad, u, v, value, d_du, d_dv);
    return;
  }
  const std::uint32_t patch = lookup_.find(quads_(face, sub_quad), u, v);
  if (patch == invalid_id)
    throw std::invalid_argument("face: " + std::to_string(face) + " has no surface");
  evaluate_patch(patch, u, v, value, d_du, d_dv);
}

void PrimvarSurface::evaluate_patch(std::uint32_t patch, double u, double v, double* value,
                                    double* d_du, double* d_dv) const {
  const PatchInfo& info = infos_[patch];
  const double s = (u - info.u0) / info.du, t = (v - info.v0) / info.dv;
  const Quad<double> bs = bernstein(s), ds = bernstein_derivative(s);
  const Quad<double> bt = bernstein(t), dt = bernstein_derivative(t);
  const bool has_bump = info.bump != no_bump;
  const BumpWeights<double> w = has_bump ? bump_weights(s, t) : BumpWeights<double>{};
  for (int k = 0; k < width_; ++k) {
    const double* net = nets_.data() + 16 * (static_cast<std::size_t>(patch) * width_ + k);
    double p = 0, p_s = 0, p_t = 0;
    for (int j = 0; j < 4; ++j) {
      double row = 0, row_s = 0;
      for (int i = 0; i < 4; ++i) {
        row += bs[i] * net[4 * j + i];
        row_s += ds[i] * net[4 * j + i];
      }
      p += bt[j] * row;
      p_s += bt[j] * row_s;
      p_t += dt[j] * row;
    }
    if (has_bump) {
      const double* bump = bumps_.data() + 4 * (static_cast<std::size_t>(info.bump) * width_ + k);
      for (int i = 0; i < 4; ++i) {
        p += w.g[i] * bump[i];
        p_s += w.g_s[i] * bump[i];
        p_t += w.g_t[i] * bump[i];
      }
    }
    value[k] = p;
    d_du[k] = p_s / info.du;
    d_dv[k] = p_t / info.dv;
  }
}

double PrimvarSurface::mean(std::uint32_t face, std::uint32_t first, std::uint32_t count,
                            int k) const {
  const std::uint32_t begin = first_corner_[face], size = first_corner_[face + 1] - begin;
  double sum = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::int32_t row = corner_rows_[begin + (first + i) % size];
    sum += values_[static_cast<std::size_t>(row) * width_ + k];
  }
  return sum / count;
}

void PrimvarSurface::evaluate_linear(std::uint32_t face, std::uint32_t sub_quad, double u, double v,
                                     double* value, double* d_du, double* d_dv) const {
  const std::uint32_t n = first_corner_[face + 1] - first_corner_[face];
  for (int k = 0; k < width_; ++k) {
    // Values at (0,0), (1,0), (1,1), (0,1). A sub-quad goes from its corner over the middle of the
    // next edge and the face's centre to the middle of the edge before.
    double c[4];
    for (std::uint32_t i = 0; i < 4; ++i) c[i] = n == 4 ? mean(face, i, 1, k) : 0;
    if (n != 4) {
      c[0] = mean(face, sub_quad, 1, k);
      c[1] = mean(face, sub_quad, 2, k);
      c[2] = mean(face, 0, n, k);
      c[3] = mean(face, sub_quad + n - 1, 2, k);
    }
    const double below = c[0] + u * (c[1] - c[0]), above = c[3] + u * (c[2] - c[3]);
    value[k] = below + v * (above - below);
    d_du[k] = (1 - v) * (c[1] - c[0]) + v * (c[2] - c[3]);
    d_dv[k] = above - below;
  }
}

}  // namespace limitray

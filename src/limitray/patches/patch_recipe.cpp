// Stage: patches (S0). See patch_recipe.h.
#include "limitray/patches/patch_recipe.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "limitray/patches/bspline.h"
#include "limitray/patches/gregory_net.h"

namespace limitray {

// Stencils.

void StencilList::add(std::span<const std::int32_t> sources, std::span<const double> weights) {
  double kept[1024];
  std::vector<double> many;
  double* mask = kept;
  if (weights.size() > std::size(kept)) {
    many.resize(weights.size());
    mask = many.data();
  }
  std::size_t size = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    mask[size++] = weights[i];
    sources_.push_back(sources[i]);
  }
  mask_of_point_.push_back(find_mask({mask, size}));
}

std::uint32_t StencilList::find_mask(std::span<const double> weights) {
  std::uint64_t hash = weights.size();
  for (double w : weights) {
    std::uint64_t bits;
    std::memcpy(&bits, &w, sizeof bits);
    hash = (hash ^ bits) * 0x9E3779B97F4A7C15ull;
    hash ^= hash >> 29;
  }
  const auto [begin, end] = masks_by_hash_.equal_range(hash);
  for (auto it = begin; it != end; ++it) {
    const std::uint32_t first = mask_begin_[it->second], last = mask_begin_[it->second + 1];
    if (std::equal(weights.begin(), weights.end(), weights_.begin() + first,
                   weights_.begin() + last))
      return it->second;
  }
  const auto mask = static_cast<std::uint32_t>(mask_begin_.size() - 1);
  weights_.insert(weights_.end(), weights.begin(), weights.end());
  mask_begin_.push_back(static_cast<std::uint32_t>(weights_.size()));
  masks_by_hash_.emplace(hash, mask);
  return mask;
}

void StencilList::finish() {
  masks_by_hash_.clear();
  masks_by_hash_.rehash(0);
  mask_of_point_.shrink_to_fit();
  sources_.shrink_to_fit();
  weights_.shrink_to_fit();
}

void StencilList::apply(std::vector<Vec3d>& points) const {
  const std::size_t first = points.size();
  points.resize(first + size());
  const std::int32_t* source = sources_.data();
  for (std::size_t i = 0; i < size(); ++i) {
    const std::uint32_t begin = mask_begin_[mask_of_point_[i]],
                        end = mask_begin_[mask_of_point_[i] + 1];
    Vec3d sum{};
    for (std::uint32_t w = begin; w < end; ++w) sum = sum + weights_[w] * points[*source++];
    points[first + i] = sum;
  }
}

// Nets.

namespace {

/// One component of the pieces of a crease patch: the map across the crease, then B-spline to
/// Bezier along it. Writes component `k` of consecutive nets.
void make_crease_nets(const double (&p)[16], unsigned edge, const std::vector<CreasePiece>& pieces,
                      PatchNet<double>* nets, int k) {
  const bool across_t = edge == edge_t0 || edge == edge_t1;
  const bool reversed = edge == edge_t1 || edge == edge_s1;
  const int across = across_t ? 4 : 1, along = across_t ? 1 : 4;

  for (std::size_t n = 0; n < pieces.size(); ++n) {
    double* net = nets[n].c[k];
    for (int row = 0; row < 4; ++row) {
      const int to = (reversed ? 3 - row : row) * across;
      for (int i = 0; i < 4; ++i) {
        double sum = 0;
        for (int j = 0; j < 4; ++j)
          sum += pieces[n].weights[row][j] * p[(reversed ? 3 - j : j) * across + i * along];
        net[to + i * along] = sum;
      }
      bspline_to_bezier(net + to, along);
    }
  }
}

template <std::size_t N>
void gather(const std::array<std::int32_t, N>& indices, const std::vector<Vec3d>& points, int k,
            double (&values)[N]) {
  for (std::size_t i = 0; i < N; ++i) values[i] = points[indices[i]][k];
}

double largest(const double* values, int count) {
  double m = 0;
  for (int i = 0; i < count; ++i) m = std::max(m, std::abs(values[i]));
  return m;
}

/// Largest |control value| of a Gregory patch's component, both points of each pair included.
double largest(const double (&net)[16], const double (&bump)[4]) {
  double m = largest(net, 16);
  for (int i = 0; i < 4; ++i)
    m = std::max(m, std::abs(net[interior_index[i]]) + std::abs(bump[i]));
  return m;
}

}  // namespace

double PatchRecipe::make(std::span<const Vec3d> cage_points, Vec3d origin, PatchNet<double>* nets,
                         PatchBump<double>* bumps) const {
  std::vector<Vec3d> points;
  points.reserve(control_points.size() + stencils.size());
  for (std::int32_t i : control_points) points.push_back(cage_points[i] - origin);
  stencils.apply(points);

  double radius = 0;
  for (const RegularPatch& patch : regular) {
    std::size_t count = 1;
    for (int k = 0; k < 3; ++k) {
      double p[16];
      gather(patch.points, points, k, p);
      if (patch.crease != no_crease) {
        count = creases[patch.crease].size();
        make_crease_nets(p, patch.edges, creases[patch.crease], nets, k);
      } else {
        extrapolate_boundaries(p, patch.edges);
        bspline_to_bezier(p);
        std::copy(p, p + 16, nets->c[k]);
      }
    }
    for (std::size_t n = 0; n < count; ++n)
      radius = std::max(radius, largest(nets[n].c[0], 48));
    nets += count;
  }
  for (const GregoryPatch& patch : gregory) {
    for (int k = 0; k < 3; ++k) {
      double p[20];
      gather(patch, points, k, p);
      gregory_to_net(p, nets->c[k], bumps->c[k]);
      radius = std::max(radius, largest(nets->c[k], bumps->c[k]));
    }
    ++nets;
    ++bumps;
  }
  return radius;
}

}  // namespace limitray

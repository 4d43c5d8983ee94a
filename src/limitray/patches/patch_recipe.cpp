// Stage: patches (S0). See patch_recipe.h.
#include "limitray/patches/patch_recipe.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "limitray/patches/bspline.h"
#include "limitray/patches/gregory_net.h"

namespace limitray {

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

/// `count` is a multiple of 4: four maxima at a time, so that none waits for the one before.
double largest(const double* values, int count) {
  double m[4] = {};
  for (int i = 0; i < count; i += 4)
    for (int k = 0; k < 4; ++k) m[k] = std::max(m[k], std::abs(values[i + k]));
  return std::max(std::max(m[0], m[1]), std::max(m[2], m[3]));
}

/// Largest |control value| of a Gregory patch's component, both points of each pair included.
double largest(const double (&net)[16], const double (&bump)[4]) {
  double m = largest(net, 16);
  for (int i = 0; i < 4; ++i) m = std::max(m, std::abs(net[interior_index[i]]) + std::abs(bump[i]));
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
    for (std::size_t n = 0; n < count; ++n) radius = std::max(radius, largest(nets[n].c[0], 48));
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

namespace {

/// Centre of the box around the points that the recipes use: a stray point elsewhere costs no
/// precision.
Vec3d centre(std::span<const PatchRecipe> recipes, std::span<const Vec3d> points) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Vec3d low{infinity, infinity, infinity}, high = -1.0 * low;
  for (const PatchRecipe& recipe : recipes)
    for (const std::int32_t i : recipe.control_points)
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], points[i][k]);
        high[k] = std::max(high[k], points[i][k]);
      }
  return low.x > high.x ? Vec3d{} : 0.5 * low + 0.5 * high;
}

}  // namespace

PatchBuffer<double> run_recipes(std::span<const PatchRecipe> recipes, std::span<const Vec3d> points,
                                const std::function<void()>& stop) {
  std::vector<std::size_t> first_net{0}, first_bump{0};
  for (const PatchRecipe& recipe : recipes) {
    first_net.push_back(first_net.back() + recipe.infos.size());
    first_bump.push_back(first_bump.back() + recipe.gregory.size());
  }
  PatchBuffer<double> patches;
  patches.origin = centre(recipes, points);
  patches.nets.resize(first_net.back());
  patches.infos.resize(first_net.back());
  patches.bumps.resize(first_bump.back());

  std::vector<double> radius(recipes.size());
  tbb::parallel_for(std::size_t{0}, recipes.size(), [&](std::size_t r) {
    if (stop) stop();
    PatchInfo* infos = patches.infos.data() + first_net[r];
    for (PatchInfo info : recipes[r].infos) {
      if (info.bump != no_bump) info.bump += static_cast<std::uint32_t>(first_bump[r]);
      *infos++ = info;
    }
    radius[r] = recipes[r].make(points, patches.origin, patches.nets.data() + first_net[r],
                                patches.bumps.data() + first_bump[r]);
  });
  for (const double r : radius) patches.radius = std::max(patches.radius, r);
  return patches;
}

}  // namespace limitray

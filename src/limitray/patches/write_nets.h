// Stage: patches (S0). Comes in: a block of patches as points. Goes out: their nets and bumps, as
// computed in double, rounded once to T. Compiled for each instruction set: but for pieces of
// creases the bits are the same (bspline.h). Stencils, where a fused multiply-add would change
// them, are not.
#pragma once

#include "limitray/patches/bspline.h"
#include "limitray/patches/gregory_net.h"
#include "limitray/patches/patch_recipe.h"
#include "limitray/patches/patch_values.h"

namespace limitray {

/// Where nets go: patch i, counted over all recipes, to place[i] (i if that is null), its bump to
/// the index in `infos` there.
template <class T>
struct NetPlaces {
  PatchNet<T>* nets;
  PatchBump<T>* bumps;
  const PatchInfo* infos;
  const std::uint32_t* place;
};

inline namespace LIMITRAY_ISA {

template <class T>
std::size_t place_of(const NetPlaces<T>& places, std::size_t patch) {
  return places.place ? places.place[patch] : patch;
}

/// Rounds 4 points to T and transposes them: x[k], y[k], z[k] are point k.
template <class T>
void store_components(const Quad<double>* points, T* x, T* y, T* z) {
  Quad<T> p[4];
  for (int k = 0; k < 4; ++k) p[k] = __builtin_convertvector(points[k], Quad<T>);
  const Quad<T> xy01 = __builtin_shufflevector(p[0], p[1], 0, 4, 1, 5);
  const Quad<T> xy23 = __builtin_shufflevector(p[2], p[3], 0, 4, 1, 5);
  const Quad<T> z01 = __builtin_shufflevector(p[0], p[1], 2, 6, 3, 7);
  const Quad<T> z23 = __builtin_shufflevector(p[2], p[3], 2, 6, 3, 7);
  store_quad<T>(x, __builtin_shufflevector(xy01, xy23, 0, 1, 4, 5));
  store_quad<T>(y, __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7));
  store_quad<T>(z, __builtin_shufflevector(z01, z23, 0, 1, 4, 5));
}
template <class T>
void store_net(const Quad<double> (&points)[16], PatchNet<T>& net) {
  for (int k = 0; k < 16; k += 4)
    store_components(points + k, net.c[0] + k, net.c[1] + k, net.c[2] + k);
}

/// One piece of a crease patch: the map across the crease, then B-spline to Bezier along it.
inline void crease_to_bezier(Quad<double> (&p)[16], unsigned edge, const CreasePiece& piece) {
  const bool across_t = edge == edge_t0 || edge == edge_t1;
  const bool reversed = edge == edge_t1 || edge == edge_s1;
  const int across = across_t ? 4 : 1, along = across_t ? 1 : 4;
  const auto at = [&](int row) { return (reversed ? 3 - row : row) * across; };

  for (int i = 0; i < 4; ++i) {
    Quad<double> mapped[4] = {};
    for (int row = 0; row < 4; ++row)
      for (int j = 0; j < 4; ++j) mapped[row] += piece.weights[row][j] * p[at(j) + i * along];
    for (int row = 0; row < 4; ++row) p[at(row) + i * along] = mapped[row];
  }
  for (int row = 0; row < 4; ++row) bspline_to_six_bezier(p + row * across, along);
  for (Quad<double>& v : p) v = (1.0 / 6) * v;
}

template <std::size_t n>
void gather(const std::array<std::int32_t, n>& indices, const Point4* points,
            Quad<double> (&values)[n]) {
  for (std::size_t i = 0; i < n; ++i) values[i] = load_quad(points[indices[i]].c);
}

using PointRange = ValueRange<Quad<double>>;

template <class T>
void write_regular(const PatchBlock& block, std::size_t i, PatchNet<T>& net, PointRange& range) {
  const RegularPatch& patch = block.recipe->regular[i];
  Quad<double> p[16];
  gather(patch.points, block.points, p);
  if (patch.piece != no_piece) {
    crease_to_bezier(p, patch.edges, block.recipe->pieces[patch.piece]);
  } else {
    if (patch.edges) extrapolate_boundaries(p, patch.edges);
    bspline_to_bezier(p);
  }
  store_net(p, net);
  for (int k = 0; k < 16; k += 2) range.add(p[k], p[k + 1]);
}

/// The range is that of both points of each Gregory pair, too.
template <class T>
void write_gregory(const PatchBlock& block, std::size_t i, PatchNet<T>& net, PatchBump<T>& bump,
                   PointRange& range) {
  Quad<double> p[20], values[16], difference[4];
  gather(block.recipe->gregory[i], block.points, p);
  gregory_to_net(p, values, difference);
  store_net(values, net);
  store_components(difference, bump.c[0], bump.c[1], bump.c[2]);
  for (int k = 0; k < 16; k += 2) range.add(values[k], values[k + 1]);
  for (int k = 0; k < 4; ++k) {
    const Quad<double> mean = values[interior_index[k]];
    range.add(mean + difference[k], mean - difference[k]);
  }
}

/// Writes a block's nets and bumps to their places. Returns the largest |control value|.
template <class T>
double write_nets(const PatchBlock& block, const NetPlaces<T>& to) {
  const std::size_t regular = block.recipe->regular.size();
  PointRange range(Quad<double>{});
  for (std::size_t i = block.begin; i < block.end; ++i) {
    const std::size_t place = place_of(to, block.first_net + i);
    if (i < regular)
      write_regular(block, i, to.nets[place], range);
    else
      write_gregory(block, i - regular, to.nets[place], to.bumps[to.infos[place].bump], range);
  }
  const Quad<double> reach = range.magnitude();
  return max(max(double(reach[0]), double(reach[1])), double(reach[2]));
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

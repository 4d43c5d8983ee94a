// Stage: BVH. Comes in: a block of patches as points. Goes out: all that the tracer and the tree
// read of them (nets, models, hulls), made while the nets are in the cache.
#pragma once

#include <algorithm>

#include "limitray/bvh/bounds.h"
#include "limitray/patches/patch_model.h"
#include "limitray/patches/write_nets.h"

namespace limitray {

/// Where to write; `models` and `hulls` are in the order of the nets.
struct TracePlaces {
  NetPlaces<float> nets;
  PatchModel<float>* models;
  PatchHull<float>* hulls;
};

inline namespace LIMITRAY_ISA {

/// Packs the models of all lanes: PatchModel<float> as rows of 16 values.
inline void store_models(const ModelValues<Lanes>& m,
                         PatchModel<float>* const (&models)[lane_count]) {
  Lanes values[16];
  for (int axis = 0; axis < 3; ++axis) {
    const ModelValues<Lanes>::Axis& a = m.axis[axis];
    const LaneBits d_u = LaneBits(a.d_u) + 0xFFFFu, d_v = LaneBits(a.d_v) + 0xFFFFu;
    Lanes* to = values + 4 * axis;
    to[0] = a.p, to[1] = a.p_u, to[2] = a.p_v;
    to[3] = Lanes((d_u >> 16) | (d_v & 0xFFFF0000u));  // HalfBounds
  }
  values[12] = m.below, values[13] = m.above, values[14] = Lanes{};
  values[15] = m.curvature;
  float* rows[lane_count];
  for (int j = 0; j < lane_count; ++j) rows[j] = &models[j]->axis[0].p;
  store_by_lane(values, rows);
}
/// By way of whole rows: what the compiler makes of single values is a slow scatter.
inline void store_hulls(const PatchHull<Lanes>& h, PatchHull<float>* const (&hulls)[lane_count]) {
  const Lanes values[16] = {h.lo[0], h.lo[1], h.lo[2], h.hi[0], h.hi[1], h.hi[2]};
  float rows[lane_count][16];
  float* to[lane_count];
  for (int j = 0; j < lane_count; ++j) to[j] = rows[j];
  store_by_lane(values, to);
  for (int j = 0; j < lane_count; ++j) std::memcpy(hulls[j], rows[j], sizeof(*hulls[j]));
}

/// Models and hulls of a block of at most lane_count patches; where they are fewer, the last one is
/// made several times.
inline void write_models_and_hulls(const PatchBlock& block, const TracePlaces& to) {
  const std::size_t regular = block.recipe->regular.size();
  const PatchNet<float>* nets[lane_count];
  const PatchBump<float>* bumps[lane_count];
  PatchModel<float>* models[lane_count];
  PatchHull<float>* hulls[lane_count];
  for (std::size_t j = 0; j < lane_count; ++j) {
    const std::size_t i = std::min(block.begin + j, block.end - 1);
    const std::size_t place = place_of(to.nets, block.first_net + i);
    nets[j] = to.nets.nets + place;
    bumps[j] = i < regular ? nullptr : to.nets.bumps + to.nets.infos[place].bump;
    models[j] = to.models + place;
    hulls[j] = to.hulls + place;
  }
  PatchValues<Lanes> values;
  ModelValues<Lanes> model;
  PatchHull<Lanes> hull;
  load_values(nets, bumps, values);
  make_patch_model(values, model);
  make_patch_hull(values, hull);
  store_models(model, models);
  store_hulls(hull, hulls);
}

/// Calls f for parts of a block, in order, of at most `size` patches each.
template <class F>
void for_each_part(const PatchBlock& block, std::size_t size, const F& f) {
  PatchBlock part = block;
  for (; part.begin < block.end; part.begin = part.end) {
    part.end = std::min(part.begin + size, block.end);
    f(part);
  }
}

/// Writes a block's patches; returns the largest |control value|.
inline double write_patches(const PatchBlock& block, const TracePlaces& to) {
  constexpr std::size_t at_once = 64;  // their nets fit the first cache
  double radius = 0;
  for_each_part(block, at_once, [&](const PatchBlock& part) {
    radius = max(radius, write_nets(part, to.nets));
    for_each_part(part, lane_count,
                  [&](const PatchBlock& lanes) { write_models_and_hulls(lanes, to); });
  });
  return radius;
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// A cage with random subdivision tags: crossings, ends and changes of creases, sharp corners,
// holes.
#pragma once

#include <random>

#include "limitray/cage/cage.h"
#include "limitray/cage/topology.h"

namespace limitray::test {

/// `cage` with other creases, corners, holes and rules. Half of the creases share one sharpness.
inline ControlCage with_random_creases(ControlCage cage, unsigned seed) {
  std::mt19937 random(seed);
  const auto one_in = [&](unsigned n) { return random() % n == 0; };
  constexpr float sharpnesses[] = {0.05f, 0.3f, 1, 1.5f, 2, 2.5f, 3.7f, 4.2f, 10};
  const auto any_sharpness = [&] { return sharpnesses[random() % std::size(sharpnesses)]; };

  cage.interpolate_boundary = static_cast<InterpolateBoundary>(random() % 3);
  cage.creasing_method = static_cast<CreasingMethod>(random() % 2);
  cage.triangle_subdivision_rule = static_cast<TriangleSubdivisionRule>(random() % 2);
  cage.crease_indices.clear();
  cage.crease_lengths.clear();
  cage.crease_sharpnesses.clear();
  cage.corner_indices.clear();
  cage.corner_sharpnesses.clear();
  cage.hole_indices.clear();

  const float common = any_sharpness();
  const unsigned rarity = 1 + random() % 6;
  for (const CageTopology::Edge& edge : make_topology(cage).edges) {
    if (!one_in(rarity)) continue;
    cage.crease_indices.insert(cage.crease_indices.end(), {edge.v0, edge.v1});
    cage.crease_lengths.push_back(2);
    cage.crease_sharpnesses.push_back(one_in(2) ? common : any_sharpness());
  }
  for (std::size_t v = 0; v < cage.points.size(); ++v) {
    if (!one_in(10)) continue;
    cage.corner_indices.push_back(static_cast<std::int32_t>(v));
    cage.corner_sharpnesses.push_back(any_sharpness());
  }
  for (std::size_t f = 0; f < cage.face_count(); ++f)
    if (one_in(20)) cage.hole_indices.push_back(static_cast<std::int32_t>(f));
  return cage;
}

}  // namespace limitray::test

// Stage: patches (S0). The one rounding of the patches, from double to the tracer's type, and their
// order in memory. See refine.h.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>

#include "limitray/patches/refine.h"

namespace limitray {

template <class T>
PatchBuffer<T> round_patches(const PatchBuffer<double>& patches,
                             std::span<const std::uint32_t> order) {
  assert(order.empty() || order.size() == patches.size());
  PatchBuffer<T> rounded;
  rounded.origin = patches.origin;
  rounded.radius = patches.radius;
  rounded.infos.reserve(patches.size());
  std::vector<std::uint32_t> bump_from;
  bump_from.reserve(patches.bumps.size());
  for (std::size_t i = 0; i < patches.size(); ++i) {
    PatchInfo info = patches.infos[order.empty() ? i : order[i]];
    if (info.bump != no_bump) {
      bump_from.push_back(info.bump);
      info.bump = static_cast<std::uint32_t>(bump_from.size() - 1);
    }
    rounded.infos.push_back(info);
  }

  const auto round = [](double x) { return static_cast<T>(x); };
  rounded.nets.resize(patches.size());
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t i) {
    const double* net = patches.nets[order.empty() ? i : order[i]].c[0];
    std::transform(net, net + 48, rounded.nets[i].c[0], round);
  });
  rounded.bumps.resize(patches.bumps.size());
  tbb::parallel_for(std::size_t{0}, bump_from.size(), [&](std::size_t i) {
    const double* bump = patches.bumps[bump_from[i]].c[0];
    std::transform(bump, bump + 12, rounded.bumps[i].c[0], round);
  });
  return rounded;
}

template PatchBuffer<float> round_patches(const PatchBuffer<double>&,
                                          std::span<const std::uint32_t>);
template PatchBuffer<double> round_patches(const PatchBuffer<double>&,
                                           std::span<const std::uint32_t>);

}  // namespace limitray

// Stage: patches (S0). The one rounding of the patches, from double to the tracer's type, and their
// order in memory. See refine.h.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>

#include "limitray/patches/refine.h"

namespace limitray {

std::vector<PatchInfo> in_order(std::span<const PatchInfo> infos,
                                std::span<const std::uint32_t> order) {
  assert(order.size() == infos.size());
  std::vector<PatchInfo> ordered;
  ordered.reserve(infos.size());
  std::uint32_t bumps = 0;
  for (const std::uint32_t i : order) {
    ordered.push_back(infos[i]);
    if (infos[i].bump != no_bump) ordered.back().bump = bumps++;
  }
  return ordered;
}

template <class T>
PatchBuffer<T> round_patches(const PatchBuffer<double>& patches,
                             std::span<const std::uint32_t> order) {
  PatchBuffer<T> rounded;
  rounded.origin = patches.origin;
  rounded.radius = patches.radius;
  rounded.infos = order.empty() ? patches.infos : in_order(patches.infos, order);
  rounded.nets.resize(patches.size());
  rounded.bumps.resize(patches.bumps.size());
  const auto round = [](double x) { return static_cast<T>(x); };
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t i) {
    const std::size_t from = order.empty() ? i : order[i];
    const double* net = patches.nets[from].c[0];
    std::transform(net, net + 48, rounded.nets[i].c[0], round);
    if (rounded.infos[i].bump == no_bump) return;
    const double* bump = patches.bumps[patches.infos[from].bump].c[0];
    std::transform(bump, bump + 12, rounded.bumps[rounded.infos[i].bump].c[0], round);
  });
  return rounded;
}

template PatchBuffer<float> round_patches(const PatchBuffer<double>&,
                                          std::span<const std::uint32_t>);
template PatchBuffer<double> round_patches(const PatchBuffer<double>&,
                                           std::span<const std::uint32_t>);

}  // namespace limitray

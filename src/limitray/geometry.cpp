// Stage: scene, inside. See geometry.h.
#include "limitray/geometry.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace limitray {
namespace {

/// Calls f(i) for i below n, in parallel.
template <class F>
void for_each_index(std::size_t n, const F& f) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) f(i);
  });
}

std::vector<std::uint32_t> inverse(std::span<const std::uint32_t> order) {
  std::vector<std::uint32_t> place(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = static_cast<std::uint32_t>(i);
  return place;
}

}  // namespace

PatchBuffer<float> unwritten_patches(const Refiner& refiner) {
  auto patches = refiner.unwritten_patches<float>();
  patches.models.resize(patches.size());
  return patches;
}

Hulls write_patches(const Refiner& refiner, std::span<const Vec3d> points,
                    std::span<const std::uint32_t> place, PatchBuffer<float>& patches,
                    const std::function<void()>& stop) {
  auto hulls = std::make_unique_for_overwrite<PatchHull<float>[]>(patches.size());
  const TracePlaces to{{patches.nets.data(), patches.bumps.data(), patches.infos.data(),
                        place.empty() ? nullptr : place.data()},
                       patches.models.data(),
                       hulls.get()};
  const PatchExtent extent = refiner.write_patches(
      points, [&](const PatchBlock& block) { return kernels().write_patches(block, to); }, stop);
  patches.origin = extent.origin;
  // A surface of one point is given a size above 0, so that bounds on rounding are, too.
  patches.radius = std::max(extent.radius, smallest_extent);
  return hulls;
}

std::vector<Box> boxes_of(const Hulls& hulls, const PatchBuffer<float>& patches) {
  std::vector<Box> boxes(patches.size());
  const float padding = box_padding(patches.radius);
  for_each_index(boxes.size(), [&](std::size_t i) { boxes[i] = padded(hulls[i], padding); });
  return boxes;
}

void Geometry::build(const std::function<void()>& stop, const std::function<bool()>& cancelled) {
  patches = unwritten_patches(refiner);
  // Boxes in the refiner's order make the tree; then patches move to the order of its leaves. To
  // make them again takes less time than the memory of a copy.
  bvh = build_bvh(boxes_of(write_patches(refiner, cage.points, {}, patches, stop), patches),
                  cancelled);
  stop();
  patches.infos = in_order(patches.infos, bvh.order);
  leaf_of = inverse(bvh.order);
  refiner.sort_patches(leaf_of);
  write_patches(refiner, cage.points, leaf_of, patches, stop);
}

void Geometry::move_patches(std::span<const Vec3d> points) {
  const Hulls hulls = write_patches(refiner, points, leaf_of, patches);
  refit_bvh(bvh, {hulls.get(), patches.size()}, box_padding(patches.radius));
  patches_double = PatchBuffer<double>{};
  error_of_limit.reset();
}

const PatchBuffer<double>& Geometry::in_double() const {
  const std::lock_guard lock(mutex);
  if (patches_double.size() == patches.size()) return patches_double;
  PatchBuffer<double> p =
      round_patches<double>(refiner.make_patches(cage.points), inverse(leaf_of));
  p.radius = patches.radius;
  p.models.resize(p.size());
  for_each_index(p.size(), [&](std::size_t i) {
    const std::uint32_t bump = p.infos[i].bump;
    p.models[i] = kernels().patch_model_d(p.nets[i], bump == no_bump ? nullptr : &p.bumps[bump]);
  });
  patches_double = std::move(p);
  return patches_double;
}

}  // namespace limitray

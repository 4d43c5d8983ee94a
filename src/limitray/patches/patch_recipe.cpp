// Stage: patches (S0). See patch_recipe.h.
#include "limitray/patches/patch_recipe.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <numeric>

namespace limitray {
namespace {

using Range = tbb::blocked_range<std::size_t>;

double larger(double a, double b) { return std::max(a, b); }

/// Positions in `values`, the smallest value's first.
std::vector<std::uint32_t> sorted_positions(std::span<const std::uint32_t> values) {
  std::vector<std::uint32_t> positions(values.size());
  std::iota(positions.begin(), positions.end(), 0);
  std::sort(positions.begin(), positions.end(),
            [&](std::uint32_t a, std::uint32_t b) { return values[a] < values[b]; });
  return positions;
}

template <class T>
void permute(std::span<T> values, std::span<const std::uint32_t> order) {
  const std::vector<T> old(values.begin(), values.end());
  for (std::size_t i = 0; i < order.size(); ++i) values[i] = old[order[i]];
}

/// Memory for the points of as many recipes as run at a time: it stays in the cache, where that of
/// all recipes would not. There must be no more takers than `recipes`.
class PointPool {
 public:
  PointPool(std::size_t recipes, std::size_t points)
      : memory_(std::make_unique_for_overwrite<Point4[]>(recipes * points)) {
    for (std::size_t i = 0; i < recipes; ++i) free_.push_back(memory_.get() + i * points);
  }
  Point4* take() {
    const std::lock_guard lock(mutex_);
    Point4* points = free_.back();
    free_.pop_back();
    return points;
  }
  void give_back(Point4* points) {
    const std::lock_guard lock(mutex_);
    free_.push_back(points);
  }

 private:
  const std::unique_ptr<Point4[]> memory_;
  std::mutex mutex_;
  std::vector<Point4*> free_;
};

}  // namespace

void PatchRecipe::make_points(std::span<const Vec3d> cage_points, Vec3d origin,
                              Point4* points) const {
  Point4* to = points;
  for (const std::int32_t i : control_points) {
    const Vec3d p = cage_points[i] - origin;
    *to++ = {{p.x, p.y, p.z, 0}};
  }
  stencils.apply(points, control_points.size());
}

void PatchRecipe::sort_patches(std::span<std::uint32_t> place) {
  const std::size_t bezier = regular.size();
  const auto sort = [&]<class Patch>(std::span<Patch> patches, std::size_t first) {
    const std::span<std::uint32_t> places = place.subspan(first, patches.size());
    const std::vector<std::uint32_t> order = sorted_positions(places);
    permute(patches, std::span<const std::uint32_t>(order));
    permute(places, std::span<const std::uint32_t>(order));
    permute(std::span(infos).subspan(first, patches.size()), std::span<const std::uint32_t>(order));
  };
  sort(std::span(regular), 0);
  sort(std::span(gregory), bezier);
  for (std::size_t i = 0; i < gregory.size(); ++i)
    infos[bezier + i].bump = static_cast<std::uint32_t>(i);
}

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

std::vector<PatchInfo> infos_of(std::span<const PatchRecipe> recipes) {
  std::size_t count = 0;
  for (const PatchRecipe& recipe : recipes) count += recipe.size();
  std::vector<PatchInfo> infos;
  infos.reserve(count);
  std::uint32_t bumps = 0;
  for (const PatchRecipe& recipe : recipes) {
    for (PatchInfo info : recipe.infos) {
      if (info.bump != no_bump) info.bump += bumps;
      infos.push_back(info);
    }
    bumps += static_cast<std::uint32_t>(recipe.gregory.size());
  }
  return infos;
}

double run_recipes(std::span<const PatchRecipe> recipes, std::span<const Vec3d> cage_points,
                   Vec3d origin, const BlockWriter& write, const std::function<void()>& stop) {
  std::vector<std::size_t> first_net{0};
  std::size_t most_points = 0;
  for (const PatchRecipe& recipe : recipes) {
    first_net.push_back(first_net.back() + recipe.size());
    most_points = std::max(most_points, recipe.point_count());
  }
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  PointPool pool(std::min(threads, recipes.size()), most_points);

  const auto run = [&](std::size_t r) {
    if (stop) stop();
    Point4* points = pool.take();
    recipes[r].make_points(cage_points, origin, points);
    const auto write_range = [&](const Range& nets, double radius) {
      return larger(radius, write({&recipes[r], points, nets.begin(), nets.end(), first_net[r]}));
    };
    // Isolated: a thread that waits here begins no other recipe.
    const double radius = tbb::this_task_arena::isolate([&] {
      return tbb::parallel_reduce(Range(0, recipes[r].size(), 256), 0.0, write_range, larger);
    });
    pool.give_back(points);
    return radius;
  };
  const auto run_range = [&](const Range& range, double radius) {
    for (std::size_t r = range.begin(); r < range.end(); ++r) radius = larger(radius, run(r));
    return radius;
  };
  return tbb::parallel_reduce(Range(0, recipes.size()), 0.0, run_range, larger);
}

}  // namespace limitray

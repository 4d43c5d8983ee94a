#include "limitray/scene.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <tuple>

#include "limitray/arguments.h"
#include "limitray/geometry.h"
#include "limitray/intersect/ray_order.h"
#include "limitray/limits.h"
#include "limitray/patches/gregory_error.h"

namespace limitray {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Adds up the work of one block of rays.
void add(Statistics& sum, const Statistics& s) {
  sum.rays += s.rays;
  sum.node_visits += s.node_visits;
  sum.patch_tests += s.patch_tests;
  sum.early_outs += s.early_outs;
  sum.splits += s.splits;
  sum.backtracks += s.backtracks;
  sum.newton_runs += s.newton_runs;
  sum.newton_steps += s.newton_steps;
  sum.unresolved += s.unresolved;
}

/// Intersections of one ray, sorted by t; what a shared border reported twice is counted once: same
/// geometry, same side of the surface, t equal within the bounds.
void sort_and_merge(std::vector<Intersection>& hits) {
  std::sort(hits.begin(), hits.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
  double largest_error = 0;
  for (const Intersection& h : hits) largest_error = std::max(largest_error, h.t_error);
  std::vector<Intersection> merged;
  for (const Intersection& h : hits) {
    bool known = false;
    for (std::size_t k = merged.size(); k-- > 0 && !known;) {
      const Intersection& m = merged[k];
      if (h.t - m.t > h.t_error + largest_error) break;  // and so are all before
      known = m.geometry_id == h.geometry_id && m.front == h.front &&
              h.t - m.t <= m.t_error + h.t_error;
    }
    if (!known) merged.push_back(h);
  }
  hits = std::move(merged);
}

/// Room that calls leave for the next one: one for each that ran at the same time.
template <class T>
class SpareRooms {
 public:
  std::unique_ptr<SortedRays<T>> take() {
    const std::lock_guard lock(mutex_);
    if (rooms_.empty()) return std::make_unique<SortedRays<T>>();
    std::unique_ptr<SortedRays<T>> room = std::move(rooms_.back());
    rooms_.pop_back();
    return room;
  }
  void give(std::unique_ptr<SortedRays<T>> room) {
    const std::lock_guard lock(mutex_);
    rooms_.push_back(std::move(room));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<SortedRays<T>>> rooms_;
};

}  // namespace

struct Scene::State {
  tbb::task_arena arena;
  std::vector<std::unique_ptr<Geometry>> geometries;
  std::vector<InstanceView> instances;
  bool use_newton = true;

  // Tree over the instances; boxes are relative to `origin`. Made when rays come, so that adding
  // many instances takes linear time.
  Bvh top;
  Vec3d origin{};
  double radius = 0;
  bool top_is_stale = false;
  std::mutex top_mutex;

  std::tuple<SpareRooms<float>, SpareRooms<double>> spare_rooms;

  mutable std::mutex statistics_mutex;
  mutable Statistics statistics;

  explicit State(int threads) : arena(threads == 0 ? int(tbb::task_arena::automatic) : threads) {}

  std::array<Vec3d, 2> world_bounds(const InstanceView& in) const {
    return placed_bounds(*geometries[in.geometry], in.to_world);
  }

  /// Rebuilds the tree over the instances if one of them changed.
  void update_top() {
    const std::lock_guard lock(top_mutex);
    if (!top_is_stale) return;
    build_top();
    top_is_stale = false;
  }

  void build_top() {
    const std::array<Vec3d, 2> all = bounds();
    top = Bvh{};
    if (instances.size() < 2 || !(all[0].x <= all[1].x)) return;
    origin = 0.5 * (all[0] + all[1]);
    radius = 0;
    for (int i = 0; i < 3; ++i) radius = std::max(radius, all[1][i] - origin[i]);
    const float padding = box_padding(radius);
    std::vector<Box> boxes;
    std::vector<std::uint32_t> items;
    for (std::uint32_t k = 0; k < instances.size(); ++k) {
      const std::array<Vec3d, 2> b = world_bounds(instances[k]);
      if (!(b[0].x <= b[1].x)) continue;  // an empty surface
      Box box;
      for (int i = 0; i < 3; ++i) {
        box.lo[i] = -float_up(origin[i] - b[0][i]) - padding;
        box.hi[i] = float_up(b[1][i] - origin[i]) + padding;
      }
      boxes.push_back(box);
      items.push_back(k);
    }
    top = build_bvh(boxes);
    // A leaf of the tree must name the instance itself.
    for (BvhNode& node : top.nodes)
      for (std::uint32_t& child : node.child)
        if (child & leaf_flag) child = leaf_flag | items[top.order[child & ~leaf_flag]];
  }

  std::array<Vec3d, 2> bounds() const {
    const double inf = std::numeric_limits<double>::infinity();
    std::array<Vec3d, 2> all{Vec3d{inf, inf, inf}, Vec3d{-inf, -inf, -inf}};
    for (const InstanceView& in : instances) {
      const std::array<Vec3d, 2> b = world_bounds(in);
      for (int i = 0; i < 3; ++i) {
        all[0][i] = std::min(all[0][i], b[0][i]);
        all[1][i] = std::max(all[1][i], b[1][i]);
      }
    }
    return all;
  }

  template <class T>
  std::vector<GeometryView<T>> geometry_views() const {
    std::vector<GeometryView<T>> v;
    for (const auto& g : geometries) {
      if constexpr (std::is_same_v<T, float>)
        v.push_back(view_of(*g, g->patches));
      else
        v.push_back(view_of(*g, g->in_double()));
    }
    return v;
  }

  /// Rays a block: the more, the more they share; several blocks a thread.
  template <class T>
  static std::size_t block_size(std::size_t rays) {
    if (std::is_same_v<T, double>) return 128;  // these are traced one by one
    const std::size_t share = rays / (4 * std::size_t(tbb::this_task_arena::max_concurrency()));
    return std::clamp(share, std::size_t(64), std::size_t(max_rays_a_call));
  }
  /// For the rays of this scene, whose instances are in `extent` if there are several.
  RayOrder ray_order(const Extent& extent, std::size_t rays) const {
    std::size_t patches = 0;
    for (const auto& g : geometries) patches += g->patches.size();
    const bool single = instances.size() == 1 && instances[0].identity;
    const Geometry* g = single ? geometries[instances[0].geometry].get() : nullptr;
    return RayOrder(g ? view_of(*g, g->patches).extent : extent, patches, rays);
  }

  /// Sorts a batch, part by part: begin(sorted rays), then body(scene view, sorted rays, RayRange,
  /// statistics) over blocks, then end(sorted rays).
  template <class T, class Begin, class Body, class End>
  void parallel(const RayBatch<T>& batch, Progress* progress, Begin&& begin, const Body& body,
                End&& end) {
    arena.execute([&] {
      update_top();
      const std::vector<GeometryView<T>> views = geometry_views<T>();
      const SceneView<T> view{views, instances, top.nodes.empty() ? nullptr : top.nodes.data(),
                              extent_of(top.bounds, origin, radius), use_newton};
      const RayOrder order = ray_order(view.extent, std::min(batch.size(), max_sorted_rays));
      std::unique_ptr<SortedRays<T>> sorted = std::get<SpareRooms<T>>(spare_rooms).take();
      for (std::size_t first = 0; first < batch.size(); first += max_sorted_rays) {
        const std::size_t n = std::min(max_sorted_rays, batch.size() - first);
        sorted->sort(order, batch, first, n);
        begin(*sorted);
        std::vector<RayRange> traced;
        tbb::parallel_for(
            tbb::blocked_range<std::size_t>(0, n, block_size<T>(n)),
            [&](const auto& block) {
              if (progress && progress->cancel) return;
              const RayRange range{block.begin(), block.end()};
              Statistics s;
              body(view, sorted->batch(), range, s);
              if (progress) progress->done += range.size();
              const std::lock_guard lock(statistics_mutex);
              add(statistics, s);
              traced.push_back(range);
            },
            tbb::simple_partitioner());
        const bool cancelled = progress && progress->cancel;
        if (cancelled) sorted->keep_only(traced);
        end(*sorted);
        if (cancelled) throw Cancelled();
      }
      std::get<SpareRooms<T>>(spare_rooms).give(std::move(sorted));
    });
  }
  template <class T, class Kernel>
  void cast(const RayBatch<T>& rays, const HitArrays<T>& hits, Progress* progress, Kernel kernel) {
    check_batch(rays);
    HitArrays<T> sorted_hits;
    parallel(
        rays, progress, [&](SortedRays<T>& sorted) { sorted_hits = sorted.hits(hits); },
        [&](const auto& view, const auto& batch, RayRange range, auto& s) {
          kernel(view, batch, range, sorted_hits, s);
        },
        [&](const SortedRays<T>& sorted) { sorted.restore(hits); });
  }
  template <class T, class Kernel>
  void occlude(const RayBatch<T>& rays, std::uint8_t* occluded, Progress* progress, Kernel kernel) {
    check_batch(rays);
    std::uint8_t* sorted_answers = nullptr;
    parallel(
        rays, progress, [&](SortedRays<T>& sorted) { sorted_answers = sorted.occluded(); },
        [&](const auto& view, const auto& batch, RayRange range, auto& s) {
          kernel(view, batch, range, sorted_answers, s);
        },
        [&](const SortedRays<T>& sorted) { sorted.restore(occluded); });
  }
  /// on_ray(i, intersections) for the rays of a batch, one after the other.
  template <class OnRay>
  void intersect_all(const RayBatch<double>& rays, Progress* progress, OnRay&& on_ray) {
    check_batch(rays);
    std::vector<std::vector<Intersection>> all;
    std::size_t done = 0;
    parallel(
        rays, progress, [&](const auto& sorted) { all.resize(sorted.places().size()); },
        [&](const auto& view, const auto& batch, RayRange range, auto& s) {
          for (std::size_t i = range.begin; i < range.end; ++i) {
            all[i].clear();
            kernels().all_d(view, batch, i, all[i], s);
            sort_and_merge(all[i]);
          }
        },
        [&](const auto& sorted) {
          for (const std::uint32_t place : sorted.places()) {
            if (sorted.is_kept(place)) on_ray(done, all[place]);
            ++done;
          }
        });
  }

  const InstanceView& instance(std::uint32_t id) const {
    if (id >= instances.size())
      throw std::invalid_argument("geometry_id: must be below " + std::to_string(instances.size()) +
                                  ", got " + std::to_string(id));
    return instances[id];
  }
};

Scene::Scene(int threads) {
  if (threads < 0 || threads > most_threads)
    throw std::invalid_argument("threads: must be 0 (all cores) to " +
                                std::to_string(most_threads) + ", got " + std::to_string(threads));
  kernels();  // reports a wrong LIMITRAY_ISA early
  state_ = std::make_unique<State>(threads);
}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

std::uint32_t Scene::add_mesh(ControlCage cage, const MeshOptions& options, Progress* progress) {
  const auto start = std::chrono::steady_clock::now();
  const std::function<void()> stop = [progress] {
    if (progress && progress->cancel) throw Cancelled();
  };
  const Affine to_object = inverse(options.transform);
  check_options(options);
  validate(cage);
  check_extent(cage, cage.points);
  state_->arena.execute([&] {
    stop();
    const int level =
        options.isolation_level != 0
            ? options.isolation_level
            : choose_level(cage, options.tolerance, highest_chosen_level(options)).isolation_level;
    auto g = std::make_unique<Geometry>(std::move(cage),
                                        RefineOptions{level, options.memory_limit, stop});
    stop();
    g->build(stop, [progress] { return progress && progress->cancel; });
    stop();
    check_placed(placed_bounds(*g, options.transform));
    g->build_seconds = seconds_since(start);
    state_->geometries.push_back(std::move(g));
  });
  state_->instances.push_back({std::uint32_t(state_->geometries.size() - 1),
                               is_identity(options.transform), to_object, options.transform});
  state_->top_is_stale = true;
  return std::uint32_t(state_->instances.size() - 1);
}

std::uint32_t Scene::add_instance(std::uint32_t geometry_id, const Affine& transform) {
  const std::uint32_t geometry = state_->instance(geometry_id).geometry;
  const Affine to_object = inverse(transform);
  check_placed(placed_bounds(*state_->geometries[geometry], transform));
  state_->instances.push_back({geometry, is_identity(transform), to_object, transform});
  state_->top_is_stale = true;
  return std::uint32_t(state_->instances.size() - 1);
}

void Scene::truncate(std::size_t count) noexcept {
  if (count >= state_->instances.size()) return;
  state_->instances.resize(count);
  // Meshes are numbered as they are added, each with its first instance.
  std::size_t meshes = 0;
  for (const InstanceView& in : state_->instances)
    meshes = std::max(meshes, std::size_t(in.geometry) + 1);
  state_->geometries.resize(meshes);
  state_->top_is_stale = true;
}

void Scene::update_points(std::uint32_t geometry_id, std::span<const Vec3d> points) {
  const std::uint32_t geometry = state_->instance(geometry_id).geometry;
  Geometry& g = *state_->geometries[geometry];
  check_points(points, g.cage.points.size());
  check_extent(g.cage, points);
  state_->arena.execute([&] { g.move_patches(points); });
  try {
    for (const InstanceView& in : state_->instances)
      if (in.geometry == geometry) check_placed(placed_bounds(g, in.to_world));
  } catch (...) {
    // The same points make the same patches again: the scene is as it was.
    state_->arena.execute([&] { g.move_patches(g.cage.points); });
    throw;
  }
  std::copy(points.begin(), points.end(), g.cage.points.begin());
  state_->top_is_stale = true;
}

template <>
void Scene::cast_rays(const RayBatch<float>& rays, const HitArrays<float>& hits,
                      Progress* progress) const {
  state_->cast(rays, hits, progress, kernels().closest_f);
}
template <>
void Scene::cast_rays(const RayBatch<double>& rays, const HitArrays<double>& hits,
                      Progress* progress) const {
  state_->cast(rays, hits, progress, kernels().closest_d);
}
template <>
void Scene::test_occlusions(const RayBatch<float>& rays, std::uint8_t* occluded,
                            Progress* progress) const {
  state_->occlude(rays, occluded, progress, kernels().occluded_f);
}
template <>
void Scene::test_occlusions(const RayBatch<double>& rays, std::uint8_t* occluded,
                            Progress* progress) const {
  state_->occlude(rays, occluded, progress, kernels().occluded_d);
}

void Scene::count_intersections(const RayBatch<double>& rays, std::uint32_t* counts,
                                Progress* progress) const {
  state_->intersect_all(rays, progress, [&](std::size_t i, const auto& hits) {
    counts[i] = std::uint32_t(hits.size());
  });
}

IntersectionList Scene::list_intersections(const RayBatch<double>& rays, Progress* progress) const {
  IntersectionList list;
  list.offsets.push_back(0);
  state_->intersect_all(rays, progress, [&](std::size_t, const auto& hits) {
    for (const Intersection& h : hits) {
      list.t.push_back(h.t);
      list.uv.insert(list.uv.end(), {h.u, h.v});
      list.normal.insert(list.normal.end(), {h.normal.x, h.normal.y, h.normal.z});
      list.geometry_id.push_back(h.geometry_id);
      list.primitive_id.push_back(h.primitive_id);
      list.sub_quad.push_back(h.sub_quad);
    }
    list.offsets.push_back(list.t.size());
  });
  return list;
}

int Scene::primvar_width(const std::string& name) const {
  int width = 0;
  for (const auto& g : state_->geometries) {
    const Primvar* primvar = g->find_primvar(name);
    if (!primvar) continue;
    if (width != 0 && width != primvar->width)
      throw std::invalid_argument("primvar \"" + name + "\": has " + std::to_string(width) +
                                  " components in one mesh and " + std::to_string(primvar->width) +
                                  " in another");
    width = primvar->width;
  }
  return width;
}

void Scene::evaluate_primvar(const std::string& name, const SurfacePlaces& at, double* values,
                             double* d_du, double* d_dv, Progress* progress) const {
  const std::size_t n = at.geometry_ids.size();
  if (at.faces.size() != n || at.sub_quads.size() != n || at.uv.size() != 2 * n)
    throw std::invalid_argument("faces, sub_quads and uv: must have one row a geometry id");
  const auto width = static_cast<std::size_t>(primvar_width(name));
  std::vector<const PrimvarSurface*> surfaces(state_->geometries.size());
  for (const std::uint32_t id : at.geometry_ids) {
    if (id == invalid_id) continue;
    const std::uint32_t geometry = state_->instance(id).geometry;
    if (!surfaces[geometry]) surfaces[geometry] = state_->geometries[geometry]->surface_of(name);
  }
  const auto evaluate = [&](std::size_t i) {
    const std::uint32_t id = at.geometry_ids[i];
    const PrimvarSurface* surface =
        id == invalid_id ? nullptr : surfaces[state_->instances[id].geometry];
    const std::size_t row = i * width;
    const double missing = id == invalid_id ? 0 : std::numeric_limits<double>::quiet_NaN();
    if (surface)
      surface->evaluate(at.faces[i], at.sub_quads[i], at.uv[2 * i], at.uv[2 * i + 1], values + row,
                        d_du + row, d_dv + row);
    else
      for (double* p : {values, d_du, d_dv}) std::fill_n(p + row, width, missing);
  };
  state_->arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 512), [&](const auto& range) {
      if (progress && progress->cancel) return;
      for (std::size_t i = range.begin(); i < range.end(); ++i) evaluate(i);
    });
  });
  if (progress && progress->cancel) throw Cancelled();
}

std::size_t Scene::geometry_count() const { return state_->instances.size(); }

MeshStatistics Scene::mesh_statistics(std::uint32_t geometry_id) const {
  const Geometry& g = *state_->geometries[state_->instance(geometry_id).geometry];
  MeshStatistics s;
  s.patches = g.patches.size();
  s.gregory_patches = g.patches.bumps.size();
  for (const PatchInfo& info : g.patches.infos) {
    if (info.level >= s.patches_by_level.size()) s.patches_by_level.resize(info.level + 1u);
    ++s.patches_by_level[info.level];
  }
  s.patch_bytes = g.patches.bytes() + g.bvh.order.size() * sizeof(std::uint32_t);
  s.bvh_bytes = g.bvh.bytes();
  s.build_seconds = g.build_seconds;
  s.isolation_level = g.options.isolation_level;
  s.limit_error = g.limit_error();
  return s;
}

std::size_t Scene::mesh_count() const { return state_->geometries.size(); }

MeshData Scene::mesh_data(std::size_t mesh) const {
  const Geometry& g = *state_->geometries.at(mesh);
  const Extent extent = view_of(g, g.patches).extent;
  return {g.patches.nets,
          g.patches.bumps,
          g.patches.infos,
          g.patches.models,
          g.bvh.order,
          g.bvh.nodes.empty() ? nullptr : g.bvh.nodes.data(),
          g.bvh.nodes.size(),
          extent.center,
          extent.half,
          extent.radius,
          g.cage.orientation == Orientation::left_handed};
}

InstanceData Scene::instance_data(std::uint32_t geometry_id) const {
  const InstanceView& in = state_->instance(geometry_id);
  return {in.geometry, in.identity, in.to_object, in.to_world};
}

TopData Scene::top_data() const {
  state_->update_top();
  const Bvh& top = state_->top;
  const Extent extent = extent_of(top.bounds, state_->origin, state_->radius);
  return {top.nodes.empty() ? nullptr : top.nodes.data(), top.nodes.size(), extent.center,
          extent.half, extent.radius};
}

std::array<Vec3d, 2> Scene::bounds() const { return state_->bounds(); }

Statistics Scene::statistics() const {
  const std::lock_guard lock(state_->statistics_mutex);
  return state_->statistics;
}
void Scene::reset_statistics() {
  const std::lock_guard lock(state_->statistics_mutex);
  state_->statistics = Statistics{};
}
std::string Scene::isa() { return kernels().name; }
void Scene::set_newton(bool on) { state_->use_newton = on; }

}  // namespace limitray

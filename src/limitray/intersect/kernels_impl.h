// Stage: intersection. From a batch of rays to hits: scene, instances, BVH, patches. Included by
// the kernels_<isa>.cpp files alone, which compile it once for each instruction set.
#pragma once

#include "limitray/bvh/bounds.h"
#include "limitray/intersect/hit_attributes.h"
#include "limitray/intersect/kernels.h"
#include "limitray/patches/patch_model.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

template <class T>
ObjectRay load_ray(const RayBatch<T>& b, std::size_t i) {
  const T* r = b.rays.data() + 6 * i;
  return {{double(r[0]), double(r[1]), double(r[2])},
          {double(r[3]), double(r[4]), double(r[5])},
          double(b.tnear[b.tnear.size() == 1 ? 0 : i]),
          double(b.tfar[b.tfar.size() == 1 ? 0 : i])};
}

template <class T>
const PatchBump<T>* bump_of(const GeometryView<T>& g, std::uint32_t leaf) {
  const std::uint32_t b = g.infos[leaf].bump;
  return b == no_bump ? nullptr : g.bumps + b;
}

/// Where a ray met a patch.
template <class T>
struct LeafHit {
  double t = std::numeric_limits<double>::infinity();
  std::uint32_t instance = invalid_id, leaf = invalid_id;
  T s = 0, t_patch = 0;
  double spread = 0;  // PatchRoot's, in units of t

  /// Hits whose stretches of t touch are one: the nearer one stands for both.
  void merge(const LeafHit& h) {
    const double lo = std::min(t - spread, h.t - h.spread);
    const double hi = std::max(t + spread, h.t + h.spread);
    const bool touch = hi - lo <= 2 * (spread + h.spread);
    if (h.t < t) *this = h;
    if (touch) spread = std::max(hi - t, t - lo);
  }
};

/// Meets `ray` (in the mesh's space) with one mesh. on_hit(LeafHit, ray) returns true to end; it
/// may lower `tfar`.
template <class T, bool use_newton, class OnHit>
bool trace_geometry(const GeometryView<T>& g, std::uint32_t instance, const ObjectRay& ray,
                    double& tfar, OnHit&& on_hit, PatchCounters& count, Statistics& stats) {
  PatchRay<T> r;
  ObjectRay clipped = ray;
  clipped.tfar = tfar;
  if (!g.nodes || !make_patch_ray(clipped, g.extent, r)) return false;
  T zmax = r.zmax;
  bool ended = false;
  const auto leaf = [&](std::uint32_t k) {
    intersect_patch<T, use_newton>(
        g.nets[k], bump_of(g, k), g.models[k], r, zmax,
        [&](const PatchRoot<T>& root, T& z) {
          const double t = double(T(r.t_of(root.z)));  // as it will be reported
          if (!(t > ray.tnear && t <= tfar)) return false;
          ended = on_hit(
              LeafHit<T>{t, instance, k, root.u, root.v, double(root.spread) * r.t_scale}, r);
          z = std::min(z, r.z_above(tfar));  // on_hit keeps only what is nearer from now on
          return ended;
        },
        count);
    return ended;
  };
  // A leaf's model, or a node: the same address arithmetic serves as a guess for both.
  const auto prefetch = [&](std::uint32_t child) {
    const void* next = child & leaf_flag ? static_cast<const void*>(&g.models[child & ~leaf_flag])
                                         : static_cast<const void*>(&g.nodes[child]);
    __builtin_prefetch(next);
  };
  traverse(
      g.nodes, make_box_ray(r), -float_up(-r.zmin), [&] { return float_up(zmax); }, prefetch, leaf,
      stats.node_visits);
  return ended;
}

/// Meets ray i of a batch with everything in the scene. on_hit as above.
template <class T, bool use_newton, class OnHit>
void trace_scene(const SceneView<T>& scene, const ObjectRay& ray, double& tfar, OnHit&& on_hit,
                 PatchCounters& count, Statistics& stats) {
  const auto instance = [&](std::uint32_t i) {
    const InstanceView& in = scene.instances[i];
    const GeometryView<T>& g = scene.geometries[in.geometry];
    if (in.identity) return trace_geometry<T, use_newton>(g, i, ray, tfar, on_hit, count, stats);
    const ObjectRay local{in.to_object.point(ray.org), in.to_object.vector(ray.dir), ray.tnear,
                          ray.tfar};
    return trace_geometry<T, use_newton>(g, i, local, tfar, on_hit, count, stats);
  };
  if (scene.instances.size() == 1) {
    instance(0);
    return;
  }
  PatchRay<T> r;
  if (!scene.nodes || !make_patch_ray(ray, scene.extent, r)) return;
  traverse(
      scene.nodes, make_box_ray(r), -float_up(-r.zmin), [&] { return float_up(r.z_above(tfar)); },
      [](std::uint32_t) {}, instance, stats.node_visits);
}

/// The same with the switch for S8 read at run time.
template <class T, class OnHit>
void trace(const SceneView<T>& scene, const ObjectRay& ray, double& tfar, OnHit&& on_hit,
           PatchCounters& count, Statistics& stats) {
  if (scene.use_newton)
    trace_scene<T, true>(scene, ray, tfar, on_hit, count, stats);
  else
    trace_scene<T, false>(scene, ray, tfar, on_hit, count, stats);
}

template <class T>
void store3(T* out, std::size_t i, const Vec3d& v) {
  if (!out) return;
  out[3 * i] = T(v.x), out[3 * i + 1] = T(v.y), out[3 * i + 2] = T(v.z);
}

template <class T>
void write_miss(const HitArrays<T>& h, std::size_t i) {
  if (h.t) h.t[i] = std::numeric_limits<T>::infinity();
  if (h.t_error) h.t_error[i] = 0;
  for (std::uint32_t* ids : {h.geometry_id, h.primitive_id, h.sub_quad, h.patch_id})
    if (ids) ids[i] = invalid_id;
  if (h.uv) h.uv[2 * i] = h.uv[2 * i + 1] = 0;
  for (T* v : {h.normal, h.point, h.dp_du, h.dp_dv}) store3(v, i, Vec3d{});
}

/// Transposed inverse map: normals stay perpendicular to the surface and on its outer side.
inline Vec3d normal_to_world(const InstanceView& in, const Vec3d& n) {
  if (in.identity) return n;
  const auto& m = in.to_object.linear;
  const Vec3d w = n.x * m[0] + n.y * m[1] + n.z * m[2];
  const double l = length(w);
  return l > 0 ? (1 / l) * w : w;
}

/// Everything about a hit that is asked for.
template <class T>
void write_hit(const SceneView<T>& scene, const LeafHit<T>& hit, const ObjectRay& ray,
               const HitArrays<T>& h, std::size_t i) {
  const InstanceView& in = scene.instances[hit.instance];
  const GeometryView<T>& g = scene.geometries[in.geometry];
  const PatchInfo& info = g.infos[hit.leaf];
  if (h.t) h.t[i] = T(hit.t);
  if (h.geometry_id) h.geometry_id[i] = hit.instance;
  if (h.primitive_id) h.primitive_id[i] = info.face;
  if (h.sub_quad) h.sub_quad[i] = info.sub_quad;
  if (h.patch_id) h.patch_id[i] = g.patch_ids[hit.leaf];
  if (h.uv) {
    h.uv[2 * i] = T(info.u0) + hit.s * T(info.du);
    h.uv[2 * i + 1] = T(info.v0) + hit.t_patch * T(info.dv);
  }
  const PatchNet<T>& net = g.nets[hit.leaf];
  const PatchBump<T>* bump = bump_of(g, hit.leaf);
  if (h.normal || h.point || h.dp_du || h.dp_dv) {
    const SurfacePoint<T> p = evaluate_patch(net, bump, hit.s, hit.t_patch);
    const auto world = [&](const Vec3d& v) { return in.identity ? v : in.to_world.vector(v); };
    const Vec3d point = Vec3d(p.p) + g.extent.center;
    store3(h.point, i, in.identity ? point : in.to_world.point(point));
    store3(h.dp_du, i, world((1 / double(info.du)) * Vec3d(p.p_s)));
    store3(h.dp_dv, i, world((1 / double(info.dv)) * Vec3d(p.p_t)));
    if (h.normal) {
      const Vec3d n(unit_normal(net, bump, hit.s, hit.t_patch, p));
      store3(h.normal, i, normal_to_world(in, g.left_handed ? -1.0 * n : n));
    }
  }
  if (h.t_error) {
    PatchRay<T> r{};
    ObjectRay local = ray;
    if (!in.identity)
      local.org = in.to_object.point(ray.org), local.dir = in.to_object.vector(ray.dir);
    make_patch_ray(local, g.extent, r);
    // The last step: t itself is rounded to T.
    const double e =
        t_rounding(g.models[hit.leaf], r) + hit.spread + double(unit_roundoff<T>) * std::abs(hit.t);
    h.t_error[i] = std::nextafter(T(e), std::numeric_limits<T>::infinity());
  }
}

inline void add_counts(Statistics& s, const PatchCounters& c, std::size_t rays) {
  s.rays += rays;
  s.patch_tests += c.patch_tests;
  s.early_outs += c.early_outs;
  s.splits += c.splits;
  s.backtracks += c.backtracks;
  s.newton_runs += c.newton_runs;
  s.newton_steps += c.newton_steps;
  s.unresolved += c.unresolved;
}

template <class T>
void closest(const SceneView<T>& scene, const RayBatch<T>& rays, std::size_t begin, std::size_t end,
             const HitArrays<T>& hits, Statistics& stats) {
  PatchCounters count;
  for (std::size_t i = begin; i < end; ++i) {
    const ObjectRay ray = load_ray(rays, i);
    count.before_ray = count.splits;
    double tfar = ray.tfar;
    LeafHit<T> best;
    trace(
        scene, ray, tfar,
        [&](const LeafHit<T>& h, const PatchRay<T>&) {
          best.merge(h);
          tfar = std::min(ray.tfar, best.t + best.spread);
          return false;
        },
        count, stats);
    if (best.leaf == invalid_id)
      write_miss(hits, i);
    else
      write_hit(scene, best, ray, hits, i);
  }
  add_counts(stats, count, end - begin);
}

template <class T>
void occluded(const SceneView<T>& scene, const RayBatch<T>& rays, std::size_t begin,
              std::size_t end, std::uint8_t* out, Statistics& stats) {
  PatchCounters count;
  for (std::size_t i = begin; i < end; ++i) {
    const ObjectRay ray = load_ray(rays, i);
    count.before_ray = count.splits;
    double tfar = ray.tfar;
    out[i] = 0;
    trace(
        scene, ray, tfar,
        [&](const LeafHit<T>&, const PatchRay<T>&) {
          out[i] = 1;
          return true;
        },
        count, stats);
  }
  add_counts(stats, count, end - begin);
}

inline void all(const SceneView<double>& scene, const RayBatch<double>& rays, std::size_t i,
                std::vector<Intersection>& out, Statistics& stats) {
  const ObjectRay ray = load_ray(rays, i);
  double tfar = ray.tfar;
  PatchCounters count;
  trace(
      scene, ray, tfar,
      [&](const LeafHit<double>& h, const PatchRay<double>& r) {
        const InstanceView& in = scene.instances[h.instance];
        const GeometryView<double>& g = scene.geometries[in.geometry];
        const PatchInfo& info = g.infos[h.leaf];
        const auto p = evaluate_patch(g.nets[h.leaf], bump_of(g, h.leaf), h.s, h.t_patch);
        Vec3d n = unit_normal(g.nets[h.leaf], bump_of(g, h.leaf), h.s, h.t_patch, p);
        n = normal_to_world(in, g.left_handed ? -1.0 * n : n);
        const double e = t_rounding(g.models[h.leaf], r) + h.spread;
        out.push_back({h.t, e + unit_roundoff<double> * std::abs(h.t), info.u0 + h.s * info.du,
                       info.v0 + h.t_patch * info.dv, n, dot(n, ray.dir) < 0, h.instance, info.face,
                       info.sub_quad});
        return false;
      },
      count, stats);
  add_counts(stats, count, 1);
}

/// Meets a ray with one patch of a mesh; on_hit(root, t, zmax) returns true to end the search.
template <class OnHit>
void trace_patch(const GeometryView<float>& g, std::uint32_t patch, const ObjectRay& ray,
                 OnHit&& on_hit) {
  PatchRay<float> r;
  if (!make_patch_ray(ray, g.extent, r)) return;
  float zmax = r.zmax;
  PatchCounters count;
  intersect_patch<float, true>(
      g.nets[patch], bump_of(g, patch), g.models[patch], r, zmax,
      [&](const PatchRoot<float>& root, float& z) {
        const double t = r.t_of(root.z);
        return t > ray.tnear && t <= ray.tfar && on_hit(root, t, z);
      },
      count);
}

inline bool closest_patch(const GeometryView<float>& g, std::uint32_t patch, const ObjectRay& ray,
                          PatchHit& hit) {
  PatchRoot<float> best;
  hit.t = std::numeric_limits<double>::infinity();
  trace_patch(g, patch, ray, [&](const PatchRoot<float>& root, double t, float& zmax) {
    if (t < hit.t) best = root, hit.t = t, zmax = root.z + root.spread;
    return false;
  });
  if (!(hit.t < std::numeric_limits<double>::infinity())) return false;
  const PatchInfo& info = g.infos[patch];
  hit.u = info.u0 + best.u * info.du;
  hit.v = info.v0 + best.v * info.dv;
  const SurfacePoint<float> p = evaluate_patch(g.nets[patch], bump_of(g, patch), best.u, best.v);
  hit.normal = unit_normal(g.nets[patch], bump_of(g, patch), best.u, best.v, p);
  if (g.left_handed) hit.normal = -1.0f * hit.normal;
  return true;
}

inline bool occluded_patch(const GeometryView<float>& g, std::uint32_t patch,
                           const ObjectRay& ray) {
  bool hit = false;
  trace_patch(g, patch, ray, [&](const PatchRoot<float>&, double, float&) { return hit = true; });
  return hit;
}

/// The table of this instruction set.
inline Kernels make_kernels(const char* name) {
  return {name,
          patch_bounds,
          make_patch_model<float>,
          make_patch_model<double>,
          closest<float>,
          closest<double>,
          occluded<float>,
          occluded<double>,
          all,
          closest_patch,
          occluded_patch};
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray

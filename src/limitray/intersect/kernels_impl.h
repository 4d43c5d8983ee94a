// Stage: intersection. From a batch of rays to hits: scene, instances, BVH, patches. Included by
// the kernels_<isa>.cpp files alone, which compile it once for each instruction set.
#pragma once

#include "limitray/bvh/bounds.h"
#include "limitray/intersect/hit_attributes.h"
#include "limitray/intersect/kernels.h"
#include "limitray/intersect/stream.h"
#include "limitray/patches/patch_model.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

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

/// Meets a ray with everything in the scene, one patch after the other. on_hit(LeafHit) as in
/// RayQuery::report.
template <bool use_newton, class T, class OnHit>
void trace_walk(const SceneView<T>& scene, SceneWalk<T>& walk, OnHit&& on_hit, PatchCounters& count,
                Statistics& stats) {
  count.before_ray = count.splits;
  while (walk.next_patch(scene, stats.node_visits))
    if (walk.template meet_patch<use_newton>(on_hit, count)) return;
}
/// The same from a ray of the scene on.
template <class T, class OnHit>
void trace_ray(const SceneView<T>& scene, const ObjectRay& ray, SceneWalk<T>& walk, OnHit&& on_hit,
               PatchCounters& count, Statistics& stats) {
  if (!walk.begin(scene, ray)) return;
  if (scene.use_newton)
    trace_walk<true>(scene, walk, on_hit, count, stats);
  else
    trace_walk<false>(scene, walk, on_hit, count, stats);
}

/// Traces some rays of a batch: float rays side by side, others one by one. on_hit(RayQuery,
/// LeafHit) as in RayQuery::report; on_end(i, RayQuery::best) is called once for each ray.
template <class T, class OnHit, class OnEnd>
void trace(const SceneView<T>& scene, const RayBatch<T>& rays, RayRange range, OnHit&& on_hit,
           OnEnd&& on_end, Statistics& stats) {
  PatchCounters count;
  if constexpr (std::is_same_v<T, float>) {
    if (scene.use_newton) {
      RayStream(scene, rays, range, on_hit, on_end, count, stats.node_visits).trace();
      return add_counts(stats, count, range.size());
    }
  }
  SceneWalk<T> walk;
  const auto hit = [&](const LeafHit<T>& h) { return on_hit(walk.query, h); };
  for (std::size_t i = range.begin; i < range.end; ++i) {
    trace_ray(scene, load_ray(rays, i), walk, hit, count, stats);
    on_end(i, walk.query.best);
  }
  add_counts(stats, count, range.size());
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
void write_hit(const SceneView<T>& scene, const LeafHit<T>& hit, const RayBatch<T>& rays,
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
    const ObjectRay ray = load_ray(rays, i);
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

template <class T>
void closest(const SceneView<T>& scene, const RayBatch<T>& rays, RayRange range,
             const HitArrays<T>& hits, Statistics& stats) {
  trace<T>(
      scene, rays, range,
      [](RayQuery<T>& q, const LeafHit<T>& h) {
        q.best.merge(h);
        q.reach = std::min(q.tfar, q.best.t + q.best.spread);
        return false;
      },
      [&](std::size_t i, const LeafHit<T>& best) {
        if (best.leaf == invalid_id)
          write_miss(hits, i);
        else
          write_hit(scene, best, rays, hits, i);
      },
      stats);
}

template <class T>
void occluded(const SceneView<T>& scene, const RayBatch<T>& rays, RayRange range, std::uint8_t* out,
              Statistics& stats) {
  trace<T>(
      scene, rays, range,
      [](RayQuery<T>& q, const LeafHit<T>& h) {
        q.best = h;
        return true;
      },
      [&](std::size_t i, const LeafHit<T>& best) { out[i] = best.leaf != invalid_id; }, stats);
}

inline void all(const SceneView<double>& scene, const RayBatch<double>& rays, std::size_t i,
                std::vector<Intersection>& out, Statistics& stats) {
  SceneWalk<double> walk;
  const auto add = [&](const LeafHit<double>& h) {
    const InstanceView& in = scene.instances[h.instance];
    const GeometryView<double>& g = walk.geometry();
    const PatchInfo& info = g.infos[h.leaf];
    const auto p = evaluate_patch(g.nets[h.leaf], bump_of(g, h.leaf), h.s, h.t_patch);
    Vec3d n = unit_normal(g.nets[h.leaf], bump_of(g, h.leaf), h.s, h.t_patch, p);
    n = normal_to_world(in, g.left_handed ? -1.0 * n : n);
    const double e = t_rounding(g.models[h.leaf], walk.frame) + h.spread;
    out.push_back({h.t, e + unit_roundoff<double> * std::abs(h.t), info.u0 + h.s * info.du,
                   info.v0 + h.t_patch * info.dv, n, dot(n, walk.ray.dir) < 0, h.instance,
                   info.face, info.sub_quad});
    return false;
  };
  PatchCounters count;
  trace_ray(scene, load_ray(rays, i), walk, add, count, stats);
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
          write_patches,
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

// Stage: intersection. Comes in: a ray and a scene. Goes out: the patches whose boxes the ray
// meets, nearer ones first, instance by instance, and the ray in the frame of each.
#pragma once

#include "limitray/intersect/intersect_patch.h"
#include "limitray/intersect/kernels.h"

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

/// What a ray looks for, and what it has found.
template <class T>
struct RayQuery {
  double tnear, tfar;    // as given
  double reach;          // the far end as it stands; on_hit lowers it
  LeafHit<T> best;       // for callers that keep one
  std::uint32_t splits;  // done for it so far

  void begin(double from, double to) { tnear = from, tfar = reach = to, best = {}, splits = 0; }

  /// A point where the ray meets patch `leaf` of an instance, in whose frame it is:
  /// on_hit(LeafHit), if it is between tnear and reach, returns true to end the search and may
  /// lower `reach`. `zmax` is reach in that frame.
  template <class OnHit>
  bool report(const RayDepth<T>& frame, T& zmax, std::uint32_t instance, std::uint32_t leaf,
              const PatchRoot<T>& root, OnHit&& on_hit) {
    const double t = double(T(frame.t_of(root.z)));  // as it will be reported
    // A direction so short that t is beyond T's range meets nothing that could be told.
    if (!(t > tnear && t <= reach && std::isfinite(t))) return false;
    const bool ended =
        on_hit(LeafHit<T>{t, instance, leaf, root.u, root.v, double(root.spread) * frame.t_scale});
    zmax = std::min(zmax, frame.z_above(reach));  // only what is nearer from now on
    return ended;
  }
};

/// A ray of the scene in the space of an instance's mesh.
inline ObjectRay local_ray(const InstanceView& in, const ObjectRay& r) {
  if (in.identity) return r;
  return {in.to_object.point(r.org), in.to_object.vector(r.dir), r.tnear, r.tfar};
}

/// One ray on its way through a scene.
template <class T>
class SceneWalk {
 public:
  ObjectRay ray;  // in the scene
  RayQuery<T> query;
  PatchRay<T> frame;   // the ray in the instance that it is in
  T zmax;              // query.reach in that frame
  std::uint32_t leaf;  // the patch found last

  /// False if the ray meets nothing of the scene. A scene of one instance is walked in its space;
  /// another one has a tree over its instances.
  bool begin(const SceneView<T>& scene, const ObjectRay& r) {
    ray = r;
    query.begin(r.tnear, r.tfar);
    has_tree_ = scene.instances.size() != 1;
    if (!has_tree_) {
      const InstanceView& in = scene.instances[0];
      const GeometryView<T>& g = scene.geometries[in.geometry];
      if (!g.nodes || !make_patch_ray(local_ray(in, r), g.extent, frame)) return false;
      enter(scene, 0);
      return true;
    }
    if (!scene.nodes || !make_patch_ray(r, scene.extent, world_)) return false;
    frame = world_;
    zmax = frame.zmax;
    below_.end();
    geometry_ = scene.geometries.data();  // any
    world_boxes_ = boxes_ = make_box_ray(world_);
    above_.begin();
    return true;
  }
  /// Sets `leaf` to the next patch that the ray may meet; false if there is none.
  bool next_patch(const SceneView<T>& scene, std::uint64_t& node_visits) {
    // A leaf's model, or a node: the same address arithmetic serves as a guess for both.
    const auto prefetch = [&](std::uint32_t child) {
      __builtin_prefetch(child & leaf_flag
                             ? static_cast<const void*>(&geometry_->models[child & ~leaf_flag])
                             : static_cast<const void*>(&geometry_->nodes[child]));
    };
    while (true) {
      leaf = next_item(geometry_->nodes, boxes_, float_up(zmax), below_, prefetch, node_visits);
      if (leaf != no_item) return true;
      if (!next_instance(scene, node_visits)) return false;
    }
  }
  /// Meets the ray with `leaf` alone; on_hit as above. True if the walk ends.
  template <bool use_newton, class OnHit>
  bool meet_patch(OnHit&& on_hit, PatchCounters& count) {
    bool ended = false;
    intersect_patch<T, use_newton>(
        geometry_->nets[leaf], bump_of(*geometry_, leaf), geometry_->models[leaf], frame, zmax,
        [&](const PatchRoot<T>& root, T&) {
          return ended = query.report(frame, zmax, instance_, leaf, root, on_hit);
        },
        count);
    return ended;
  }
  const GeometryView<T>& geometry() const { return *geometry_; }

 private:
  /// Enters the next instance that the ray may meet; false if there is none.
  bool next_instance(const SceneView<T>& scene, std::uint64_t& node_visits) {
    while (has_tree_) {
      const std::uint32_t next = next_item(
          scene.nodes, world_boxes_, float_up(world_.z_above(query.reach)), above_,
          [](std::uint32_t) {}, node_visits);
      if (next == no_item) return false;
      const InstanceView& in = scene.instances[next];
      const GeometryView<T>& g = scene.geometries[in.geometry];
      ObjectRay local = local_ray(in, ray);
      local.tfar = query.reach;
      if (!g.nodes || !make_patch_ray(local, g.extent, frame)) continue;
      enter(scene, next);
      return true;
    }
    return false;
  }
  /// Goes on in instance i; `frame` is set.
  void enter(const SceneView<T>& scene, std::uint32_t i) {
    instance_ = i, geometry_ = &scene.geometries[scene.instances[i].geometry];
    zmax = frame.zmax;
    boxes_ = make_box_ray(frame);
    below_.begin();
  }

  const GeometryView<T>* geometry_;  // of the instance that the ray is in
  std::uint32_t instance_;
  bool has_tree_;  // a scene of one instance has none
  PatchRay<T> world_;
  BoxRay boxes_, world_boxes_;
  BvhWalk below_, above_;
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection. Comes in: a batch of rays. Goes out: their hits. Thousands of rays are on
// their way at once: they walk the tree together (bvh/list_walk.h), and as many as a register has
// lanes meet their patches side by side (S8, lane by lane).
//
// One ray alone waits: for the next node, for the next Newton step, for the branch that hangs on
// it. What a ray meets, and in which order, does not depend on the other rays, nor does the
// arithmetic in its lane: hits are the same for any order of rays and number of threads.
//
//   rays -> sorted by direction -> walk -> to_test: models -> to_solve: Newton -> hits
//                                            |  neither proved nor disproved
//                                            +-> undecided: quarters, bisection -> hits
#pragma once

#include <memory>
#include <vector>

#include "limitray/intersect/lane_newton.h"
#include "limitray/intersect/ray_space.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// What a stream works in; each thread keeps one.
struct StreamRoom {
  RayQuery<float> queries[max_rays_a_call];
  RaySpace world, object;
  std::unique_ptr<RayId[]> world_lists =
      std::make_unique_for_overwrite<RayId[]>(list_room(max_rays_a_call));
  std::unique_ptr<RayId[]> object_lists =
      std::make_unique_for_overwrite<RayId[]>(list_room(max_rays_a_call));
  RayId all[max_rays_a_call];
  RayId in_world[max_rays_a_call];  // a ray's place in `world`
  std::vector<Meeting> undecided, to_split;
  Meeting to_test[max_rays_a_call + lane_count], to_solve[2 * lane_count];
  int tests = 0, solves = 0;

  static StreamRoom& of_this_thread() {
    thread_local const std::unique_ptr<StreamRoom> room(new StreamRoom);
    return *room;
  }
};

/// Traces some rays of a batch, at most max_rays_a_call. on_hit(RayQuery, LeafHit) as in
/// RayQuery::report; on_end(i, RayQuery::best) is called once for each ray.
template <class OnHit, class OnEnd>
class RayStream {
 public:
  RayStream(const SceneView<float>& scene, const RayBatch<float>& batch, RayRange range,
            OnHit on_hit, OnEnd on_end, PatchCounters& counts, std::uint64_t& node_visits)
      : scene_(scene),
        batch_(batch),
        range_(range),
        on_hit_(on_hit),
        on_end_(on_end),
        counts_(counts),
        node_visits_(node_visits) {}

  void trace() {
    const int count = int(range_.size());
    for (int i = 0; i < count; ++i) {
      const std::size_t k = number_of(RayId(i));
      room_.queries[i].begin(batch_.tnear[batch_.tnear.size() == 1 ? 0 : k],
                             batch_.tfar[batch_.tfar.size() == 1 ? 0 : k]);
      room_.all[i] = RayId(i);
    }
    room_.object.count = 0;
    if (scene_.instances.size() == 1)
      trace_instance(0, room_.all, count);
    else if (scene_.nodes)
      trace_instances(count);
    finish();
    for (int i = 0; i < count; ++i) on_end_(number_of(RayId(i)), room_.queries[i].best);
  }

 private:
  std::size_t number_of(RayId id) const { return range_.begin + id; }
  const float* ray_of(RayId id) const { return batch_.rays.data() + 6 * number_of(id); }

  /// Walks through the tree of instances.
  void trace_instances(int count) {
    RaySpace& s = room_.world;
    s.count = 0;
    enter(s, scene_.extent, 0, {0, true, {}, {}}, room_.all, count);
    for (int k = 0; k < s.count; ++k) room_.in_world[s.stream_ids[k]] = RayId(k);
    s.sort_by_signs(0);
    has_world_ = true;
    for (unsigned signs = 0; signs < RaySpace::octants; ++signs)
      walk(
          scene_.nodes, s, signs, room_.world_lists.get(), [](std::uint32_t) {},
          [&](std::uint32_t instance, const RayId* list, int n) {
            for (int k = 0; k < n; ++k) room_.all[k] = s.stream_ids[list[k]];
            trace_instance(instance, room_.all, n);
          });
  }

  /// Meets some rays with an instance. What waits then for others to fill a register goes on with
  /// those of the next instance.
  void trace_instance(std::uint32_t i, const RayId* ids, int count) {
    const InstanceView& in = scene_.instances[i];
    const GeometryView<float>& g = scene_.geometries[in.geometry];
    if (!g.nodes) return;
    RaySpace& s = room_.object;
    if (s.count + count > max_rays_a_call) make_room(count);
    const int first = s.count;
    enter(s, g.extent, i, in, ids, count);
    s.sort_by_signs(first);
    const auto prefetch = [&](std::uint32_t child) {
      if (child & leaf_flag) return __builtin_prefetch(&g.models[child & ~leaf_flag]);
      const auto* node = reinterpret_cast<const char*>(&g.nodes[child]);
      for (std::size_t line = 0; line < sizeof(BvhNode); line += 64)
        __builtin_prefetch(node + line);
    };
    for (unsigned signs = 0; signs < RaySpace::octants; ++signs)
      walk(g.nodes, s, signs, room_.object_lists.get(), prefetch,
           [&](std::uint32_t leaf, const RayId* list, int n) {
             for (int k = 0; k < n; ++k)
               room_.to_test[room_.tests++] = {list[k], s.kinds[list[k]], leaf};
             test_models(lane_count);
           });
  }
  /// Frees the places of rays that wait no more in `object`, for `count` others. Who is undecided
  /// keeps his: when that is decided must not depend on other rays, unless they are too many.
  void make_room(int count) {
    test_models(1);
    solve(1);
    RaySpace& s = room_.object;
    RayId* place = s.by_signs;  // nobody needs it between two walks
    std::fill_n(place, s.count, 0);
    const auto for_each_undecided = [&](auto&& f) {
      for (Meeting& m : room_.undecided) f(m);
      for (Meeting& m : room_.to_split) f(m);
    };
    for_each_undecided([&](const Meeting& m) { place[m.ray] = 1; });
    int kept = 0;
    for (int k = 0; k < s.count; ++k)
      if (place[k]) s.move(k, kept), place[k] = RayId(kept++);
    for_each_undecided([&](Meeting& m) { m.ray = place[m.ray] & 0xFFFFFFu; });
    s.count = kept;
    if (s.count + count > max_rays_a_call) finish(), s.count = 0;
  }
  const GeometryView<float>& mesh_of(RayId ray) const {
    return scene_.geometries[scene_.instances[room_.object.instances[ray]].geometry];
  }

  /// Walks those rays of `s` whose directions have these signs through its tree.
  template <class Prefetch, class OnLeaf>
  void walk(const BvhNode* nodes, const RaySpace& s, unsigned signs, RayId* lists,
            Prefetch&& prefetch, OnLeaf&& on_leaf) {
    const int begin = s.signs_begin[signs], n = s.signs_begin[signs + 1] - begin;
    if (n == 0) return;
    float along[3];
    for (int i = 0; i < 3; ++i) along[i] = signs >> i & 1 ? -1.0f : 1.0f;
    walk_lists(nodes, s.boxes, signs, along, s.by_signs + begin, n, lists, on_leaf, prefetch,
               node_visits_);
  }

  /// S1 for `count` rays, in the space of an instance or, for an identity, of the scene.
  void enter(RaySpace& s, const Extent& extent, std::uint32_t instance, const InstanceView& in,
             const RayId* ids, int count) {
    for (int k = 0; k < count; k += lane_count) {
      const int here = std::min(lane_count, count - k);
      const float* rows[lane_count];
      alignas(Lanes) double tnear[lane_count], tfar[lane_count];
      for (int j = 0; j < lane_count; ++j) {
        const RayId id = ids[k + std::min(j, here - 1)];
        rows[j] = ray_of(id);
        tnear[j] = room_.queries[id].tnear, tfar[j] = room_.queries[id].reach;
      }
      Lanes m[8];
      load_by_lane(rows, m);
      const auto frame = [&](bool high) {
        HalfLanes org[3], dir[3], from, to;
        for (int i = 0; i < 3; ++i) org[i] = half_of(m[i], high), dir[i] = half_of(m[3 + i], high);
        std::memcpy(&from, tnear + high * lane_count / 2, sizeof(from));
        std::memcpy(&to, tfar + high * lane_count / 2, sizeof(to));
        if (!in.identity) to_object(in, org, dir);
        return RayFrame<HalfLanes, float>(org, dir, from, to, extent);
      };
      s.add(LaneFrameMaker(frame(false), frame(true)), ids + k, here, instance);
    }
  }
  static void to_object(const InstanceView& in, HalfLanes (&org)[3], HalfLanes (&dir)[3]) {
    const auto times = [&](const HalfLanes(&v)[3], int i) {
      const Vec3d& row = in.to_object.linear[i];
      return row.x * v[0] + row.y * v[1] + row.z * v[2];
    };
    const HalfLanes o[3] = {times(org, 0), times(org, 1), times(org, 2)};
    const HalfLanes d[3] = {times(dir, 0), times(dir, 1), times(dir, 2)};
    for (int i = 0; i < 3; ++i) org[i] = o[i] + in.to_object.offset[i], dir[i] = d[i];
  }

  LanePatches lanes_of(const Meeting* m, int count) const {
    if (!has_world_) return {room_.object.rays, m, count, [this](RayId) { return &mesh_of(0); }};
    return {room_.object.rays, m, count, [this](RayId ray) { return &mesh_of(ray); }};
  }

  /// Tests the waiting meetings by the models while there are `enough`.
  void test_models(int enough) {
    int done = 0;
    while (room_.tests - done >= enough) {
      const Meeting* m = room_.to_test + done;
      const int n = std::min(lane_count, room_.tests - done);
      done += n;
      counts_.patch_tests += std::uint32_t(n);
      const LanePatches lanes = lanes_of(m, n);
      const LaneVerdict v = limitray::test_models(lanes);
      for (unsigned left = lanes.waiting & ~v.missed; left; left &= left - 1) {
        const int j = std::countr_zero(left);
        if (v.decided >> j & 1) {
          prefetch_patch(*lanes.mesh[j], m[j].leaf);
          room_.to_solve[room_.solves++] = m[j];
        } else {
          room_.undecided.push_back(m[j]);
        }
      }
      solve(lane_count);
    }
    if (done == 0) return;
    std::copy(room_.to_test + done, room_.to_test + room_.tests, room_.to_test);
    room_.tests -= done;
  }
  static void prefetch_patch(const GeometryView<float>& g, std::uint32_t leaf) {
    const auto* net = reinterpret_cast<const char*>(&g.nets[leaf]);
    __builtin_prefetch(&g.infos[leaf]);
    for (std::size_t line = 0; line < sizeof(PatchNet<float>); line += 64)
      __builtin_prefetch(net + line);
  }

  /// Newton steps for those that wait for them, if there are `enough`.
  void solve(int enough) {
    if (room_.solves < enough) return;
    const int n = std::min(lane_count, room_.solves);
    solve(room_.to_solve, n);
    std::copy(room_.to_solve + n, room_.to_solve + room_.solves, room_.to_solve);
    room_.solves -= n;
  }
  void solve(const Meeting* m, int n) {
    const LanePatches lanes = lanes_of(m, n);
    const LaneOutcome o = LaneSolver(lanes).solve(counts_);
    for (unsigned left = lanes.waiting & ~o.missed; left; left &= left - 1) {
      const int j = std::countr_zero(left);
      if (o.met >> j & 1)
        report(m[j], o.root(j));
      else
        room_.to_split.push_back(m[j]);
    }
  }

  /// What still waits, and what the models leave undecided: by the nets, then in quarters, then by
  /// bisection.
  void finish() {
    test_models(1);
    solve(1);
    for_each_register(room_.undecided, [&](const Meeting* m, int n) { solve(m, n); });
    for_each_register(room_.to_split, [&](const Meeting* m, int n) { split(m, n); });
  }
  template <class F>
  void for_each_register(std::vector<Meeting>& list, F&& f) {
    const int count = int(list.size());
    for (int k = 0; k < count; k += lane_count) f(list.data() + k, std::min(lane_count, count - k));
    list.clear();
  }
  void split(const Meeting* m, int n) {
    const LanePatches lanes = lanes_of(m, n);
    const LaneSolver solver(lanes);
    LaneOutcome quarters[4];
    unsigned decided = lanes.waiting;
    for (int q = 0; q < 4 && decided; ++q) {
      quarters[q] = solver.solve_quarter(q, decided, counts_);
      decided &= quarters[q].met | quarters[q].missed;
    }
    counts_.splits += 3 * std::uint32_t(n);
    for (int j = 0; j < n; ++j) {
      if (!(decided >> j & 1)) {
        bisect(m[j]);
        continue;
      }
      for (const LaneOutcome& q : quarters)
        if (q.met >> j & 1) report(m[j], q.root(j));
    }
  }

  /// Updates how far a ray still looks. True if it has ended.
  bool report(const Meeting& m, const PatchRoot<float>& root) {
    return report(m, room_.object.depths[m.ray], root);
  }
  bool report(const Meeting& m, const RayDepth<float>& depth, const PatchRoot<float>& root) {
    float& zmax = room_.object.rays[m.ray].zmax;
    const RayId id = room_.object.stream_ids[m.ray];
    RayQuery<float>& q = room_.queries[id];
    const bool ended = q.report(depth, zmax, room_.object.instances[m.ray], m.leaf, root,
                                [&](const LeafHit<float>& h) { return on_hit_(q, h); });
    if (ended) zmax = -std::numeric_limits<float>::infinity(), q.reach = zmax;
    room_.object.boxes[m.ray].zmax = zmax;
    if (has_world_) {
      const RayId place = room_.in_world[id];
      float& world_zmax = room_.world.boxes[place].zmax;
      world_zmax = ended ? zmax : std::min(world_zmax, room_.world.depths[place].z_above(q.reach));
    }
    return ended;
  }

  /// Splits are limited a ray.
  void bisect(const Meeting& m) {
    const RayId id = room_.object.stream_ids[m.ray];
    RayQuery<float>& q = room_.queries[id];
    PatchRay<float> frame;
    const InstanceView& in = scene_.instances[room_.object.instances[m.ray]];
    const GeometryView<float>& g = scene_.geometries[in.geometry];
    ObjectRay ray = local_ray(in, load_ray(batch_, number_of(id)));
    ray.tfar = q.reach;
    if (!make_patch_ray(ray, g.extent, frame)) return;
    counts_.before_ray = counts_.splits - q.splits;
    bisect_patch<float, true>(
        g.nets[m.leaf], bump_of(g, m.leaf), project(g.models[m.leaf], frame), frame, frame.zmax,
        [&](const PatchRoot<float>& root, float& zmax) {
          const bool ended = report(m, frame, root);
          zmax = std::min(zmax, frame.z_above(q.reach));
          return ended;
        },
        counts_);
    q.splits = counts_.splits - counts_.before_ray;
  }

  const SceneView<float>& scene_;
  const RayBatch<float>& batch_;
  const RayRange range_;
  OnHit on_hit_;
  OnEnd on_end_;
  PatchCounters& counts_;
  std::uint64_t& node_visits_;
  StreamRoom& room_ = StreamRoom::of_this_thread();
  bool has_world_ = false;  // the scene has several instances
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

// Stage: intersection. Comes in: a batch of rays. Goes out: their hits. As many rays as a register
// has lanes are on their way at once; each walks until it meets a patch's box, then all are met
// with their patches together (S8, lane by lane). A ray that has ended makes room for the next.
//
// One ray alone waits: for the next node, for the next Newton step, for the branch that hangs on
// it. Rays side by side share the arithmetic, and what they read was asked for a round earlier. No
// ray's arithmetic depends on its neighbours, so hits are the same for any order of rays.
//
// What S8 leaves undecided is met one by one.
#pragma once

#include "limitray/intersect/lane_newton.h"
#include "limitray/intersect/scene_walk.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Traces rays begin..end; load(i) is ray i. on_hit(walk, LeafHit) as in SceneWalk::report;
/// on_end(i, ray, SceneWalk::best) is called once for each ray.
template <class Load, class OnHit, class OnEnd>
class RayStream {
 public:
  RayStream(const SceneView<float>& scene, Load load, OnHit on_hit, OnEnd on_end,
            PatchCounters& counts, std::uint64_t& node_visits)
      : scene_(scene),
        load_(load),
        on_hit_(on_hit),
        on_end_(on_end),
        counts_(counts),
        node_visits_(node_visits) {}

  void trace(std::size_t begin, std::size_t end) {
    next_ = begin, end_ = end;
    ready_begin_ = ready_end_ = 0;
    for (Lane& lane : lanes_) lane.has_ray = false;
    if (!extent_) {
      for (; next_ < end_; ++next_) on_end_(next_, load_(next_), {});
      return;
    }
    while (true) {
      unsigned waiting = 0;
      for (int j = 0; j < lane_count; ++j) waiting |= unsigned(advance(j)) << j;
      if (!waiting) return;
      meet_patches(waiting);
    }
  }

 private:
  struct Lane {
    SceneWalk<float> walk;
    std::size_t index;
    std::uint32_t splits;  // of this ray
    bool has_ray;
  };

  /// A ray that meets the extent where its walk begins.
  struct Ready {
    std::size_t index;
    PatchRay<float> frame;
  };

  /// Frames of the next rays (S1), a register of doubles at a time; ends those that miss.
  void prepare() {
    ready_begin_ = ready_end_ = 0;
    constexpr int n = lane_count / 2;
    for (int half = 0; half < 2 && next_ < end_; ++half) {
      const int rays = int(std::min<std::size_t>(n, end_ - next_));
      alignas(64) double values[8][n];  // org, dir, tnear, tfar
      if (rays < n) std::memset(values, 0, sizeof(values));
      for (int j = 0; j < rays; ++j) {
        const ObjectRay r = SceneWalk<float>::first_ray(scene_, load_(next_ + std::size_t(j)));
        for (int i = 0; i < 3; ++i) values[i][j] = r.org[i], values[3 + i][j] = r.dir[i];
        values[6][j] = r.tnear, values[7][j] = r.tfar;
      }
      HalfLanes v[8];
      std::memcpy(v, values, sizeof(v));
      const RayFrame<HalfLanes, float> f({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, v[6], v[7],
                                         *extent_);
      const unsigned all = (1u << rays) - 1, meets = bits_of(f.meets) & all;
      for (unsigned left = all & ~meets; left; left &= left - 1) {
        const auto i = next_ + std::size_t(std::countr_zero(left));
        on_end_(i, load_(i), {});
      }
      for (unsigned left = meets; left; left &= left - 1) {
        const int j = std::countr_zero(left);
        Ready& r = ready_[ready_end_++];
        r.index = next_ + std::size_t(j);
        f.store(j, r.frame);
      }
      next_ += std::size_t(rays);
    }
  }

  /// Walks on until lane j's ray, or the next one, waits at a patch; false if no ray is left.
  bool advance(int j) {
    Lane& lane = lanes_[j];
    while (true) {
      if (!lane.has_ray) {
        while (ready_begin_ == ready_end_) {
          if (next_ == end_) return false;
          prepare();
        }
        const Ready& r = ready_[ready_begin_++];
        lane.index = r.index;
        lane.splits = 0;
        lane.has_ray = true;
        lane.walk.begin(scene_, load_(lane.index), r.frame);
      }
      if (lane.walk.next_patch(scene_, node_visits_)) {
        if (std::exchange(lane.walk.has_moved, false)) frames_.set(j, lane.walk.frame);
        lane.walk.prefetch_patch();
        return true;
      }
      finish(lane);
    }
  }

  /// Meets the rays in `waiting` with the patches at which they stand.
  void meet_patches(unsigned waiting) {
    LanePatches patches;
    const int first = std::countr_zero(waiting);
    for (int j = 0; j < lane_count; ++j) {
      // A lane without a ray repeats another one's patch; nobody looks at what comes out.
      const SceneWalk<float>& walk = lanes_[waiting >> j & 1 ? j : first].walk;
      const GeometryView<float>& g = walk.geometry();
      patches.set(j, &g.models[walk.leaf], &g.nets[walk.leaf], bump_of(g, walk.leaf), &walk.frame);
    }
    const LaneOutcome o = newton_on_models(patches, frames_, waiting, counts_);
    for (unsigned left = o.met; left; left &= left - 1) {
      const int j = std::countr_zero(left);
      Lane& lane = lanes_[j];
      if (lane.walk.report({o.u[j], o.v[j], o.z[j], 0, o.spread[j]}, hit(lane))) finish(lane);
    }
    for (unsigned left = waiting & ~(o.met | o.missed); left; left &= left - 1)
      bisect(lanes_[std::countr_zero(left)]);
  }

  /// What S8 leaves undecided. Splits are limited a ray.
  void bisect(Lane& lane) {
    SceneWalk<float>& walk = lane.walk;
    const GeometryView<float>& g = walk.geometry();
    counts_.before_ray = counts_.splits - lane.splits;
    bool ended = false;
    bisect_patch<float, true>(
        g.nets[walk.leaf], bump_of(g, walk.leaf), project(g.models[walk.leaf], walk.frame),
        walk.frame, walk.zmax,
        [&](const PatchRoot<float>& root, float&) { return ended = walk.report(root, hit(lane)); },
        counts_);
    lane.splits = counts_.splits - counts_.before_ray;
    if (ended) finish(lane);
  }

  auto hit(Lane& lane) {
    return [this, &lane](const LeafHit<float>& h) { return on_hit_(lane.walk, h); };
  }
  void finish(Lane& lane) {
    on_end_(lane.index, lane.walk.ray, lane.walk.best);
    lane.has_ray = false;
  }

  const SceneView<float>& scene_;
  Load load_;
  OnHit on_hit_;
  OnEnd on_end_;
  PatchCounters& counts_;
  std::uint64_t& node_visits_;
  const Extent* extent_ = SceneWalk<float>::first_extent(scene_);
  std::size_t next_ = 0, end_ = 0;
  int ready_begin_ = 0, ready_end_ = 0;
  Ready ready_[lane_count];
  LaneFrames frames_{};
  Lane lanes_[lane_count];
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

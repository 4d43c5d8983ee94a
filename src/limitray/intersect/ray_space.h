// Stage: intersection, S1 for many rays. Comes in: rays of a batch. Goes out: what a tree and its
// patches read of them, in the space of that tree.
#pragma once

#include "limitray/bvh/list_walk.h"
#include "limitray/intersect/kernels.h"
#include "limitray/intersect/lane_patch.h"
#include "limitray/intersect/scene_walk.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// Number of a ray in a list.
using RayId = std::uint32_t;

/// The frames of as many rays as a register has lanes, as RayFrame makes them in two halves.
struct LaneFrameMaker {
  unsigned meets;
  Lanes org[3], dir[3];
  Lanes eps, zmin, zmax;
  LaneMask z_is_1, z_is_2;
  RayDepth<float> depths[lane_count];

  using Frame = RayFrame<HalfLanes, float>;
  LaneFrameMaker(const Frame& low, const Frame& high)
      : meets(bits_of(low.meets) | bits_of(high.meets) << lane_count / 2),
        eps(join(low.eps, high.eps)),
        z_is_1(mask_of(bits_of(low.z_is_1) | bits_of(high.z_is_1) << lane_count / 2)),
        z_is_2(mask_of(bits_of(low.z_is_2) | bits_of(high.z_is_2) << lane_count / 2)) {
    for (int i = 0; i < 3; ++i)
      org[i] = join(low.moved[i], high.moved[i]), dir[i] = join(low.n[i], high.n[i]);
    const Lanes eps_z = join(low.eps_z, high.eps_z);
    zmin = join(low.from, high.from) - eps_z, zmax = join(low.to, high.to) + eps_z;
    for (int j = 0; j < lane_count; ++j) {
      const Frame& f = j < lane_count / 2 ? low : high;
      const auto at = [j](const HalfLanes& v) { return lane_of(v, j % (lane_count / 2)); };
      depths[j] = {at(f.t_origin), at(f.t_scale), at(f.z_scale), lane_of(eps_z, j)};
    }
  }

  /// LaneRay's members: PatchRay::set_axes for each lane.
  void lane_rays(Lanes (&out)[8]) const {
    const auto pick = [&](const Lanes(&v)[3], int after) {
      return select(z_is_2, v[(2 + after) % 3], select(z_is_1, v[(1 + after) % 3], v[after]));
    };
    const Lanes minus_sign = select(pick(dir, 0) > Lanes{}, Lanes{} - 1.0f, Lanes{} + 1.0f);
    for (int i = 0; i < 3; ++i) out[i] = pick(org, (i + 1) % 3);
    out[3] = minus_sign * pick(dir, 1), out[4] = minus_sign * pick(dir, 2);
    out[5] = eps, out[6] = zmin, out[7] = zmax;
  }
  /// BoxRay's members: make_box_ray for each lane.
  void box_rays(Lanes (&out)[8]) const {
    for (int i = 0; i < 3; ++i) {
      const Lanes most = Lanes{} + most_inverse;
      out[i] = min(max(Lanes(1.0f / dir[i]), Lanes(-most)), most);
      out[3 + i] = org[i] * out[i];
    }
    out[6] = zmin, out[7] = zmax;
  }
  /// RayKind's number.
  LaneBits kinds() const {
    LaneBits k = (LaneBits(z_is_1) & 8u) | (LaneBits(z_is_2) & 16u);
    for (int i = 0; i < 3; ++i) k |= (LaneBits(dir[i]) >> 31) << i;
    return k;
  }
};

/// Rays in the space of a tree, or in those of several instances, and which rays of the stream they
/// are. The last place is written to for rays that miss the tree.
struct RaySpace {
  int count = 0;
  BoxRay boxes[max_rays_a_call + 1];
  LaneRay rays[max_rays_a_call + 1];
  RayDepth<float> depths[max_rays_a_call + 1];
  std::uint8_t kinds[max_rays_a_call + 1];
  RayId stream_ids[max_rays_a_call + 1];
  std::uint32_t instances[max_rays_a_call + 1];
  static constexpr int octants = 8;              // the signs of a direction
  RayId by_signs[max_rays_a_call + list_slack];  // those that came last, sorted
  int signs_begin[octants + 1];                  // where those of the same signs begin

  /// Appends those of `here` rays that meet the tree of an instance.
  void add(const LaneFrameMaker& f, const RayId* ids, int here, std::uint32_t instance) {
    int place[lane_count], next = count;
    float *lane_rows[lane_count], *box_rows[lane_count];
    const LaneBits kind = f.kinds();
    for (int j = 0; j < lane_count; ++j) {
      const bool meets = j < here && (f.meets >> j & 1);
      place[j] = meets ? next : max_rays_a_call;
      next += meets;
      lane_rows[j] = &rays[place[j]].org_x, box_rows[j] = &boxes[place[j]].inv[0];
      depths[place[j]] = f.depths[j];
      kinds[place[j]] = std::uint8_t(lane_of(kind, j));
      stream_ids[place[j]] = j < here ? ids[j] : 0;
      instances[place[j]] = instance;
    }
    count = next;
    Lanes values[8];
    f.lane_rays(values);
    store_by_lane(values, lane_rows);
    f.box_rays(values);
    store_by_lane(values, box_rows);
  }
  void move(int from, int to) {
    boxes[to] = boxes[from], rays[to] = rays[from], depths[to] = depths[from];
    kinds[to] = kinds[from], stream_ids[to] = stream_ids[from], instances[to] = instances[from];
  }
  /// Sorts the rays from `first` on.
  void sort_by_signs(int first) {
    int next[octants] = {};
    for (int k = first; k < count; ++k) ++next[RayKind(kinds[k]).signs];
    signs_begin[0] = 0;
    for (int i = 0; i < octants; ++i) {
      signs_begin[i + 1] = signs_begin[i] + next[i];
      next[i] = signs_begin[i];
    }
    for (int k = first; k < count; ++k) by_signs[next[RayKind(kinds[k]).signs]++] = RayId(k);
  }
};

}  // namespace LIMITRAY_ISA
}  // namespace limitray

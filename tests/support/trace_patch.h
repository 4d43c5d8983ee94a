// One patch and one ray through the kernels: all roots, or those that a closest-hit search sees.
#pragma once

#include <vector>

#include "extent.h"
#include "limitray/intersect/hit_attributes.h"
#include "limitray/intersect/intersect_patch.h"
#include "limitray/patches/patch_model.h"
#include "random_patches.h"

namespace limitray::test {

/// What the search may use: bisection alone, or S8 on subpatches too, or on the whole patch first.
enum class Search { bisection, newton_on_subpatches, full };

template <class T>
struct Root {
  double t, t_error;
  T u, v;
};

struct SearchResult {
  PatchCounters count;
  bool ray_accepted = false;
  double eps = 0;  // the larger one of the search's own bounds on x and y
};

/// Appends the roots of `p` on `ray`; with `closest`, what is farther than the nearest so far is
/// left out as in Scene::cast_rays.
template <class T>
SearchResult find_roots(const RoundedPatch<T>& p, double radius, const ObjectRay& ray,
                        Search search, bool closest, std::vector<Root<T>>& roots) {
  SearchResult result;
  PatchRay<T> r;
  result.ray_accepted = make_patch_ray(ray, extent_of(radius), r);
  if (!result.ray_accepted) return result;
  T zmax = r.zmax;
  const PatchBump<T>* bump = p.bump_or_null();
  const PatchModel<T> model = make_patch_model(p.net, bump);
  const ProjectedModel<T> m = project(model, r);
  result.eps = double(std::max(m.eps_x, m.eps_y));
  const auto on_hit = [&](const PatchRoot<T>& root, T& z) {
    roots.push_back(
        {r.t_of(root.z), t_rounding(model, r) + root.spread * r.t_scale, root.u, root.v});
    if (closest) z = std::min(z, root.z);
    return false;
  };
  if (search == Search::full)
    intersect_patch<T, true>(p.net, bump, model, r, zmax, on_hit, result.count);
  else if (search == Search::newton_on_subpatches)
    bisect_patch<T, true>(p.net, bump, m, r, zmax, on_hit, result.count);
  else
    bisect_patch<T, false>(p.net, bump, m, r, zmax, on_hit, result.count);
  return result;
}

}  // namespace limitray::test

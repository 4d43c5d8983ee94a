// Stage: bindings. Ray queries: arrays of rays in, arrays of hits out, one row a ray.
#include "bind_queries.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <functional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "interruptible.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

using HitDictionary = nb::typed<nb::dict, nb::str, nb::any>;

template <class T>
RayBatch<T> to_batch(const Input<T, -1, 6>& rays, const Input<T, -1>& tnear,
                     const Input<T, -1>& tfar) {
  for (const auto& [name, limits] : {std::pair{"tnear", &tnear}, std::pair{"tfar", &tfar}}) {
    if (limits->size() != 1 && limits->size() != rays.shape(0)) {
      throw nb::value_error((std::string(name) + " must have 1 value or one a ray").c_str());
    }
  }
  return {{rays.data(), rays.size()}, {tnear.data(), tnear.size()}, {tfar.data(), tfar.size()}};
}

/// The answers of cast_rays that were asked for, by name; each becomes one numpy array.
template <class T>
class HitDict {
 public:
  HitDict(std::size_t rays, const std::vector<std::string>& names) : rays_(rays) {
    for (const std::string& name : names) {
      want("t_hit", &HitArrays<T>::t, 1, name);
      want("geometry_ids", &HitArrays<T>::geometry_id, 1, name);
      want("primitive_ids", &HitArrays<T>::primitive_id, 1, name);
      want("primitive_uvs", &HitArrays<T>::uv, 2, name);
      want("primitive_normals", &HitArrays<T>::normal, 3, name);
      want("points", &HitArrays<T>::point, 3, name);
      want("dp_du", &HitArrays<T>::dp_du, 3, name);
      want("dp_dv", &HitArrays<T>::dp_dv, 3, name);
      want("t_error", &HitArrays<T>::t_error, 1, name);
      want("patch_ids", &HitArrays<T>::patch_id, 1, name);
      want("sub_quads", &HitArrays<T>::sub_quad, 1, name);
      if (!dict_.contains(name.c_str())) {
        throw nb::value_error(("attributes: unknown name \"" + name + "\"").c_str());
      }
    }
  }

  const HitArrays<T>& arrays() const { return arrays_; }
  HitDictionary dict() const { return dict_; }

 private:
  template <class U>
  void want(const char* key, U* HitArrays<T>::*member, std::size_t width, const std::string& name) {
    if (name != key) return;
    auto values = uninitialised<U>(rays_ * width);
    arrays_.*member = values.get();
    dict_[key] =
        width == 1 ? own(std::move(values), {rays_}) : own(std::move(values), {rays_, width});
  }

  std::size_t rays_;
  HitArrays<T> arrays_;
  HitDictionary dict_;
};

template <class T>
HitDictionary cast_rays(const Scene& self, Input<T, -1, 6> rays, Input<T, -1> tnear,
                        Input<T, -1> tfar, const std::vector<std::string>& attributes,
                        const ProgressCallback& callback) {
  const RayBatch<T> batch = to_batch<T>(rays, tnear, tfar);
  HitDict<T> hits(batch.size(), attributes);
  run_interruptibly([&](Progress& progress) { self.cast_rays(batch, hits.arrays(), &progress); },
                    callback);
  return hits.dict();
}

template <class T>
Output<bool> test_occlusions(const Scene& self, Input<T, -1, 6> rays, Input<T, -1> tnear,
                             Input<T, -1> tfar, const ProgressCallback& callback) {
  static_assert(sizeof(bool) == sizeof(std::uint8_t));
  const RayBatch<T> batch = to_batch<T>(rays, tnear, tfar);
  auto occluded = uninitialised<bool>(batch.size());
  run_interruptibly(
      [&](Progress& progress) {
        self.test_occlusions(batch, reinterpret_cast<std::uint8_t*>(occluded.get()), &progress);
      },
      callback);
  return own(std::move(occluded), {batch.size()});
}

Output<std::uint32_t> count_intersections(const Scene& self, Input<double, -1, 6> rays,
                                          Input<double, -1> tnear, Input<double, -1> tfar,
                                          const ProgressCallback& callback) {
  const RayBatch<double> batch = to_batch<double>(rays, tnear, tfar);
  auto counts = uninitialised<std::uint32_t>(batch.size());
  run_interruptibly(
      [&](Progress& progress) { self.count_intersections(batch, counts.get(), &progress); },
      callback);
  return own(std::move(counts), {batch.size()});
}

HitDictionary list_intersections(const Scene& self, Input<double, -1, 6> rays,
                                 Input<double, -1> tnear, Input<double, -1> tfar,
                                 const ProgressCallback& callback) {
  const RayBatch<double> batch = to_batch<double>(rays, tnear, tfar);
  IntersectionList list = run_interruptibly(
      [&](Progress& progress) { return self.list_intersections(batch, &progress); }, callback);
  const std::size_t n = list.t.size();
  HitDictionary result;
  result["ray_splits"] = own(std::move(list.offsets), {batch.size() + 1});
  result["t_hit"] = own(std::move(list.t), {n});
  result["geometry_ids"] = own(std::move(list.geometry_id), {n});
  result["primitive_ids"] = own(std::move(list.primitive_id), {n});
  result["primitive_uvs"] = own(std::move(list.uv), {n, 2});
  result["primitive_normals"] = own(std::move(list.normal), {n, 3});
  result["sub_quads"] = own(std::move(list.sub_quad), {n});
  return result;
}

nb::typed<nb::tuple, Output<double>, Output<double>, Output<double>> evaluate_primvar(
    const Scene& self, const std::string& name, Input<std::uint32_t, -1> geometry_ids,
    Input<std::uint32_t, -1> faces, Input<std::uint32_t, -1> sub_quads, Input<double, -1, 2> uv) {
  const std::size_t n = geometry_ids.size();
  const auto width = static_cast<std::size_t>(self.primvar_width(name));
  const SurfacePlaces at{{geometry_ids.data(), n},
                         {faces.data(), faces.size()},
                         {sub_quads.data(), sub_quads.size()},
                         {uv.data(), uv.size()}};
  auto values = uninitialised<double>(n * width);
  auto d_du = uninitialised<double>(n * width), d_dv = uninitialised<double>(n * width);
  run_interruptibly([&](Progress& progress) {
    self.evaluate_primvar(name, at, values.get(), d_du.get(), d_dv.get(), &progress);
  });
  return nb::make_tuple(own(std::move(values), {n, width}), own(std::move(d_du), {n, width}),
                        own(std::move(d_dv), {n, width}));
}

template <class T>
void bind_typed_queries(nb::class_<Scene>& scene) {
  scene
      .def("cast_rays", &cast_rays<T>, "rays"_a.noconvert(), "tnear"_a.noconvert(),
           "tfar"_a.noconvert(), "attributes"_a, "progress"_a = nb::none(),
           "Closest hits of rays (n, 6): a dict of the named arrays.")
      .def("test_occlusions", &test_occlusions<T>, "rays"_a.noconvert(), "tnear"_a.noconvert(),
           "tfar"_a.noconvert(), "progress"_a = nb::none(),
           "Whether anything is hit by each of rays (n, 6).");
}

}  // namespace

void bind_queries(nb::class_<Scene>& scene) {
  bind_typed_queries<float>(scene);
  bind_typed_queries<double>(scene);
  scene.def("primvar_width", &Scene::primvar_width, "name"_a, "Components; 0 if no mesh has it.")
      .def("evaluate_primvar", &evaluate_primvar, "name"_a, "geometry_ids"_a.noconvert(),
           "faces"_a.noconvert(), "sub_quads"_a.noconvert(), "uv"_a.noconvert(),
           "A primvar and its derivatives by u and v, each (n, width) float64, at ids (n,) uint32 "
           "and uv (n, 2) float64.")
      .def("count_intersections", &count_intersections, "rays"_a.noconvert(), "tnear"_a.noconvert(),
           "tfar"_a.noconvert(), "progress"_a = nb::none(),
           "Number of intersections along each of rays (n, 6).")
      .def("list_intersections", &list_intersections, "rays"_a.noconvert(), "tnear"_a.noconvert(),
           "tfar"_a.noconvert(), "progress"_a = nb::none(),
           "All intersections along rays (n, 6), by ray and then by t.");
}

}  // namespace limitray::bindings

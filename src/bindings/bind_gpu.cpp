// Stage: bindings. What the GPU tracer (python/limitray/gpu.py) reads of a scene: copies of the
// patches, trees and instances, in the layouts of patches/patch_buffer.slang and bvh/bvh.slang.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <type_traits>
#include <utility>

#include "bind.h"
#include "bind_queries.h"
#include "limitray/bvh/bvh.h"
#include "limitray/scene.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

using Record = nb::typed<nb::dict, nb::str, nb::any>;

// The layouts that src/limitray/**/*.slang rely on.
static_assert(sizeof(PatchNet<float>) == 12 * 16 && sizeof(PatchBump<float>) == 3 * 16);
static_assert(sizeof(PatchInfo) == 28);
static_assert(offsetof(PatchInfo, face) == 0 && offsetof(PatchInfo, sub_quad) == 4 &&
              offsetof(PatchInfo, level) == 6 && offsetof(PatchInfo, bump) == 8 &&
              offsetof(PatchInfo, u0) == 12 && offsetof(PatchInfo, v0) == 16 &&
              offsetof(PatchInfo, du) == 20 && offsetof(PatchInfo, dv) == 24);
static_assert(sizeof(PatchModel<float>) == 16 * 4 && offsetof(PatchModel<float>, curvature) == 60);
static_assert(sizeof(BvhNode) == 14 * 16);
static_assert(offsetof(BvhNode, lo) == 0 && offsetof(BvhNode, hi) == 96 &&
              offsetof(BvhNode, child) == 192);

/// The bytes of `count` values as an array (count, sizeof(T) / 4) of T's 32-bit words.
template <class Word, class T>
Output<Word> words(const T* values, std::size_t count) {
  static_assert(sizeof(Word) == 4 && sizeof(T) % 4 == 0);
  constexpr std::size_t width = sizeof(T) / 4;
  auto copy = uninitialised<Word>(count * width);
  if (count > 0) std::memcpy(copy.get(), static_cast<const void*>(values), count * sizeof(T));
  return own(std::move(copy), {count, width});
}

Output<double> row(std::initializer_list<double> numbers) {
  auto values = uninitialised<double>(numbers.size());
  std::copy(numbers.begin(), numbers.end(), values.get());
  return own(std::move(values), {numbers.size()});
}

/// A 3 x 4 matrix that acts on column vectors.
Output<double> matrix(const Affine& a) {
  auto values = uninitialised<double>(12);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) values[4 * i + j] = a.linear[i][j];
    values[4 * i + 3] = a.offset[i];
  }
  return own(std::move(values), {3, 4});
}

Record mesh_data(const Scene& self, std::size_t mesh) {
  const MeshData m = self.mesh_data(mesh);
  Record d;
  d["nets"] = words<float>(m.nets.data(), m.nets.size());
  d["bumps"] = words<float>(m.bumps.data(), m.bumps.size());
  d["infos"] = words<std::uint32_t>(m.infos.data(), m.infos.size());
  d["models"] = words<float>(m.models.data(), m.models.size());
  d["patch_ids"] = words<std::uint32_t>(m.patch_ids.data(), m.patch_ids.size());
  d["nodes"] = words<float>(m.nodes, m.node_count);
  d["center"] = row({m.center.x, m.center.y, m.center.z});
  d["half"] = row({m.half.x, m.half.y, m.half.z});
  d["radius"] = m.radius;
  d["left_handed"] = m.left_handed;
  return d;
}

Record instance_data(const Scene& self, std::uint32_t geometry_id) {
  const InstanceData in = self.instance_data(geometry_id);
  Record d;
  d["mesh"] = in.mesh;
  d["identity"] = in.identity;
  d["to_object"] = matrix(in.to_object);
  d["to_world"] = matrix(in.to_world);
  return d;
}

Record top_data(const Scene& self) {
  const TopData top = self.top_data();
  Record d;
  d["nodes"] = words<float>(top.nodes, top.node_count);
  d["center"] = row({top.center.x, top.center.y, top.center.z});
  d["half"] = row({top.half.x, top.half.y, top.half.z});
  d["radius"] = top.radius;
  return d;
}

/// Size and offsets of the records whose bytes the functions above export.
nb::typed<nb::dict, nb::str, nb::typed<nb::dict, nb::str, std::size_t>> gpu_layout() {
  using Net = PatchNet<float>;
  using Bump = PatchBump<float>;
  using Model = PatchModel<float>;
  using Axis = std::remove_reference_t<decltype(Model::axis[0])>;
  nb::dict all;
  const auto add = [&](const char* name, std::size_t size,
                       std::initializer_list<std::pair<const char*, std::size_t>> offsets) {
    nb::dict record;
    record["size"] = size;
    for (const auto& [field, offset] : offsets) record[field] = offset;
    all[name] = record;
  };
  add("PatchInfo", sizeof(PatchInfo),
      {{"face", offsetof(PatchInfo, face)},
       {"sub_quad", offsetof(PatchInfo, sub_quad)},
       {"level", offsetof(PatchInfo, level)},
       {"bump", offsetof(PatchInfo, bump)},
       {"u0", offsetof(PatchInfo, u0)},
       {"v0", offsetof(PatchInfo, v0)},
       {"du", offsetof(PatchInfo, du)},
       {"dv", offsetof(PatchInfo, dv)}});
  add("PatchNet", sizeof(Net), {{"c", offsetof(Net, c)}});
  add("PatchBump", sizeof(Bump), {{"c", offsetof(Bump, c)}});
  add("PatchModel", sizeof(Model),
      {{"axis", offsetof(Model, axis)}, {"curvature", offsetof(Model, curvature)}});
  add("PatchModelAxis", sizeof(Axis),
      {{"p", offsetof(Axis, p)},
       {"p_u", offsetof(Axis, p_u)},
       {"p_v", offsetof(Axis, p_v)},
       {"d_u", offsetof(Axis, d_u)},
       {"d_v", offsetof(Axis, d_v)}});
  add("BvhNode", sizeof(BvhNode),
      {{"lo", offsetof(BvhNode, lo)},
       {"hi", offsetof(BvhNode, hi)},
       {"child", offsetof(BvhNode, child)}});
  return all;
}

}  // namespace

void bind_gpu(nb::class_<Scene>& scene) {
  scene.def("mesh_count", &Scene::mesh_count)
      .def("mesh_data", &mesh_data, "mesh"_a,
           "Patches and tree of a mesh, as 32-bit words of the C++ records.")
      .def("instance_data", &instance_data, "geometry_id"_a)
      .def("top_data", &top_data, "The tree over the instances.")
      .def_static("gpu_layout", &gpu_layout,
                  "Bytes of each record that these hold, and the offsets of its members.");
}

}  // namespace limitray::bindings

// Stage: bindings. Scene: meshes and instances go in; its queries are in bind_queries.cpp.
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bind.h"
#include "bind_queries.h"
#include "interruptible.h"
#include "limitray/scene.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

nb::typed<nb::dict, nb::str, std::uint64_t> to_dict(const Statistics& s) {
  nb::typed<nb::dict, nb::str, std::uint64_t> d;
  d["rays"] = s.rays;
  d["node_visits"] = s.node_visits;
  d["patch_tests"] = s.patch_tests;
  d["early_outs"] = s.early_outs;
  d["splits"] = s.splits;
  d["backtracks"] = s.backtracks;
  d["newton_runs"] = s.newton_runs;
  d["newton_steps"] = s.newton_steps;
  d["unresolved"] = s.unresolved;
  return d;
}

std::uint32_t add_mesh(Scene& self, const ControlCage& cage, int isolation_level,
                       Input<double, 4, 4> transform, double tolerance, std::size_t memory_limit) {
  const MeshOptions options{isolation_level, to_affine(transform), tolerance, memory_limit};
  return run_interruptibly(
      [&](Progress& progress) { return self.add_mesh(cage, options, &progress); });
}

void update_points(Scene& self, std::uint32_t geometry_id, Input<double, -1, 3> rows) {
  const std::vector<Vec3d> points = to_points(rows);
  run_interruptibly([&](Progress&) { self.update_points(geometry_id, points); });
}

Output<double> bounds(const Scene& self) {
  const auto corners = self.bounds();
  auto values = uninitialised<double>(6);
  for (std::size_t i = 0; i < 6; ++i) values[i] = corners[i / 3][static_cast<int>(i % 3)];
  return own(std::move(values), {2, 3});
}

}  // namespace

void bind_scene(nb::module_& module) {
  nb::class_<MeshStatistics>(module, "MeshStatistics", "Size of one mesh of a scene.")
      .def_ro("patches", &MeshStatistics::patches)
      .def_ro("gregory_patches", &MeshStatistics::gregory_patches)
      .def_ro("patches_by_level", &MeshStatistics::patches_by_level)
      .def_ro("patch_bytes", &MeshStatistics::patch_bytes)
      .def_ro("bvh_bytes", &MeshStatistics::bvh_bytes)
      .def_ro("build_seconds", &MeshStatistics::build_seconds)
      .def_ro("isolation_level", &MeshStatistics::isolation_level)
      .def_ro("limit_error", &MeshStatistics::limit_error);

  auto scene =
      nb::class_<Scene>(module, "Scene", "Meshes, instances and the queries on them.")
          .def(nb::init<int>(), "threads"_a = 0)
          .def("add_mesh", &add_mesh, "cage"_a, "isolation_level"_a, "transform"_a.noconvert(),
               "tolerance"_a = default_tolerance, "memory_limit"_a = 0)
          .def(
              "add_instance",
              [](Scene& self, std::uint32_t geometry_id, Input<double, 4, 4> transform) {
                return self.add_instance(geometry_id, to_affine(transform));
              },
              "geometry_id"_a, "transform"_a.noconvert())
          .def("truncate", &Scene::truncate, "count"_a)
          .def("update_points", &update_points, "geometry_id"_a, "points"_a.noconvert())
          .def("geometry_count", &Scene::geometry_count)
          .def("mesh_statistics", &Scene::mesh_statistics, "geometry_id"_a)
          .def("bounds", &bounds, "Lower and upper corner (2, 3).")
          .def("statistics", [](const Scene& self) { return to_dict(self.statistics()); })
          .def("reset_statistics", &Scene::reset_statistics)
          .def("set_newton", &Scene::set_newton, "on"_a);
  bind_queries(scene);
  bind_gpu(scene);
  module.def("isa", &Scene::isa, "Instruction set in use.");
}

}  // namespace limitray::bindings

// Stage: bindings. ControlCage with its arrays, validation and the OBJ reader.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "bind.h"
#include "interruptible.h"
#include "limitray/cage/cage.h"
#include "limitray/cage/obj.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

/// UsdGeomMesh's token of each value of an enumeration, in the order of its declaration.
template <class Enum>
struct Tokens;
template <>
struct Tokens<InterpolateBoundary> {
  static constexpr std::array<std::string_view, 3> names{"none", "edgeOnly", "edgeAndCorner"};
};
template <>
struct Tokens<FaceVaryingLinearInterpolation> {
  static constexpr std::array<std::string_view, 6> names{
      "none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"};
};
template <>
struct Tokens<TriangleSubdivisionRule> {
  static constexpr std::array<std::string_view, 2> names{"catmullClark", "smooth"};
};
template <>
struct Tokens<CreasingMethod> {
  static constexpr std::array<std::string_view, 2> names{"uniform", "chaikin"};
};
template <>
struct Tokens<Interpolation> {
  static constexpr std::array<std::string_view, 5> names{"constant", "uniform", "varying", "vertex",
                                                         "faceVarying"};
};
template <>
struct Tokens<Orientation> {
  static constexpr std::array<std::string_view, 2> names{"rightHanded", "leftHanded"};
};

/// The value whose token is `text`; throws std::invalid_argument that lists the tokens.
template <class Enum>
Enum from_token(const std::string& text, const char* argument) {
  std::string known;
  for (std::size_t i = 0; i < Tokens<Enum>::names.size(); ++i) {
    if (Tokens<Enum>::names[i] == text) return static_cast<Enum>(i);
    known.append(i ? ", \"" : "\"").append(Tokens<Enum>::names[i]).append("\"");
  }
  throw std::invalid_argument(std::string(argument) + " must be one of " + known + ", not \"" +
                              text + "\"");
}

template <class Enum>
std::string to_token(Enum value) {
  return std::string(Tokens<Enum>::names[static_cast<std::size_t>(value)]);
}

/// Property of type Enum, read and written as its token.
template <class Enum>
void bind_token(nb::class_<ControlCage>& cage, const char* name, Enum ControlCage::*member) {
  cage.def_prop_rw(
      name, [member](const ControlCage& self) { return to_token(self.*member); },
      [member, name](ControlCage& self, const std::string& text) {
        self.*member = from_token<Enum>(text, name);
      });
}

/// Property of type vector: written by copying a one-dimensional array, read as a view.
template <class T>
void bind_vector(nb::class_<ControlCage>& cage, const char* name,
                 std::vector<T> ControlCage::*member) {
  cage.def_prop_rw(
      name,
      [member](nb::handle_t<ControlCage> self) {
        const std::vector<T>& values = nb::cast<const ControlCage&>(self).*member;
        return Output<const T>(values.data(), {values.size()}, self);
      },
      [member](ControlCage& self, Input<T, -1> values) {
        (self.*member).assign(values.data(), values.data() + values.size());
      },
      nb::for_setter(nb::arg("values").noconvert()));
}

void bind_points(nb::class_<ControlCage>& cage) {
  cage.def_prop_rw(
      "points",
      [](nb::handle_t<ControlCage> self) {
        const auto& points = nb::cast<const ControlCage&>(self).points;
        return Output<const double>(points.data(), {points.size(), std::size_t{3}}, self);
      },
      [](ControlCage& self, Input<double, -1, 3> points) { self.points = to_points(points); },
      nb::for_setter(nb::arg("points").noconvert()));
}

void bind_primvars(nb::class_<ControlCage>& cage) {
  cage.def(
      "add_primvar",
      [](ControlCage& self, std::string name, const std::string& interpolation,
         Input<float, -1, -1> values, Input<std::int32_t, -1> indices) {
        const std::string argument = "primvars[\"" + name + "\"].interpolation";
        self.primvars.push_back({std::move(name),
                                 from_token<Interpolation>(interpolation, argument.c_str()),
                                 static_cast<int>(values.shape(1)),
                                 {values.data(), values.data() + values.size()},
                                 {indices.data(), indices.data() + indices.size()}});
      },
      "name"_a, "interpolation"_a, "values"_a.noconvert(), "indices"_a.noconvert(),
      "Adds a primvar: values (n, width), indices into its rows.");
  cage.def(
      "primvars",
      [](nb::handle_t<ControlCage> self) {
        nb::typed<nb::dict, nb::str,
                  nb::typed<nb::tuple, nb::str, Output<const float>, Output<const std::int32_t>>>
            result;
        for (const Primvar& primvar : nb::cast<const ControlCage&>(self).primvars) {
          const auto width = static_cast<std::size_t>(primvar.width);
          result[primvar.name.c_str()] = nb::make_tuple(
              to_token(primvar.interpolation),
              Output<const float>(primvar.values.data(), {primvar.values.size() / width, width},
                                  self),
              Output<const std::int32_t>(primvar.indices.data(), {primvar.indices.size()}, self));
        }
        return result;
      },
      "Primvars: name to (interpolation, values (n, width) float32, indices int32).");
}

nb::typed<nb::tuple, Output<std::int32_t>, Output<float>> crease_edge_arrays(
    const ControlCage& cage) {
  const std::vector<CreaseEdge> edges = crease_edges(cage);
  auto vertices = uninitialised<std::int32_t>(2 * edges.size());
  auto sharpnesses = uninitialised<float>(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    vertices[2 * i] = edges[i].v0;
    vertices[2 * i + 1] = edges[i].v1;
    sharpnesses[i] = edges[i].sharpness;
  }
  return nb::make_tuple(own(std::move(vertices), {edges.size(), 2}),
                        own(std::move(sharpnesses), {edges.size()}));
}

/// A file that cannot be parsed is a wrong value for Python, not a RuntimeError.
ControlCage read_obj_file(const std::string& path) {
  try {
    return run_interruptibly([&](Progress&) { return read_obj(path); });
  } catch (const std::runtime_error& error) {
    throw nb::value_error(error.what());
  }
}

}  // namespace

void bind_cage(nb::module_& module) {
  auto cage = nb::class_<ControlCage>(module, "ControlCage",
                                      "Polygon mesh with subdivision tags (UsdGeomMesh's names). "
                                      "Arrays are copied in and viewed, read-only, on the way out.")
                  .def(nb::init<>());
  bind_points(cage);
  bind_vector(cage, "face_vertex_counts", &ControlCage::face_vertex_counts);
  bind_vector(cage, "face_vertex_indices", &ControlCage::face_vertex_indices);
  bind_vector(cage, "crease_indices", &ControlCage::crease_indices);
  bind_vector(cage, "crease_lengths", &ControlCage::crease_lengths);
  bind_vector(cage, "crease_sharpnesses", &ControlCage::crease_sharpnesses);
  bind_vector(cage, "corner_indices", &ControlCage::corner_indices);
  bind_vector(cage, "corner_sharpnesses", &ControlCage::corner_sharpnesses);
  bind_vector(cage, "hole_indices", &ControlCage::hole_indices);
  bind_token(cage, "interpolate_boundary", &ControlCage::interpolate_boundary);
  bind_token(cage, "face_varying_linear_interpolation",
             &ControlCage::face_varying_linear_interpolation);
  bind_token(cage, "triangle_subdivision_rule", &ControlCage::triangle_subdivision_rule);
  bind_token(cage, "creasing_method", &ControlCage::creasing_method);
  bind_token(cage, "orientation", &ControlCage::orientation);
  bind_primvars(cage);

  module.def(
      "validate",
      [](const ControlCage& self) {
        return run_interruptibly([&](Progress&) { return validate(self).messages; });
      },
      "cage"_a, "Checks all arrays; raises ValueError. Returns warnings.");
  module.def("crease_edges", &crease_edge_arrays, "cage"_a,
             "All crease edges: vertices (n, 2) int32 and sharpnesses (n,) float32.");
  module.def("read_obj", &read_obj_file, "path"_a,
             "Reads a Wavefront OBJ file with OpenSubdiv's tags; raises ValueError 'file:line: "
             "what is wrong'.");
}

}  // namespace limitray::bindings

#include "limitray/cage/obj.h"

#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "limitray/cage/obj_scan.h"
#include "limitray/cage/topology.h"

// The loader is compiled here, in double, under another name: the distribution's library holds the
// same symbols for float.
#define tinyobj limitray_tinyobj
#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

namespace limitray {

namespace {

// Turns the tags of a file into arrays of a cage whose points and faces are complete.
class TagReader {
 public:
  TagReader(ControlCage& cage, const ScannedObj& scanned, const std::string& name)
      : cage_(cage), scanned_(scanned), name_(name), topology_(make_topology(cage)) {}

  void read(const tinyobj::tag_t& tag, std::size_t line) {
    line_ = line;
    if (tag.name == "crease") {
      read_crease(tag);
    } else if (tag.name == "corner") {
      read_corner(tag);
    } else if (tag.name == "hole") {
      read_hole(tag);
    } else {
      read_option(tag);
    }
  }

 private:
  void read_crease(const tinyobj::tag_t& tag) {
    for (std::size_t i = 0; i + 1 < tag.intValues.size(); ++i) {
      const std::int32_t a = vertex(tag.intValues[i]), b = vertex(tag.intValues[i + 1]);
      if (topology_.find_edge(a, b) < 0) {
        fail("crease (" + std::to_string(a) + ", " + std::to_string(b) +
             ") is no edge of the mesh");
      }
      cage_.crease_indices.insert(cage_.crease_indices.end(), {a, b});
      cage_.crease_lengths.push_back(2);
      cage_.crease_sharpnesses.push_back(sharpness(tag, i));
    }
  }

  void read_corner(const tinyobj::tag_t& tag) {
    for (std::size_t i = 0; i < tag.intValues.size(); ++i) {
      cage_.corner_indices.push_back(vertex(tag.intValues[i]));
      cage_.corner_sharpnesses.push_back(sharpness(tag, i));
    }
  }

  void read_hole(const tinyobj::tag_t& tag) {
    for (const int value : tag.intValues) {
      const std::int32_t place = scanned_.face_places[in_range(
          "hole face", value, static_cast<std::int32_t>(scanned_.face_places.size()))];
      if (place >= 0) cage_.hole_indices.push_back(place);
    }
  }

  void read_option(const tinyobj::tag_t& tag) {
    if (tag.name == "interpolateboundary") {
      using enum InterpolateBoundary;
      constexpr InterpolateBoundary rules[] = {none, edge_and_corner, edge_only};
      cage_.interpolate_boundary = rules[in_range("interpolateboundary", tag.intValues[0], 3)];
    } else if (tag.name == "facevaryinginterpolateboundary") {
      cage_.face_varying_linear_interpolation = static_cast<FaceVaryingLinearInterpolation>(
          in_range("facevaryinginterpolateboundary", tag.intValues[0], 6));
    } else if (tag.name == "creasemethod") {
      cage_.creasing_method =
          one_of(tag, "normal", "chaikin") == 0 ? CreasingMethod::uniform : CreasingMethod::chaikin;
    } else {
      cage_.triangle_subdivision_rule = one_of(tag, "catmark", "smooth") == 0
                                            ? TriangleSubdivisionRule::catmull_clark
                                            : TriangleSubdivisionRule::smooth;
    }
  }

  std::int32_t vertex(int value) const {
    return in_range("tag vertex", value, static_cast<std::int32_t>(cage_.points.size()));
  }

  float sharpness(const tinyobj::tag_t& tag, std::size_t i) const {
    const double value = tag.floatValues[tag.floatValues.size() == 1 ? 0 : i];
    if (value < 0) fail("sharpness must be >= 0, got " + std::to_string(value));
    return static_cast<float>(value);
  }

  std::int32_t in_range(const char* what, int value, std::int32_t end) const {
    if (value < 0 || value >= end) {
      fail(std::string(what) + " " + std::to_string(value) + " is out of range [0, " +
           std::to_string(end - 1) + "]");
    }
    return value;
  }

  int one_of(const tinyobj::tag_t& tag, const char* first, const char* second) const {
    const std::string& word = tag.stringValues[0];
    if (word != first && word != second) {
      fail(tag.name + " must be '" + first + "' or '" + second + "', got '" + word + "'");
    }
    return word == second ? 1 : 0;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(name_ + ":" + std::to_string(line_) + ": " + what);
  }

  ControlCage& cage_;
  const ScannedObj& scanned_;
  const std::string& name_;
  CageTopology topology_;
  std::size_t line_ = 0;
};

// Makes the primvar "st" if every face corner has a texture coordinate.
void take_texture_coordinates(const ScannedObj& scanned, const tinyobj::mesh_t& mesh,
                              const std::string& name, ControlCage& cage) {
  std::size_t without = 0;
  for (const tinyobj::index_t& index : mesh.indices) without += index.texcoord_index < 0;
  if (without > 0) {
    if (without < mesh.indices.size()) {
      cage.notes.push_back(name + ": texture coordinates ignored: " + std::to_string(without) +
                           " face corners have none");
    }
    return;
  }
  Primvar st{"st", Interpolation::face_varying, 2, {}, {}};
  st.values.assign(scanned.texture_coordinates.begin(), scanned.texture_coordinates.end());
  for (const tinyobj::index_t& index : mesh.indices) st.indices.push_back(index.texcoord_index);
  cage.primvars.push_back(std::move(st));
}

}  // namespace

ControlCage parse_obj(const std::string& text, const std::string& name) {
  ScannedObj scanned = scan_obj(text, name);
  tinyobj::attrib_t attrib;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warning, error;
  std::istringstream stream(scanned.text);
  if (!tinyobj::LoadObj(&attrib, &shapes, &materials, &warning, &error, &stream, nullptr, false,
                        false)) {
    throw std::runtime_error(name + ": " + error);
  }

  ControlCage cage;
  cage.notes = scanned.notes;
  for (std::size_t i = 0; i < scanned.points.size(); i += 3) {
    cage.points.push_back({scanned.points[i], scanned.points[i + 1], scanned.points[i + 2]});
  }
  if (shapes.empty()) return cage;

  const tinyobj::mesh_t& mesh = shapes[0].mesh;
  cage.face_vertex_counts = scanned.face_sizes;
  for (const tinyobj::index_t& index : mesh.indices) {
    cage.face_vertex_indices.push_back(index.vertex_index);
  }
  take_texture_coordinates(scanned, mesh, name, cage);
  TagReader tags(cage, scanned, name);
  for (std::size_t i = 0; i < mesh.tags.size(); ++i) tags.read(mesh.tags[i], scanned.tag_lines[i]);
  return cage;
}

ControlCage read_obj(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path)) {
    throw std::runtime_error(path.string() + ": cannot be read");
  }
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return parse_obj(text, path.string());
}

}  // namespace limitray

// Stage: control cage. Comes in: the text of an OBJ file. Goes out: the lines a cage is made of,
// checked, for tinyobjloader, which reads wrong numbers, indices and tags without complaint and
// names few lines. Nothing is parsed into a mesh here.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace limitray {

/// An OBJ file that tinyobjloader reads without loss: only v, vt, f and t lines are left, in one
/// group, continued lines joined, comments removed, unknown tags removed.
struct ScannedObj {
  std::string text;
  // tinyobjloader rounds numbers twice; these are the doubles nearest to what is written.
  std::vector<double> points;               // 3 a v line
  std::vector<double> texture_coordinates;  // 2 a vt line
  std::vector<std::int32_t> face_sizes;     // corners of each face in `text`
  /// Place in `text` of each face of the file, -1 for a face that fell away (see `notes`).
  std::vector<std::int32_t> face_places;
  std::vector<std::size_t> tag_lines;  // line in the file of each tag in `text`, from 1
  std::vector<std::string> notes;      // what was ignored or repaired, "file:line: what"
};

/// Checks `text`, the content of the file called `name` in messages. Throws std::runtime_error
/// "file:line: what is wrong, and the text found" for numbers that are malformed or not finite,
/// indices that are zero or out of range, faces with fewer than 3 corners, and tags whose sizes or
/// values are wrong. Degenerate faces are repaired with a note: a vertex repeated directly after
/// itself is dropped, a face that meets a vertex again later or keeps fewer than 3 corners falls
/// away.
ScannedObj scan_obj(const std::string& text, const std::string& name);

}  // namespace limitray

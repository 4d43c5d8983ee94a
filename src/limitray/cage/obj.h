// Stage: control cage. Wavefront OBJ with OpenSubdiv's `t` tags. obj.cpp is the only file that
// includes tinyobjloader.
#pragma once

#include <filesystem>
#include <string>

#include "limitray/cage/cage.h"

namespace limitray {

/// Reads the polygons of all objects and groups in `path` as one cage, with texture coordinates as
/// the face-varying primvar "st" if every face corner has one. Lines `t name i/f/s values...` with
/// i whole numbers, f real numbers and s words are tags; indices in them count from zero over the
/// whole file:
///
///   t crease n/1/0 or n/n-1/0     chain of n vertices, one sharpness or one an edge
///   t corner n/1/0 or n/n/0       vertices, one sharpness or one each
///   t hole n/0/0                  faces
///   t interpolateboundary 1/0/0   0 none, 1 edge and corner (the default), 2 edge only
///   t facevaryinginterpolateboundary 1/0/0   0 none, 1 corners only, 2 corners plus 1 (the
///                                 default), 3 corners plus 2, 4 boundaries, 5 all
///   t creasemethod 0/0/1          normal or chaikin
///   t smoothtriangles 0/0/1       catmark or smooth
///
/// Unknown tags are ignored and degenerate faces repaired or dropped, with a line in `notes`.
/// Throws std::runtime_error "file:line: what is wrong, and the text found".
ControlCage read_obj(const std::filesystem::path& path);

/// The same for the text of a file; `name` stands for the file in errors.
ControlCage parse_obj(const std::string& text, const std::string& name);

}  // namespace limitray

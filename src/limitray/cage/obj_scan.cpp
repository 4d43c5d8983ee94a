#include "limitray/cage/obj_scan.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string_view>

namespace limitray {

namespace {

using Tokens = std::vector<std::string_view>;

// tinyobjloader reads no more values of a kind in one tag.
constexpr std::size_t tag_value_limit = 8192;

Tokens split(std::string_view line) {
  Tokens tokens;
  constexpr std::string_view blank = " \t\r\v\f";
  for (std::size_t at = line.find_first_not_of(blank); at != line.npos;) {
    const std::size_t end = std::min(line.find_first_of(blank, at), line.size());
    tokens.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(blank, end);
  }
  return tokens;
}

// The whole of `token` as a finite number.
template <class Number>
bool parse(std::string_view token, Number& value) {
  if (token.starts_with('+')) token.remove_prefix(1);
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size() || token.empty()) return false;
  return std::isfinite(static_cast<double>(value));
}

class Scanner {
 public:
  Scanner(const std::string& text, const std::string& name) : text_(text), name_(name) {}

  ScannedObj scan() {
    each_line([this](const Tokens& tokens) { count(tokens); });
    each_line([this](const Tokens& tokens) { check(tokens); });
    for (const Note& kind : notes_) {
      std::string text = name_ + ":" + std::to_string(kind.line) + ": " + kind.what;
      if (kind.times > 1) text += " (and " + std::to_string(kind.times - 1) + " more)";
      out_.notes.push_back(text);
    }
    return std::move(out_);
  }

 private:
  struct Note {
    std::string what;
    std::size_t line, times;
  };

  // Calls `visit` with the tokens of each line; line_ is its number. A backslash at the end of a
  // line continues it.
  template <class Visit>
  void each_line(const Visit& visit) {
    std::size_t number = 0, at = 0;
    while (at < text_.size()) {
      std::string joined;
      line_ = number + 1;
      bool more = true;
      while (more && at < text_.size()) {
        const std::size_t end = std::min(text_.find_first_of("\n\r", at), text_.size());
        std::string_view piece = std::string_view(text_).substr(at, end - at);
        piece = piece.substr(0, piece.find('#'));
        at = end + (text_.compare(end, 2, "\r\n") == 0 ? 2 : 1);
        ++number;
        more = piece.ends_with('\\');
        if (more) piece.remove_suffix(1);
        joined.append(piece);
        if (more) joined += ' ';
      }
      const Tokens tokens = split(joined);
      if (!tokens.empty()) visit(tokens);
    }
  }

  void count(const Tokens& tokens) {
    points_ += tokens[0] == "v";
    texcoords_ += tokens[0] == "vt";
    normals_ += tokens[0] == "vn";
  }

  void check(const Tokens& tokens) {
    if (tokens[0] == "v") {
      ++points_so_far_;
      check_numbers(tokens, 3, "a point needs at least 3 coordinates", out_.points, 3);
    } else if (tokens[0] == "vt") {
      ++texcoords_so_far_;
      check_numbers(tokens, 1, "a texture coordinate needs at least 1 number",
                    out_.texture_coordinates, 2);
    } else if (tokens[0] == "vn") {
      ++normals_so_far_;
    } else if (tokens[0] == "f") {
      check_face(tokens);
    } else if (tokens[0] == "t") {
      check_tag(tokens);
    }
  }

  // Appends the first `width` numbers to `values`, 0 for those that are missing.
  void check_numbers(const Tokens& tokens, std::size_t least, const char* rule,
                     std::vector<double>& values, std::size_t width) {
    if (tokens.size() - 1 < least) fail(rule, tokens);
    const std::size_t row = values.size();
    values.resize(row + width);
    double value;
    for (std::size_t i = 1; i < tokens.size(); ++i) {
      if (!parse(tokens[i], value)) fail("not a finite number: '" + std::string(tokens[i]) + "'");
      if (i <= width) values[row + i - 1] = value;
    }
    keep(tokens);
  }

  // The index in `token` counted from 0.
  std::int64_t checked_index(std::string_view token, const char* what, std::int64_t so_far,
                             std::int64_t total) const {
    std::int64_t index;
    if (!parse(token, index)) {
      fail(std::string(what) + " index is not a whole number: '" + std::string(token) + "'");
    }
    const std::int64_t low = index < 0 ? -so_far : 1, high = index < 0 ? -1 : total;
    if (index < low || index > high) {
      fail(std::string(what) + " index " + std::to_string(index) + " is out of range [" +
           std::to_string(low) + ", " + std::to_string(high) + "]");
    }
    return index < 0 ? so_far + index : index - 1;
  }

  // Checks "v", "v/vt", "v//vn" or "v/vt/vn" and returns v.
  std::int64_t check_corner(std::string_view token) const {
    const std::size_t slash = token.find('/');
    const std::int64_t vertex =
        checked_index(token.substr(0, slash), "face", points_so_far_, points_);
    if (slash == token.npos) return vertex;
    const std::string_view rest = token.substr(slash + 1);
    const std::size_t second = rest.find('/');
    if (second != 0) {
      checked_index(rest.substr(0, second), "texture coordinate", texcoords_so_far_, texcoords_);
    }
    if (second != rest.npos) {
      checked_index(rest.substr(second + 1), "normal", normals_so_far_, normals_);
    }
    return vertex;
  }

  void check_face(const Tokens& tokens) {
    if (tokens.size() < 4) fail("a face needs at least 3 corners", tokens);
    std::vector<std::int64_t> vertices;
    Tokens kept{tokens[0]};
    for (std::size_t i = 1; i < tokens.size(); ++i) {
      const std::int64_t vertex = check_corner(tokens[i]);
      const bool repeated =
          !vertices.empty() &&
          (vertex == vertices.back() || (i + 1 == tokens.size() && vertex == vertices.front()));
      if (repeated) continue;
      vertices.push_back(vertex);
      kept.push_back(tokens[i]);
    }
    const std::size_t corners = vertices.size();
    std::sort(vertices.begin(), vertices.end());
    const bool meets_again = std::adjacent_find(vertices.begin(), vertices.end()) != vertices.end();
    if (corners < 3 || meets_again) {
      note(meets_again ? "face dropped: it meets a vertex again"
                       : "face dropped: it has fewer than 3 different vertices");
      out_.face_places.push_back(-1);
      return;
    }
    if (kept.size() < tokens.size()) note("repeated vertex dropped from the face");
    out_.face_places.push_back(static_cast<std::int32_t>(out_.face_sizes.size()));
    out_.face_sizes.push_back(static_cast<std::int32_t>(vertices.size()));
    keep(kept);
  }

  // "t name ints/floats/strings values...".
  void check_tag(const Tokens& tokens) {
    if (tokens.size() < 3) fail("a tag needs a name and its sizes", tokens);
    const std::string tag(tokens[1]);
    std::size_t sizes[3] = {0, 0, 0}, total = 0;
    check_tag_sizes(tokens[2], sizes);
    for (const std::size_t size : sizes) total += size;
    if (tokens.size() - 3 != total) {
      fail("tag '" + tag + "' must have " + std::to_string(total) + " values, got " +
           std::to_string(tokens.size() - 3));
    }
    const std::span<const std::string_view> values = std::span(tokens).subspan(3);
    if (!known_tag(tag, sizes)) {
      note("unknown tag '" + tag + "' ignored");
      return;
    }
    check_tag_values(values, sizes);
    out_.tag_lines.push_back(line_);
    keep(tokens);
  }

  void check_tag_sizes(std::string_view token, std::size_t (&sizes)[3]) const {
    std::string_view rest = token;
    for (int kind = 0; kind < 3; ++kind) {
      const std::size_t slash = kind < 2 ? rest.find('/') : rest.size();
      if (slash == rest.npos || !parse(rest.substr(0, slash), sizes[kind])) {
        fail("tag sizes must be ints/floats/strings, got '" + std::string(token) + "'");
      }
      if (sizes[kind] > tag_value_limit) {
        fail("a tag holds at most " + std::to_string(tag_value_limit) + " values of a kind, got '" +
             std::string(token) + "'");
      }
      rest.remove_prefix(std::min(slash + 1, rest.size()));
    }
  }

  // Whether `tag` means something to a cage; its sizes are checked then.
  bool known_tag(const std::string& tag, const std::size_t (&sizes)[3]) const {
    const auto [ints, floats, strings] = sizes;
    if (tag == "crease") {
      require(ints >= 2 && (floats == 1 || floats == ints - 1) && strings == 0,
              "crease needs n >= 2 vertices and 1 or n - 1 sharpnesses");
    } else if (tag == "corner") {
      require(ints >= 1 && (floats == 1 || floats == ints) && strings == 0,
              "corner needs n >= 1 vertices and 1 or n sharpnesses");
    } else if (tag == "hole") {
      require(ints >= 1 && floats == 0 && strings == 0, "hole needs faces and nothing else");
    } else if (tag == "interpolateboundary" || tag == "facevaryinginterpolateboundary") {
      require(ints == 1 && floats == 0 && strings == 0, tag + " needs one whole number");
    } else if (tag == "creasemethod" || tag == "smoothtriangles") {
      require(ints == 0 && floats == 0 && strings == 1, tag + " needs one word");
    } else {
      return false;
    }
    return true;
  }

  void check_tag_values(std::span<const std::string_view> values,
                        const std::size_t (&sizes)[3]) const {
    std::int32_t whole;
    double real;
    for (std::size_t i = 0; i < sizes[0] + sizes[1]; ++i) {
      const bool is_whole = i < sizes[0];
      if (is_whole ? parse(values[i], whole) : parse(values[i], real)) continue;
      fail(std::string(is_whole ? "not a whole number: '" : "not a finite number: '") +
           std::string(values[i]) + "'");
    }
  }

  void keep(const Tokens& tokens) {
    for (const std::string_view token : tokens) {
      out_.text.append(token);
      out_.text += ' ';
    }
    out_.text.back() = '\n';
  }

  // Notes are counted by kind; the first line of each kind is named.
  void note(const std::string& what) {
    const auto known = std::find_if(notes_.begin(), notes_.end(),
                                    [&](const Note& kind) { return kind.what == what; });
    if (known != notes_.end()) {
      ++known->times;
    } else {
      notes_.push_back({what, line_, 1});
    }
  }

  void require(bool holds, const std::string& rule) const {
    if (!holds) fail(rule);
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(name_ + ":" + std::to_string(line_) + ": " + what);
  }
  [[noreturn]] void fail(const std::string& what, const Tokens& tokens) const {
    std::string line;
    for (const std::string_view token : tokens)
      line += (line.empty() ? "" : " ") + std::string(token);
    fail(what + ", got '" + line + "'");
  }

  const std::string& text_;
  const std::string& name_;
  std::size_t line_ = 0;
  std::int64_t points_ = 0, texcoords_ = 0, normals_ = 0;  // in the whole file
  std::int64_t points_so_far_ = 0, texcoords_so_far_ = 0, normals_so_far_ = 0;
  std::vector<Note> notes_;
  ScannedObj out_;
};

}  // namespace

ScannedObj scan_obj(const std::string& text, const std::string& name) {
  return Scanner(text, name).scan();
}

}  // namespace limitray

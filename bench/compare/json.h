// Writes JSON: objects and arrays opened and closed in turn, commas and indents placed here.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdio>
#include <ostream>
#include <string>
#include <string_view>

namespace limitray::bench {

class JsonWriter {
 public:
  explicit JsonWriter(std::ostream& out) : out_(out) {}

  /// `key` is empty for the outermost value and for items of arrays.
  void open(char bracket, std::string_view key = {}) {
    begin(key);
    out_ << bracket;
    indent_ += 2;
    first_ = true;
  }
  void close(char bracket) {
    indent_ -= 2;
    if (!first_) out_ << '\n' << std::string(indent_, ' ');
    out_ << bracket;
    first_ = false;
    if (indent_ == 0) out_ << '\n';
  }

  void value(std::string_view key, std::string_view text) {
    begin(key);
    write_text(text);
  }
  void value(std::string_view key, const char* text) { value(key, std::string_view(text)); }
  void value(std::string_view key, bool flag) {
    begin(key);
    out_ << (flag ? "true" : "false");
  }
  void value(std::string_view key, std::integral auto number) {
    begin(key);
    out_ << number;
  }
  /// Six digits; null for what is not finite.
  void value(std::string_view key, double number) {
    begin(key);
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", number);
    out_ << (std::isfinite(number) ? text : "null");
  }

 private:
  void begin(std::string_view key) {
    if (indent_ > 0) out_ << (first_ ? "" : ",") << '\n' << std::string(indent_, ' ');
    first_ = false;
    if (key.empty()) return;
    write_text(key);
    out_ << ": ";
  }
  void write_text(std::string_view text) {
    out_ << '"';
    for (char c : text) {
      if (static_cast<unsigned char>(c) < 0x20) {
        char escaped[8];
        std::snprintf(escaped, sizeof escaped, "\\u%04x", c);
        out_ << escaped;
        continue;
      }
      if (c == '"' || c == '\\') out_ << '\\';
      out_ << c;
    }
    out_ << '"';
  }

  std::ostream& out_;
  std::size_t indent_ = 0;
  bool first_ = true;
};

}  // namespace limitray::bench

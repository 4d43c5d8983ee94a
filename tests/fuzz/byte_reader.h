// Test data out of a fuzzer's bytes: numbers taken one after the other, zeros once they are used
// up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace limitray::fuzz {

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  bool empty() const { return rest_.empty(); }

  /// The next bytes as a number; the missing ones are 0.
  template <class T>
  T take() {
    T value{};
    const std::size_t count = rest_.size() < sizeof(T) ? rest_.size() : sizeof(T);
    std::memcpy(&value, rest_.data(), count);
    rest_ = rest_.subspan(count);
    return value;
  }

  /// In [0, end), `end` from 1 to 65536.
  int below(int end) {
    return end <= 256 ? take<std::uint8_t>() % end : take<std::uint16_t>() % end;
  }

  /// A coordinate: most often a small multiple of 1/16, sometimes any bits.
  double coordinate() {
    if (empty()) return step() / 16.0;
    const auto kind = take<std::uint8_t>();
    if (kind < 240) return take<std::int8_t>() / 16.0;
    if (kind < 248) return static_cast<double>(take<float>());
    return take<double>();
  }

  /// In [-128, 127].
  int step() {
    if (!empty()) return take<std::int8_t>();
    scatter_ = scatter_ * 1103515245u + 12345u;
    return static_cast<int>((scatter_ >> 16) % 256) - 128;
  }

  /// A sharpness: the whole range, infinity and what is not allowed included.
  float sharpness() {
    const auto kind = take<std::uint8_t>();
    return kind < 250 ? static_cast<float>(kind) / 24.0f : take<float>();
  }

 private:
  std::span<const std::uint8_t> rest_;
  std::uint32_t scatter_ = 1;
};

}  // namespace limitray::fuzz

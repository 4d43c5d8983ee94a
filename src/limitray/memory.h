// Stage: all. How much memory there is, and the error for what does not fit.
#pragma once

#include <cstddef>
#include <new>
#include <string>
#include <utility>

namespace limitray {

/// Thrown before an allocation that is known not to fit; the message names the size.
class OutOfMemory : public std::bad_alloc {
 public:
  explicit OutOfMemory(std::string message) : message_(std::move(message)) {}
  const char* what() const noexcept override { return message_.c_str(); }

 private:
  std::string message_;
};

/// Bytes that this process may still take: what the system has available, less where a control
/// group or RLIMIT_AS allows less. The largest std::size_t where that is unknown.
std::size_t free_memory();

}  // namespace limitray

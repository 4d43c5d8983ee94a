// Where figures were taken: without it they say nothing.
#pragma once

#include <cstddef>
#include <string>

namespace limitray::bench {

/// Name of the processor as the system tells it, or "unknown".
std::string cpu_model();
/// Memory that can be allocated without swapping, in bytes; the largest size_t if unknown.
std::size_t available_memory();
/// "Linux 6.1 x86_64" or the like.
std::string operating_system();
/// "GCC 12.2.0" or "Clang 14.0.6".
std::string compiler();
std::string embree_version();

}  // namespace limitray::bench

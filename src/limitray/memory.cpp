// Stage: all. See memory.h.
#include "limitray/memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

namespace limitray {
namespace {

constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();

/// The number after `key` in a file of "key value" words; the first number if `key` is empty.
std::optional<std::size_t> read_number(const char* path, const std::string& key = "") {
  std::ifstream file(path);
  std::string word;
  while (!key.empty() && file >> word && word != key) continue;
  std::size_t value;
  if (file >> value) return value;
  return {};
}

std::size_t left(std::size_t limit, std::size_t used) { return limit > used ? limit - used : 0; }

std::size_t available_in_system() {
  if (const auto kib = read_number("/proc/meminfo", "MemAvailable:")) return *kib * 1024;
  const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
  return pages > 0 && size > 0 ? static_cast<std::size_t>(pages) * static_cast<std::size_t>(size)
                               : unlimited;
}

/// Cached files make room when memory is needed, so only anonymous memory counts as used.
std::size_t available_in_group() {
  const auto limit = read_number("/sys/fs/cgroup/memory.max");
  const auto used = read_number("/sys/fs/cgroup/memory.stat", "anon");
  return limit && used ? left(*limit, *used) : unlimited;
}

std::size_t available_as_address_space() {
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unlimited;
  const auto pages = read_number("/proc/self/statm");
  const std::size_t used = pages ? *pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) : 0;
  return left(static_cast<std::size_t>(limit.rlim_cur), used);
}

}  // namespace

std::size_t free_memory() {
  return std::min({available_in_system(), available_in_group(), available_as_address_space()});
}

}  // namespace limitray

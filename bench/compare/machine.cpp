#include "machine.h"

#include <sys/utsname.h>

#include <fstream>
#include <limits>
#include <sstream>

#include "embree.h"

namespace limitray::bench {
namespace {

/// What follows `name` and a colon in a file of /proc; empty if it isn't there.
std::string proc_field(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line)) {
    if (line.rfind(name, 0) != 0) continue;
    const std::size_t begin = line.find_first_not_of(" \t", line.find(':') + 1);
    return begin == std::string::npos ? "" : line.substr(begin);
  }
  return "";
}

}  // namespace

std::string cpu_model() {
  const std::string model = proc_field("/proc/cpuinfo", "model name");
  if (model.empty()) return "unknown";
  const std::string family = proc_field("/proc/cpuinfo", "cpu family");
  // A line "model" comes before "model name": the colon tells them apart.
  const std::string number = proc_field("/proc/cpuinfo", "model\t");
  return model + " (family " + family + ", model " + number + ")";
}

std::size_t available_memory() {
  std::istringstream field(proc_field("/proc/meminfo", "MemAvailable"));
  std::size_t kilobytes = 0;
  return field >> kilobytes ? kilobytes * 1024 : std::numeric_limits<std::size_t>::max();
}

std::string operating_system() {
  utsname name{};
  if (uname(&name) != 0) return "unknown";
  return std::string(name.sysname) + " " + name.release + " " + name.machine;
}

std::string compiler() {
#if defined(__clang__)
  return "Clang " + std::to_string(__clang_major__) + "." + std::to_string(__clang_minor__) + "." +
         std::to_string(__clang_patchlevel__);
#else
  return "GCC " + std::to_string(__GNUC__) + "." + std::to_string(__GNUC_MINOR__) + "." +
         std::to_string(__GNUC_PATCHLEVEL__);
#endif
}

std::string embree_version() { return RTC_VERSION_STRING; }

}  // namespace limitray::bench

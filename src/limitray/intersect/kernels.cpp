#include "limitray/intersect/kernels.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace limitray {
namespace {

#if defined(LIMITRAY_X86)
bool has_avx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
bool has_avx512() {
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}
#endif

const Kernels& choose() {
  const char* wanted = std::getenv("LIMITRAY_ISA");
  const std::string isa = wanted ? wanted : "";
  if (isa == "portable") return kernels_portable();
#if defined(LIMITRAY_X86)
  if (has_avx512() && (isa == "avx512" || isa.empty())) return kernels_avx512();
  if (has_avx2() && (isa == "avx2" || isa.empty())) return kernels_avx2();
#endif
  if (isa.empty()) return kernels_portable();
  if (isa == "avx2" || isa == "avx512")
    throw std::runtime_error("LIMITRAY_ISA: this machine cannot run '" + isa + "'");
  throw std::runtime_error("LIMITRAY_ISA: must be avx512, avx2 or portable, got '" + isa + "'");
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& k = choose();
  return k;
}

}  // namespace limitray

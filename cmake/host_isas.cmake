# LIMITRAY_HOST_ISAS: the instruction sets (values of LIMITRAY_ISA) that this machine can run.
include(CheckCXXSourceRuns)

set(LIMITRAY_HOST_ISAS portable)
if(LIMITRAY_IS_X86 AND NOT CMAKE_CROSSCOMPILING)
  check_cxx_source_runs("
    int main() {
      return __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") &&
             __builtin_cpu_supports(\"bmi2\") ? 0 : 1;
    }" LIMITRAY_HOST_HAS_AVX2)
  check_cxx_source_runs("
    int main() {
      return __builtin_cpu_supports(\"avx512f\") && __builtin_cpu_supports(\"avx512vl\") &&
             __builtin_cpu_supports(\"avx512dq\") && __builtin_cpu_supports(\"avx512bw\") ? 0 : 1;
    }" LIMITRAY_HOST_HAS_AVX512)
  if(LIMITRAY_HOST_HAS_AVX2)
    list(APPEND LIMITRAY_HOST_ISAS avx2)
    if(LIMITRAY_HOST_HAS_AVX512)
      list(APPEND LIMITRAY_HOST_ISAS avx512)
    endif()
  endif()
endif()
if(LIMITRAY_SANITIZE)  # slow: the best one is enough
  list(GET LIMITRAY_HOST_ISAS -1 LIMITRAY_HOST_ISAS)
endif()

# How every C++ file of the project is compiled, and the intersection kernels once per instruction
# set. Fast-math is never used. The kernels may contract a*b+c to one fused operation: their error
# bounds hold with and without, since it only leaves out a rounding.

# The kernels use __builtin_shufflevector, which GCC has from 12 on.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 12)
  message(FATAL_ERROR "limitray needs GCC 12 or newer, or Clang; ${CMAKE_CXX_COMPILER} is "
                      "GCC ${CMAKE_CXX_COMPILER_VERSION}. Choose another by "
                      "-DCMAKE_CXX_COMPILER=g++-12 or the environment variable CXX.")
endif()

if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
  set(LIMITRAY_IS_X86 ON)
endif()

set(LIMITRAY_PORTABLE_OPTIONS -ffp-contract=fast)
set(LIMITRAY_AVX2_OPTIONS ${LIMITRAY_PORTABLE_OPTIONS} -mavx2 -mfma -mbmi2)
set(LIMITRAY_AVX512_OPTIONS ${LIMITRAY_AVX2_OPTIONS} -mavx512f -mavx512vl -mavx512dq -mavx512bw)

function(limitray_compile_options target)
  target_compile_options(${target} PRIVATE -ffp-contract=off -fno-math-errno)
  if(PROJECT_IS_TOP_LEVEL)
    target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow
                           -Wno-psabi)  # wide vectors never cross the border of a library
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
      target_compile_options(${target} PRIVATE -Wno-restrict)  # false alarms on std::string + "..."
    endif()
    if(CMAKE_CXX_COMPILER_ID MATCHES "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 14)
      # Masks of one ray and of many are combined by the same operators.
      target_compile_options(${target} PRIVATE -Wno-bitwise-instead-of-logical)
    endif()
  endif()
  if(LIMITRAY_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(LIMITRAY_IS_X86)
    target_compile_definitions(${target} PRIVATE LIMITRAY_X86)
  endif()
  if(LIMITRAY_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${LIMITRAY_SANITIZE} -fno-omit-frame-pointer
                                             -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${LIMITRAY_SANITIZE})
  endif()
endfunction()

# Gives the files intersect/kernels_<isa>.cpp of `target` the options of their instruction set;
# where the processor is not x86-64, only kernels_portable.cpp is compiled.
function(limitray_kernel_sources target)
  foreach(isa avx512 avx2 portable)
    set(file ${PROJECT_SOURCE_DIR}/src/limitray/intersect/kernels_${isa}.cpp)
    string(TOUPPER ${isa} ISA)
    set(options ${LIMITRAY_${ISA}_OPTIONS})
    if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug" AND NOT LIMITRAY_SANITIZE)
      list(PREPEND options -O3)
    endif()
    set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS "${options}"
                                SKIP_UNITY_BUILD_INCLUSION ON)
    if(NOT isa STREQUAL "portable" AND NOT LIMITRAY_IS_X86)
      set_source_files_properties(${file} PROPERTIES HEADER_FILE_ONLY ON)
    endif()
  endforeach()
endfunction()

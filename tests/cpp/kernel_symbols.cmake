# Fails when a kernel object compiled for AVX2 or AVX-512 defines a weak function (an inline function
# or template) that another object could define too: the linker keeps one copy for all, and a
# processor without that instruction set would run into it. Functions whose name holds the instruction
# set's namespace are distinct for each object.
#
# usage: cmake -DNM=nm -DLIBRARY=liblimitray.a -P kernel_symbols.cmake
cmake_minimum_required(VERSION 3.21)
execute_process(COMMAND ${NM} --demangle --defined-only ${LIBRARY}
                OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE "[][;]" "_" symbols "${symbols}")
string(REPLACE "\n" ";" symbols "${symbols}")

set(isa "")
foreach(line IN LISTS symbols)
  if(line MATCHES "\\.o:$")
    set(isa "")
    if(line MATCHES "^kernels_(avx2|avx512)\\.")
      set(isa ${CMAKE_MATCH_1})
      list(APPEND seen ${isa})
    endif()
  elseif(isa AND line MATCHES " W " AND NOT line MATCHES "::${isa}::")
    message(SEND_ERROR "kernels_${isa} shares a function: ${line}")
  endif()
endforeach()
if(NOT "avx2" IN_LIST seen OR NOT "avx512" IN_LIST seen)
  message(SEND_ERROR "no objects kernels_avx2 and kernels_avx512 in ${LIBRARY}")
endif()

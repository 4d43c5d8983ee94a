# Writes commit.h, the commit that is built, each time the benchmark is built.
cmake_minimum_required(VERSION 3.21)
# Variables: GIT, SOURCE_DIR, OUTPUT.
set(commit unknown)
if(GIT)
  execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} describe --always --dirty --abbrev=12
                  OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(described)
    set(commit ${described})
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define LIMITRAY_COMMIT \"@commit@\"\n" @ONLY)

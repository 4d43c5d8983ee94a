# Finds OpenSubdiv's CPU library and defines the target OpenSubdiv::osdCPU.
#
# OpenSubdiv ships a CMake package of its own, but Debian's names static libraries that Debian does
# not install and so stops every configuration. This module looks for the header and the library.
find_path(OpenSubdiv_INCLUDE_DIR opensubdiv/version.h)
find_library(OpenSubdiv_osdCPU_LIBRARY osdCPU)

if(OpenSubdiv_INCLUDE_DIR)
  file(STRINGS ${OpenSubdiv_INCLUDE_DIR}/opensubdiv/version.h OpenSubdiv_VERSION
       REGEX "define +OPENSUBDIV_VERSION_NUMBER +[0-9]+")
  string(REGEX MATCH "([0-9]+)([0-9][0-9])([0-9][0-9])$" OpenSubdiv_VERSION "${OpenSubdiv_VERSION}")
  math(EXPR OpenSubdiv_minor "${CMAKE_MATCH_2}")
  math(EXPR OpenSubdiv_patch "${CMAKE_MATCH_3}")
  set(OpenSubdiv_VERSION ${CMAKE_MATCH_1}.${OpenSubdiv_minor}.${OpenSubdiv_patch})
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenSubdiv
  REQUIRED_VARS OpenSubdiv_osdCPU_LIBRARY OpenSubdiv_INCLUDE_DIR
  VERSION_VAR OpenSubdiv_VERSION)

if(OpenSubdiv_FOUND AND NOT TARGET OpenSubdiv::osdCPU)
  add_library(OpenSubdiv::osdCPU UNKNOWN IMPORTED)
  set_target_properties(OpenSubdiv::osdCPU PROPERTIES
    IMPORTED_LOCATION ${OpenSubdiv_osdCPU_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${OpenSubdiv_INCLUDE_DIR})
endif()
mark_as_advanced(OpenSubdiv_INCLUDE_DIR OpenSubdiv_osdCPU_LIBRARY)

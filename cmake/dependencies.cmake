# The third-party libraries that limitray links, found the same way by this build and by the installed package.
include(CMakeFindDependencyMacro)
list(PREPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})  # FindOpenSubdiv.cmake

find_dependency(OpenSubdiv 3.4 MODULE)
find_dependency(TBB CONFIG)
find_package(embree 4 CONFIG QUIET)
if(NOT embree_FOUND)
  find_dependency(embree 3 CONFIG)
endif()

list(POP_FRONT CMAKE_MODULE_PATH)

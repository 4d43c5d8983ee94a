# What find_package(limitray) reads: its dependencies, then the target limitray::limitray.
include(${CMAKE_CURRENT_LIST_DIR}/dependencies.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/limitray-targets.cmake)

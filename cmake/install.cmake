# `cmake --install`: the library, its headers, and a package for find_package(limitray).
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/limitray)
install(TARGETS limitray EXPORT limitray COMPONENT library)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/limitray DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        COMPONENT library FILES_MATCHING PATTERN *.h)
install(EXPORT limitray NAMESPACE limitray:: DESTINATION ${package_dir} COMPONENT library
        FILE limitray-targets.cmake)
write_basic_package_version_file(limitray-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_SOURCE_DIR}/cmake/limitray-config.cmake
              ${PROJECT_SOURCE_DIR}/cmake/dependencies.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindOpenSubdiv.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/limitray-config-version.cmake
        DESTINATION ${package_dir} COMPONENT library)

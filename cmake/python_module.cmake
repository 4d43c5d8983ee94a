# The Python module limitray._core, built by scikit-build-core (see pyproject.toml).
find_package(Python 3.10 REQUIRED COMPONENTS Interpreter Development.Module)
if(NOT nanobind_DIR)
  execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
                  OUTPUT_VARIABLE nanobind_DIR OUTPUT_STRIP_TRAILING_WHITESPACE
                  COMMAND_ERROR_IS_FATAL ANY)
endif()
find_package(nanobind CONFIG REQUIRED)

file(GLOB binding_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/bindings/*.cpp)
nanobind_add_module(_core NB_STATIC NB_SUPPRESS_WARNINGS ${binding_sources})
target_link_libraries(_core PRIVATE limitray)
limitray_compile_options(_core)
install(TARGETS _core DESTINATION limitray COMPONENT python)
# The GPU tracer, compiled at run time; Slang renderers import it (limitray.gpu.slang_folder()).
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/ DESTINATION limitray/slang COMPONENT python
        FILES_MATCHING PATTERN "*.slang" PATTERN "bindings" EXCLUDE)

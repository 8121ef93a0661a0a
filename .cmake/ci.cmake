# Release with tests and benchmarks, warnings as errors: cmake -G Ninja -C .cmake/ci.cmake -B build
include(${CMAKE_CURRENT_LIST_DIR}/release.cmake)
set(TRACER_WERROR ON CACHE BOOL "")
set(TRACER_BUILD_TESTS ON CACHE BOOL "")
set(TRACER_BUILD_BENCH ON CACHE BOOL "")
# Walks of eight boxes by fewer lanes are long code: half of the build, of kernels whose speed nothing asks for.
set(TRACER_QUICK_ISAS scalar sse42 CACHE STRING "")

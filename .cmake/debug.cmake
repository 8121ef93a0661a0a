# Unoptimised build with assertions: cmake -G Ninja -C .cmake/debug.cmake -B build-debug
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O0 -g3" CACHE STRING "")
set(CMAKE_CXX_FLAGS_DEBUG "-O0 -g3" CACHE STRING "")
set(TRACER_SANITIZE none CACHE STRING "")
set(TRACER_BUILD_TESTS ON CACHE BOOL "")
set(TRACER_BUILD_BENCH ON CACHE BOOL "")

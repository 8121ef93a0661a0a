# Data races: cmake -G Ninja -C .cmake/tsan.cmake -B build-tsan
#
# Without OpenImageIO, whose thread pool is not instrumented and would be reported.
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(TRACER_SANITIZE thread CACHE STRING "")
set(TRACER_WITH_OIIO OFF CACHE BOOL "")
set(TRACER_BUILD_TESTS ON CACHE BOOL "")
set(TRACER_BUILD_BENCH ON CACHE BOOL "")

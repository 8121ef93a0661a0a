# Memory errors and undefined behaviour: cmake -G Ninja -C .cmake/asan.cmake -B build-asan
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(TRACER_SANITIZE address+undefined CACHE STRING "")
set(TRACER_BUILD_TESTS ON CACHE BOOL "")
set(TRACER_BUILD_BENCH ON CACHE BOOL "")

# Fuzzers: cmake -G Ninja -C .cmake/fuzz.cmake -B build-fuzz && cmake --build build-fuzz
#
# Then for example build-fuzz/bin/fuzz_material -max_total_time=3600 CORPUS
set(CMAKE_C_COMPILER clang-14 CACHE STRING "")
set(CMAKE_CXX_COMPILER clang++-14 CACHE STRING "")
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(TRACER_SANITIZE fuzzer CACHE STRING "")
set(TRACER_BUILD_TESTS OFF CACHE BOOL "")
set(TRACER_BUILD_BENCH OFF CACHE BOOL "")
set(TRACER_BUILD_ISAS avx2 CACHE STRING "") # beside plain C; the others double the time that it takes to build

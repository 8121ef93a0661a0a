# Optimised build: cmake -G Ninja -C .cmake/release.cmake -B build
set(CMAKE_BUILD_TYPE Release CACHE STRING "")
set(TRACER_SANITIZE none CACHE STRING "")

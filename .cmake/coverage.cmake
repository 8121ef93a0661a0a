# Counts of lines and branches: bash tests/coverage.sh
#
# Counters are atomic, since threads run through the same code; -O1, since whole renders are tests.
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g --coverage -fprofile-update=atomic" CACHE STRING "")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g --coverage -fprofile-update=atomic" CACHE STRING "")
set(TRACER_SANITIZE none CACHE STRING "")
set(TRACER_BUILD_TESTS ON CACHE BOOL "")

# The library of a package (examples/package.sh), as a toolchain file:
#
#   cmake -G Ninja --toolchain .cmake/package.cmake -DTRACER_TARGET=linux-x64 -DTRACER_SYSROOT=DIR -B build
#
# TRACER_TARGET is linux-x64, linux-arm64 or windows-x64. TRACER_SYSROOT, for Linux, is a folder with the
# headers and libraries of a system that is old enough for glibc 2.28, Blender's own baseline; the compiler
# is today's. Without it the compiler's own are taken, which do for tests (tests/cross.sh). Images come from
# Blender's libraries: nothing but the system's is linked.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TRACER_TARGET TRACER_SYSROOT)
if(TRACER_TARGET STREQUAL "windows-x64")
    set(CMAKE_SYSTEM_NAME Windows)
    set(CMAKE_SYSTEM_PROCESSOR x86_64)
    set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc-posix)
    set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
    set(CMAKE_CROSSCOMPILING_EMULATOR wine)
elseif(TRACER_TARGET MATCHES "^linux-(x64|arm64)$")
    set(CMAKE_SYSTEM_NAME Linux)
    if(CMAKE_MATCH_1 STREQUAL "x64")
        set(CMAKE_SYSTEM_PROCESSOR x86_64)
    else()
        set(CMAKE_SYSTEM_PROCESSOR aarch64)
    endif()
    set(triple ${CMAKE_SYSTEM_PROCESSOR}-linux-gnu)
    set(CMAKE_C_COMPILER ${triple}-gcc)
    if(TRACER_SYSROOT)
        set(CMAKE_SYSROOT ${TRACER_SYSROOT})
        # Debian's compilers look into folders of their own system first, whatever the sysroot.
        set(CMAKE_C_FLAGS_INIT "-include ${CMAKE_CURRENT_LIST_DIR}/glibc_2_28.h \
-isystem ${TRACER_SYSROOT}/usr/include/${triple} -isystem ${TRACER_SYSROOT}/usr/include")
        foreach(kind EXE SHARED)
            set(CMAKE_${kind}_LINKER_FLAGS_INIT "-B${TRACER_SYSROOT}/usr/lib/${triple} \
-L${TRACER_SYSROOT}/usr/lib/${triple} -L${TRACER_SYSROOT}/lib/${triple}")
        endforeach()
    elseif(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
        set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L /usr/${triple})
    endif()
else()
    message(FATAL_ERROR "TRACER_TARGET is '${TRACER_TARGET}', not linux-x64, linux-arm64 or windows-x64")
endif()
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE NEVER)
set(CMAKE_BUILD_TYPE Release CACHE STRING "")
set(TRACER_WITH_OIIO OFF CACHE BOOL "")

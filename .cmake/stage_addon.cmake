# Makes STAGE a copy of the add-on in SOURCE plus lib/libtracer.so (LIBRARY), lib/tracer_reader (READER,
# unless that is empty), lib/revision (of the sources, where git knows it) and LICENSE.
#
# Only what differs is written, and by renaming: a Blender that has the old library loaded keeps it.
# Files that left SOURCE leave STAGE too. Python's __pycache__ folders are left alone.
cmake_minimum_required(VERSION 3.25)

function(stage from to)
    if(EXISTS "${to}")
        file(SHA256 "${from}" old)
        file(SHA256 "${to}" new)
        if(old STREQUAL new)
            return()
        endif()
    endif()
    get_filename_component(folder "${to}" DIRECTORY)
    file(MAKE_DIRECTORY "${folder}")
    file(COPY_FILE "${from}" "${to}.new")
    file(RENAME "${to}.new" "${to}")
endfunction()

file(GLOB_RECURSE sources LIST_DIRECTORIES false RELATIVE "${SOURCE}" "${SOURCE}/*")
list(FILTER sources EXCLUDE REGEX "__pycache__|\\.pyc$|^lib/")
file(GLOB_RECURSE staged LIST_DIRECTORIES false RELATIVE "${STAGE}" "${STAGE}/*")
list(FILTER staged EXCLUDE REGEX "__pycache__")

foreach(name IN LISTS staged)
    if(NOT name IN_LIST sources AND NOT name STREQUAL "lib/libtracer.so"
            AND NOT name STREQUAL "lib/revision" AND NOT name STREQUAL "LICENSE" AND NOT (READER AND name STREQUAL "lib/tracer_reader"))
        file(REMOVE "${STAGE}/${name}")
    endif()
endforeach()
foreach(name IN LISTS sources)
    stage("${SOURCE}/${name}" "${STAGE}/${name}")
endforeach()
stage("${LICENSE}" "${STAGE}/LICENSE")
stage("${LIBRARY}" "${STAGE}/lib/libtracer.so")
if(READER)
    stage("${READER}" "${STAGE}/lib/tracer_reader")
endif()

execute_process(COMMAND git -C "${SOURCE}" describe --always --dirty --tags
    OUTPUT_VARIABLE revision OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(revision)
    file(CONFIGURE OUTPUT "${STAGE}/lib/revision" CONTENT "${revision}\n")
else()
    file(REMOVE "${STAGE}/lib/revision")
endif()

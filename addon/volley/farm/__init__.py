# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders of farms: parts of the samples of a frame, merged exactly, by a command line that says how it
went. Scheduling is the farm's.

    job       what the command line asks of the engine, and what it learns of it
    content   what the library was handed, and digests of it
    files     what a frame reads, and digests of it
    parts     a part of a frame as an OpenEXR file: its sums, and what it was made of
    merge     parts of a frame put together
    exr       OpenEXR files
    command   the command line
    operator  merging in Blender's window
"""

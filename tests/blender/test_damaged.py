# SPDX-License-Identifier: Apache-2.0
"""Damaged images of every format in one Blender: a short run of tests/damaged.py."""

import os

import damaged

FILES, SEED, SIDE = 200, 3, 8
LARGEST_MIB = 1024  # of a process that reads: files of kilobytes, of which some claim to be huge


def test_pictures_with_damaged_images(blender):
    result = damaged.run(blender, FILES, SEED, SIDE)
    assert not result.problems
    assert result.missing > FILES // 4 and result.shown > FILES // 4
    if os.path.isdir("/proc/self"):  # where processes can be looked at
        assert result.memory["tracer_reader"] < LARGEST_MIB

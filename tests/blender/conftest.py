# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that run inside Blender."""

import os
import sys

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "support"))
import blender as blender_support  # noqa: E402  (found by the line above)


@pytest.fixture
def blender(tmp_path):
    """A Blender to run functions in; skips where there is no Blender."""
    if blender_support.executable() is None:
        pytest.skip("no Blender found")
    return blender_support.Blender(str(tmp_path))

# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that run inside Blender."""

import os
import sys
import tempfile

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "support"))
import blender as blender_support  # noqa: E402  (found by the line above)


@pytest.fixture(scope="session", autouse=True)
def _temporary_files():
    """What Blenders leave in the folder of temporary files goes when the tests end."""
    with tempfile.TemporaryDirectory(prefix="volley_") as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        yield


def _blender(folder):
    if blender_support.executable() is None:
        pytest.skip("no Blender found")
    return blender_support.Blender(str(folder))


@pytest.fixture
def blender(tmp_path):
    """A Blender to run functions in; skips where there is no Blender."""
    return _blender(tmp_path)


@pytest.fixture(scope="module")
def blender_of_module(tmp_path_factory):
    """The same for fixtures whose results several tests look at."""
    return _blender(tmp_path_factory.mktemp("blender"))

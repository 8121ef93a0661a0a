# SPDX-License-Identifier: Apache-2.0
"""The example character through the command line of both engines, against many samples of Cycles."""

import json
import os
import pathlib
import subprocess
import sys

import pytest

PROJECT = pathlib.Path(__file__).resolve().parents[2]
COMPARE = PROJECT / "tests" / "bench" / "compare_cycles.py"
SAMPLES, REPEATS = 64, 3
MEAN_TOLERANCE = 0.01


@pytest.fixture(scope="module")
def report(blender_of_module, tmp_path_factory):
    """The report of compare_cycles.py: small pictures, and a reference of 4096 samples."""
    command = [sys.executable, str(COMPARE), "--scene", "example", "--width", "96", "--height", "54",
               "--samples", str(SAMPLES), "--repeats", str(REPEATS), "--json",
               "--build", os.environ.get("VOLLEY_BUILD", str(PROJECT / "build")),
               "--out", str(tmp_path_factory.mktemp("example"))]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_means_are_those_of_cycles(report):
    for ratio in report["engines"]["VOLLEY"]["mean_ratios"]:
        assert ratio == pytest.approx(1.0, abs=MEAN_TOLERANCE)


def test_error_is_no_larger_than_that_of_cycles(report):
    assert report["ratios"]["mse"] <= 1.0, report["engines"]


def test_no_tile_is_biased(report):
    assert report["bias"]["failed"] == 0, report["bias"]


def test_every_pixel_is_finite(report):
    assert report["engines"]["VOLLEY"]["non_finite_pixels"] == 0

# SPDX-License-Identifier: Apache-2.0
"""The example of the public ray queries against what a square roof covers of the sky."""

import math
import os
import subprocess

import pytest

PROGRAM = os.path.join(os.environ.get("VOLLEY_BUILD", "build"), "bin", "ambient_occlusion")
ERROR = 0.01  # of 256 rays


def _roof_share(side, height):
    """The part of the hemisphere over a point, by the cosine, that a square has whose middle is straight above:
    four times the form factor of a rectangle over its corner."""
    x = 0.5 * side / height
    return 4.0 / math.pi * x / math.hypot(1.0, x) * math.atan(x / math.hypot(1.0, x))


def _run(folder, model, *more):
    (folder / "in.obj").write_text(model)
    return subprocess.run([PROGRAM, str(folder / "in.obj"), str(folder / "out.obj"), *more], text=True,
                          stderr=subprocess.PIPE, check=False)


def _greys(folder):
    lines = (folder / "out.obj").read_text().splitlines()
    return [float(line.split()[4]) for line in lines if line.startswith("v ")]


@pytest.mark.parametrize("side, height", [(1.0, 1.0), (4.0, 1.0), (1.0, 0.25)])
def test_below_a_roof(tmp_path, side, height):
    half = 0.5 * side
    model = ("v 0 0 0\nv 0.001 0 0\nv 0 0.001 0\nf 1 2 3\n"
             f"v {-half} {-half} {height}\nv {half} {-half} {height}\nv {half} {half} {height}\n"
             f"v {-half} {half} {height}\nf 4/1 5/1 6/1 -1\n")
    assert _run(tmp_path, model, "10").returncode == 0
    greys = _greys(tmp_path)
    assert greys[0] == pytest.approx(1.0 - _roof_share(side, height), abs=ERROR)
    assert greys[3:] == [1.0] * 4  # the roof faces away from the floor
    assert _run(tmp_path, model, str(0.5 * height)).returncode == 0
    assert _greys(tmp_path) == [1.0] * 7


def test_bad_input(tmp_path):
    ran = _run(tmp_path, "v 0 0 0\nf 1 2 3\n")
    assert ran.returncode == 1 and "index" in ran.stderr
    assert _run(tmp_path, "v 0 0 0\n", "-1").returncode == 1
    assert not (tmp_path / "out.obj").exists()

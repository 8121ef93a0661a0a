# SPDX-License-Identifier: Apache-2.0
"""Tests of frame_bench: what it counts is what it renders. No times."""

import os
import pathlib
import subprocess
import sys

import pytest

TESTS = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "bench")]
from reporting import frames, programs  # noqa: E402  (the folders are on the path only now)

FRAME_BENCH = pathlib.Path(os.environ.get("VOLLEY_BUILD", TESTS.parent / "build")) / "bin/frame_bench"
pytestmark = pytest.mark.skipif(not FRAME_BENCH.exists(), reason="frame_bench is not built")

SMALL = {"scene": "tiny", "width": 32, "height": 32}


def run(*specs):
    return programs.run_json([FRAME_BENCH, "--repeats", 1, *specs])


@pytest.mark.parametrize("settings", [
    {"integrator": "raycast", "surface": "diffuse"},
    {"integrator": "whitted"},
    {"integrator": "whitted", "assembly": "runs", "max_depth": 3},
    {"integrator": "distribution", "samples": 4, **frames.REASONABLE},
], ids=lambda settings: frames.spec(**settings))
def test_counted_frames_trace_the_rays_of_rendered_ones(settings):
    rendered, counted = run(frames.spec(**SMALL, **settings), frames.spec(**SMALL, **settings, counts=1))
    assert {kind: counted[kind]["rays"] for kind in rendered["rays"]} == rendered["rays"]
    for kind, rays in rendered["rays"].items():
        if rays:
            boxes, triangles = frames.tests_per_ray(counted[kind])
            assert boxes > 0.0 and triangles > 0.0
        else:
            assert frames.tests_per_ray(counted[kind]) is None


def test_effects_trace_the_rays_that_they_are_made_of():
    base = {**SMALL, "samples": 4, "surface": "diffuse"}
    raycast, nothing, split, mirrors = run(
        frames.spec(integrator="raycast", **base), frames.spec(integrator="distribution", **base),
        frames.spec(integrator="distribution", light_samples=4, light_size=1.0, **base),
        frames.spec(integrator="distribution", **{**base, "surface": "mirror"}))
    assert nothing["rays"] == raycast["rays"]
    assert split["rays"]["shadow"] > 3.0 * nothing["rays"]["shadow"]
    assert mirrors["rays"]["reflection"] > 0 and mirrors["rays"]["refraction"] == 0


@pytest.mark.parametrize("wanted", [1024, 30000, 200000])
def test_balls_have_about_as_many_triangles_as_asked_for(wanted):
    (row,) = run(frames.spec(scene="balls", triangles=wanted, width=8, height=8, eyes=1))
    assert row["triangles"] == pytest.approx(wanted, rel=0.35)


def test_instances_and_lights_are_there():
    (row,) = run(frames.spec(scene="balls", instances=100, lights=9, width=16, height=16, eyes=1))
    assert row["triangles"] == 100 * 960


def test_a_higher_limit_of_bounces_only_adds_rays():
    rows = run(*(frames.spec(**SMALL, **frames.MIRRORS, counts=1, max_depth=depth)
                 for depth in (0, 1, 2)))
    rays = [row["reflection"]["rays"] for row in rows]
    assert 0 < rays[0] < rays[1] < rays[2]


@pytest.mark.parametrize("line", ["colour=red", "samples=0", "samples=many", "aperture=-1", "scene"])
def test_a_line_that_makes_no_sense_is_refused(line):
    done = subprocess.run([FRAME_BENCH, line], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "frame_bench:" in done.stderr

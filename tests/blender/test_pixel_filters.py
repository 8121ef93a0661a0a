# SPDX-License-Identifier: Apache-2.0
"""Pixel filters beside Cycles': how an edge between black and white is spread over pixels."""

import numpy as np
import pytest

SAMPLES = 1024
# Cycles' box is one pixel wide, whatever its width.
CASES = [('BOX', 1.0), ('GAUSSIAN', 1.0), ('GAUSSIAN', 2.5), ('BLACKMAN_HARRIS', 1.0),
         ('BLACKMAN_HARRIS', 1.5), ('BLACKMAN_HARRIS', 4.0)]


def inside_filters(cases):
    """{case: (picture by Volley, picture by Cycles)} of a shining wall with an upright edge."""
    import scenes
    scene = scenes.empty(size=(16, 32), samples=SAMPLES)
    scenes.camera(type='ORTHO', ortho_scale=32.0)
    scenes.wall(size=64.0, center=(32.2, 0.0), material=scenes.emitter((1.0, 1.0, 1.0)))
    pictures = {}
    for name, width in cases:
        for settings in (scene.volley, scene.cycles):
            settings.pixel_filter_type, settings.filter_width = name, width
        pictures[name, width] = [picture[..., 0] for picture in scenes.by_both(SAMPLES)]
    return pictures


@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return blender_of_module.run(inside_filters, CASES)


@pytest.mark.parametrize("case", CASES)
def test_edge(pictures, case):
    ours, theirs = (picture.mean(axis=0) for picture in pictures[case])
    assert theirs[0] == 0.0 and theirs[-1] == pytest.approx(1.0)
    assert 0.05 < theirs[7] < 0.95 or 0.05 < theirs[8] < 0.95, "the edge is not in the middle"
    # Noise of 32 rows of 1,024 samples; Cycles' table of the filter has steps of a hundredth pixel.
    np.testing.assert_allclose(ours, theirs, atol=5e-3)

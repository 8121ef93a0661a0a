# SPDX-License-Identifier: Apache-2.0
"""How many transparent surfaces paths and shadow rays pass, beside Cycles."""

import numpy as np
import pytest

LIMITS = range(5)
PANES = range(4)
SAMPLES = 128  # of which some choose a light that shines elsewhere
CELL_PX = 8  # of a pair: panes that the camera sees through, and panes in the sun's way


def _panes(scenes, clear, count, corner, size, sees):
    """Panes above each other that only one kind of ray meets."""
    x, z = corner
    for number in range(count):
        y = -0.1 * number
        pane = scenes.mesh("Pane", [(x, y, z), (x + size[0], y, z), (x + size[0], y, z + size[1]), (x, y, z + size[1])],
                           [(0, 1, 2, 3)], clear)
        for rays in {"visible_camera", "visible_shadow"} - {sees}:
            setattr(pane, rays, False)


def inside_grid():
    """{limit: both} of a wall behind panes: columns of those that the camera sees through, rows of those between the
    sun and the wall, and above a row that shines itself."""
    import math
    import bpy
    import scenes
    scenes.empty(size=(CELL_PX * len(PANES), CELL_PX * (len(PANES) + 1)))
    scenes.camera(type='ORTHO', ortho_scale=len(PANES) + 1.0)
    scenes.sharpen()
    left, bottom = -0.5 * len(PANES), -0.5 * (len(PANES) + 1)
    clear = scenes.material("Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.6, 0.7))
    scenes.wall("Wall", 4.0, 1.0, center=(0.0, bottom + 2.0), material=scenes.material("Matt", "ShaderNodeBsdfDiffuse"))
    scenes.wall("Light", 4.0, 2.0, center=(0.0, -bottom + 1.0), material=scenes.emitter((0.5, 0.4, 0.3)))
    for count in PANES:
        _panes(scenes, clear, count, (left + count, bottom), (1.0, 5.0), "visible_camera")
        _panes(scenes, clear, count, (left, bottom + count), (4.0, 1.0), "visible_shadow")
    scenes.light('SUN', rotation=(math.pi / 2, 0.0, 0.0), energy=2.0, angle=0.0)
    found = {}
    for limit in LIMITS:
        bpy.context.scene.volley.max_transparent_depth = limit
        cycles = {"transparent_max_bounces": limit}
        found[limit] = [[scenes.render() for _ in scenes.each_seed(engine, SAMPLES, (1,), cycles)][0]
                        for engine in ('VOLLEY', 'CYCLES')]
    return found


def _cells(picture):
    """The mean colour in the middle of each cell."""
    cells = picture[..., :3].reshape(len(PANES) + 1, CELL_PX, len(PANES), CELL_PX, 3)
    return cells[:, 2:-2, :, 2:-2].mean(axis=(1, 3))


def test_transparent_surfaces_are_counted_as_by_cycles(blender):
    """With a limit of paths and shadow rays alike cells were .1 to .5 brighter than in Cycles 5.2."""
    for limit, pictures in blender.run(inside_grid).items():
        ours, theirs = map(_cells, pictures)
        assert ours == pytest.approx(theirs, abs=0.02), limit
        assert np.ptp(theirs) > 0.3

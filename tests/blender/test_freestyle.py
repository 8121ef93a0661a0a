# SPDX-License-Identifier: Apache-2.0
"""Freestyle's lines beside Cycles: Blender has the engine render them as a scene of their own."""

import compare

SAMPLES = 64


def inside_lines():
    """The pass of half-clear lines around a ball and a wall by both: two arrays (seeds, height, width, 4)."""
    import scenes
    scene = scenes.empty(size=(64, 48))
    scenes.camera()
    scenes.sphere(location=(-0.7, 0.0, 0.0))
    scenes.wall(size=1.6, y=0.5, center=(0.6, 0.4))
    scene.render.use_freestyle = True
    scene.render.line_thickness = 4.0
    settings = scene.view_layers[0].freestyle_settings
    settings.as_render_pass = True
    lines = settings.linesets[0] if settings.linesets else settings.linesets.new("Lines")
    if lines.linestyle is None:
        lines.linestyle = scenes.bpy.data.linestyles.new("Lines")
    lines.linestyle.color, lines.linestyle.alpha = (0.1, 0.2, 0.9), 0.7
    return scenes.passes_by_both(["Freestyle"], SAMPLES)["Freestyle"]


def test_lines(blender):
    """They were Eevee's, which needs a graphics card: half-clear ones were dotted, and 3 % of them missing."""
    ours, theirs = blender.run(inside_lines)
    assert theirs.mean() > 0.02
    mean, tile = compare.unexplained(ours, theirs)
    assert mean < 0.001 * theirs.mean() and tile < 0.01

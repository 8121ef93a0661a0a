# SPDX-License-Identifier: Apache-2.0
"""Movies and sequences as textures follow the frame, by each node's settings: beside Cycles in renders of single
frames and of an animation, in viewports and in a window."""

import os
import tempfile

import numpy as np
import pytest

COUNT = 5        # frames of the movie
TOLERANCE = 1e-3
SHOWN_TOLERANCE = 0.05  # of what a window shows of a compressed movie
LONGEST_DRAWS = 60      # until a window must show a frame, on a busy machine too
COLORS = ((0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8), (0.7, 0.7, 0.1), (0.4, 0.4, 0.4))

# Settings of image users, a wall for each.
USERS = ({}, {"frame_start": 3}, {"frame_offset": 2}, {"frame_duration": 3}, {"use_cyclic": True, "frame_start": 2},
         {"frame_offset": -2}, {"use_cyclic": True, "frame_duration": 2, "frame_offset": 1},
         {"use_auto_refresh": False})


def _write(kind):
    """Write frames of one colour each as a movie, or as a sequence of pictures with one of number 0 before them: the
    path of the first."""
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 32), samples=1)
    scenes.camera()
    scenes.wall("Screen", 9.0, 0.0, material=scenes.emitter(COLORS[0]))
    tree = bpy.data.materials[0].node_tree
    color = tree.nodes["Emission"].inputs["Color"]
    for number, value in enumerate(COLORS):
        color.default_value = (*value, 1.0)
        color.keyframe_insert("default_value", frame=number + 1)
    for curve in scenes.curves(tree):
        for key in curve.keyframe_points:
            key.interpolation = 'CONSTANT'
    settings, scene.frame_start, scene.frame_end = scene.render.image_settings, int(kind == 'MOVIE'), COUNT
    scene.view_settings.view_transform = 'Standard'
    scenes.set_file_format(settings, 'FFMPEG' if kind == 'MOVIE' else 'PNG')
    if kind == 'MOVIE':
        scene.render.ffmpeg.format, scene.render.ffmpeg.codec = 'MPEG4', 'H264'
    scene.render.filepath = os.path.join(tempfile.mkdtemp(prefix="volley_"), kind.lower())
    bpy.ops.render.render(animation=True)
    return scene.render.frame_path(frame=1)


def _stage(kind):
    """A row of walls that show it, each by settings of its own."""
    import bpy
    import scenes
    path = _write(kind)
    scene = scenes.empty(size=(8 * len(USERS), 8), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=float(len(USERS)))
    scenes.sharpen()
    image = bpy.data.images.load(path)
    image.source = kind
    for number, settings in enumerate(USERS):
        material = scenes.material(f"Screen {number}", "ShaderNodeEmission")
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        values = {"frame_duration": COUNT, "frame_start": 1, "use_auto_refresh": True, **settings}
        for name, value in values.items():
            setattr(node.image_user, name, value)
        tree.links.new(node.outputs[0], tree.nodes["Emission"].inputs["Color"])
        scenes.wall(f"Screen {number}", 0.98, 0.0, (number - 0.5 * len(USERS) + 0.5, 0.0), material)
    return scene


def _colors(picture):
    """Of the middle of each wall."""
    return picture[4, 4::8, :3]


def inside_frames(kind):
    """{frame: colours of the walls by Volley and by Cycles, and the warnings}."""
    import scenes
    import volley.session
    scene, told = _stage(kind), []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    found = {}
    for frame in range(-1, 9):
        scene.frame_set(frame)
        found[frame] = [_colors(picture) for picture in scenes.by_both(1)]
    return found, told


@pytest.mark.parametrize("kind", ['MOVIE', 'SEQUENCE'])
def test_frames(blender, kind):
    """Before frame 0 of a sequence its pictures were missing, where Cycles stays at that of frame 0."""
    found, told = blender.run(inside_frames, kind)
    # A sequence has no pictures beyond its end, where movies stay.
    missing = ["sequence0006.png", "sequence0007.png"]
    expected = [f"Image 'sequence0001.png': {name} is missing, magenta is used" for name in missing]
    assert sorted(set(told)) == (expected if kind == 'SEQUENCE' else [])
    for frame, (ours, theirs) in found.items():
        assert np.abs(ours - theirs).max() < TOLERANCE, frame
    shown = [found[frame][0][0] for frame in range(1, COUNT + 1)]
    assert all(np.abs(color - expected).max() < 0.03 for color, expected in zip(shown, COLORS))  # lossy


def inside_animation(is_persistent):
    """Colours of the walls in each frame of an animation."""
    import bpy
    import scenes
    scene = _stage('MOVIE')
    scene.render.use_persistent_data = is_persistent
    scene.frame_start, scene.frame_end = 1, COUNT
    scene.render.filepath = os.path.join(tempfile.mkdtemp(prefix="volley_"), "shown")
    bpy.ops.render.render(animation=True)
    return [_colors(scenes.load(scene.render.frame_path(frame=frame))) for frame in range(1, COUNT + 1)]


@pytest.mark.parametrize("is_persistent", [False, True])
def test_animation(blender, is_persistent):
    for colors, expected in zip(blender.run(inside_animation, is_persistent), COLORS, strict=True):
        assert np.abs(colors[0] - expected).max() < 0.03


def inside_viewport():
    """Colours of the walls in a viewport: frames are changed where nothing is animated, and where a wall moves."""
    from follower import Follower
    scene = _stage('MOVIE')
    follower, found = Follower(), []
    for frame in (1, 2, 4):
        scene.frame_set(frame)
        found.append(_colors(follower.picture()))
    import bpy
    wall = bpy.data.objects["Screen 7"]
    for frame, x in ((1, 3.5), (5, 3.51)):
        wall.location.x = x - 3.5
        wall.keyframe_insert("location", frame=frame)
    for frame in (3, 5):
        scene.frame_set(frame)
        found.append(_colors(follower.picture()))
    return found


def test_viewport(blender):
    for colors, frame in zip(blender.run(inside_viewport), (1, 2, 4, 3, 5), strict=True):
        assert np.abs(colors[0] - COLORS[frame - 1]).max() < 0.03, frame


def inside_window():
    """Colours in the middle of a window's view of a wall that shows the movie, at two frames."""
    import bpy
    import screen
    import scenes
    import whole_files
    yield 0.1
    scene = _stage('MOVIE')
    scenes.wall("Front", 30.0, -1.0, material=bpy.data.materials["Screen 0"])
    bpy.context.preferences.view.show_splash = False
    scene.view_settings.view_transform, scene.render.dither_intensity = 'Raw', 0.0
    area, space = whole_files.view()
    space.overlay.show_overlays = space.show_gizmo = False
    space.region_3d.view_perspective = 'CAMERA'
    scenes.set_engine('VOLLEY', 1)
    scene.volley.preview_samples = 1
    space.shading.type = 'RENDERED'
    region = next(region for region in area.regions if region.type == 'WINDOW')
    found = []
    for frame in (2, 3):
        scene.frame_set(frame)
        for _ in range(LONGEST_DRAWS):
            yield 0.5
            found.append(screen.Screen().picture()[region.y + region.height // 2, region.x + region.width // 2])
            if np.abs(found[-1] - COLORS[frame - 1]).max() < SHOWN_TOLERANCE:
                break
    return found[-1]


def test_window(window):
    assert np.abs(window.run_in_window(inside_window) - COLORS[2]).max() < SHOWN_TOLERANCE
    assert not window.complaints()

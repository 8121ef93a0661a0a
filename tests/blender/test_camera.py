# SPDX-License-Identifier: Apache-2.0
"""Camera windows against Blender's own projection matrices, borders, depth of field."""

import itertools

import blender as blender_support
import compare
import numpy as np
import pytest


def inside_windows():
    import bpy
    import scenes
    from volley.log import Warnings
    from volley.sync import camera
    scenes.empty()
    scene, made = bpy.context.scene, scenes.camera(clip_start=0.2, clip_end=50.0)
    data, worst, count = made.data, 0.0, 0
    data.lens, data.sensor_width, data.sensor_height = 35.0, 32.0, 18.0
    data.ortho_scale = 3.5
    cases = itertools.product(('PERSP', 'ORTHO'), ('AUTO', 'HORIZONTAL', 'VERTICAL'),
                              ((0.0, 0.0), (0.25, -0.4)), ((640, 360), (270, 480)),
                              ((1.0, 1.0), (2.0, 1.0), (1.0, 1.5)))
    for kind, fit, shift, size, aspect in cases:
        data.type, data.sensor_fit, (data.shift_x, data.shift_y) = kind, fit, shift
        render = scene.render
        render.resolution_x, render.resolution_y = size
        render.pixel_aspect_x, render.pixel_aspect_y = aspect
        depsgraph = bpy.context.evaluated_depsgraph_get()
        evaluated = made.evaluated_get(depsgraph)
        lens = camera.lens_of(evaluated, Warnings())
        window = camera.window(lens, camera.frame_of(render))
        matrix = evaluated.calc_matrix_camera(depsgraph, x=size[0], y=size[1], scale_x=aspect[0],
                                              scale_y=aspect[1])
        expected = []
        for axis in (0, 1):
            half = 1.0 / matrix[axis][axis]
            center = -matrix[axis][3] * half if kind == 'ORTHO' else matrix[axis][2] * half
            expected += [center - half, center + half]
        worst = max(worst, *(abs(a - b) for a, b in zip(window, expected)))
        count += 1
    return worst, count


def test_windows_are_blenders(blender):
    worst, count = blender.run(inside_windows)
    assert count == 72
    assert worst < 1e-5


def inside_border(percentage, border):
    """The size Blender makes of a border, and the add-on's own reckoning."""
    import bpy
    import scenes
    from volley.sync import camera
    scenes.empty(size=(101, 53))
    scenes.camera()
    scenes.wall(material=scenes.emitter((1.0, 1.0, 1.0)))
    render = bpy.context.scene.render
    render.resolution_percentage = percentage
    render.use_border = True
    (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y) = border
    seen = []

    class Probe(bpy.types.RenderEngine):
        bl_idname, bl_label = 'PROBE', "Probe"

        def render(self, depsgraph):
            result = self.get_result()
            seen.append((result.resolution_x, result.resolution_y))

    bpy.utils.register_class(Probe)
    render.engine = 'PROBE'
    bpy.ops.render.render()
    return seen[0], camera.crop_of(render, camera.frame_of(render))


@pytest.mark.parametrize("percentage, border", [
    (100, (0.25, 0.61, 0.1, 0.77)), (50, (0.25, 0.61, 0.1, 0.77)), (33, (0.1, 0.9, 0.3, 0.83))])
def test_border_has_blenders_size(blender, percentage, border):
    size, crop = blender.run(inside_border, percentage, border)
    assert crop[2:] == size


def inside_depth_of_field():
    import bpy
    import scenes
    from dataclasses import asdict
    from mathutils import Vector
    from volley.log import Warnings
    from volley.sync import camera
    scenes.empty()
    made = scenes.camera(location=(1.0, -6.0, 2.0), lens=80.0)
    dof = made.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 2.0, 3.0
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 5, 0.3, 1.5

    def lens():
        evaluated = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return camera.lens_of(evaluated, Warnings())

    plain = lens()
    target = scenes.link("Target", None)
    target.location = Vector((4.0, 3.0, -1.0))
    dof.focus_object = target
    bpy.context.view_layer.update()
    aimed = lens()
    made.data.type = 'ORTHO'
    ortho = lens()
    dof.use_dof = False
    return asdict(plain), aimed.focus_distance, ortho.aperture_radius, lens().aperture_radius


def test_depth_of_field(blender):
    plain, aimed, ortho_radius, off = blender.run(inside_depth_of_field)
    assert plain["aperture_radius"] == pytest.approx(0.080 / 4.0)
    assert plain["focus_distance"] == pytest.approx(3.0)
    assert plain["blade_count"] == 5
    assert plain["blade_rotation"] == pytest.approx(0.3)
    assert plain["aperture_ratio"] == pytest.approx(1.5)
    assert aimed == pytest.approx(9.0, abs=1e-4)  # along the axis, not to the point
    assert ortho_radius == pytest.approx(0.25)
    assert off == 0.0


def inside_clipped_blur():
    """Means by Volley and by Cycles through a wide lens of a red wall before the start of clipping, and a green one
    about its end, which only rays from the rim of the lens reach or miss."""
    import scenes
    scenes.empty(size=(32, 32))
    made = scenes.camera(location=(0.0, 0.0, 0.0), lens=35.0, clip_start=0.1, clip_end=2.0)
    made.data.dof.use_dof, made.data.dof.aperture_fstop, made.data.dof.focus_distance = True, 0.1, 0.3
    for name, y, color in (("Near", 0.094, (1.0, 0.0, 0.0)), ("Far", 1.8, (0.0, 1.0, 0.0))):
        scenes.wall(name, size=20.0, y=y, material=scenes.emitter(color, name=name))
    return [picture[..., :3].mean(axis=(0, 1)) for picture in scenes.by_both(1024)]


def test_blur_is_clipped_as_in_cycles(blender):
    ours, theirs = blender.run(inside_clipped_blur)
    assert 0.1 < theirs[0] < 0.9 and 0.1 < theirs[1] < 0.9
    assert ours == pytest.approx(theirs, abs=0.01)


# Regions of viewports ------------------------------------------------------------------------------

def inside_regions():
    """Render regions of views through a camera that show a part of its frame, and of the free view: the
    edges by the add-on, the same by shares of the frame, the size of the view; then (edges, divisor, edges
    of the picture with fewer pixels)."""
    from types import SimpleNamespace
    from volley import viewport
    regions, divided = [], []
    for size in ((640, 360), (300, 500)):
        for frame in (None, (-1.0, 1.0, -0.5, 0.5), (-3.0, 2.0, -2.0, 4.0)):
            for border in ((0.2, 0.7, 0.1, 0.95), (0.05, 0.3, 0.6, 1.0)):
                names = ("min_x", "max_x", "min_y", "max_y")
                render = SimpleNamespace(use_border=True, **{f"border_{n}": b for n, b in zip(names, border)})
                view = SimpleNamespace(use_render_border=True, **{
                    f"render_border_{n}": b for n, b in zip(names, border)})
                keys = SimpleNamespace(frame_window=frame, windows=[(-1.5, 1.0, -1.0, 1.0)])
                x, y, width, height = viewport._crop_of(keys, view, render, size)
                edges, expected = (x, x + width, y, y + height), []
                for axis, (low, high) in enumerate(((-1.5, 1.0), (-1.0, 1.0))):
                    begin, end = (low, high) if frame is None else frame[2 * axis:2 * axis + 2]
                    for share in border[2 * axis:2 * axis + 2]:
                        place = (begin + share * (end - begin) - low) / (high - low)
                        expected.append(min(max(place, 0.0), 1.0) * size[axis])
                regions.append((edges, expected, size))
                for divisor in (1, 2, 3, 8):
                    fields = viewport.divided({"width": size[0], "height": size[1], "crop_x": x, "crop_y": y,
                                               "crop_width": width, "crop_height": height}, divisor)
                    x0, y0 = fields["crop_x"], fields["crop_y"]
                    divided.append((edges, divisor, (x0, x0 + fields["crop_width"], y0,
                                                     y0 + fields["crop_height"])))
    return regions, divided


def test_regions_of_views(blender):
    regions, divided = blender.run(inside_regions)
    for edges, expected, size in regions:
        assert 0 <= edges[0] < edges[1] <= size[0] and 0 <= edges[2] < edges[3] <= size[1]
        assert np.abs(np.subtract(edges, expected)).max() <= 1.0, (edges, expected)
    for edges, divisor, small in divided:
        assert np.abs(np.array(edges) / divisor - small).max() <= 2.0, (edges, divisor, small)


# A lens that zooms ---------------------------------------------------------------------------------

def inside_zoom():
    """A wall's edge while the focal length is animated: means of columns, with and without motion blur."""
    import scenes
    scene = scenes.empty(size=(64, 8), samples=256)
    made = scenes.camera()
    scenes.wall(size=20.0, center=(11.2, 0.0), material=scenes.emitter((1.0, 1.0, 1.0)))  # from x = 1.2 m on
    made.data.driver_add("lens").driver.expression = "20 + 30 * frame"
    scene.frame_set(1)
    scenes.sharpen()
    scene.render.motion_blur_shutter = 1.0
    pictures = []
    for scene.render.use_motion_blur in (False, True):
        pictures.append(scenes.render()[..., 0].mean(axis=0))
    return [picture.tolist() for picture in pictures]


def test_zooms_blur(blender):
    still, blurred = (np.array(each) for each in blender.run(inside_zoom))
    background = still.min()  # from 5.0 on worlds are not black by default
    still, blurred = (still - background) / (1.0 - background), (blurred - background) / (1.0 - background)
    edges = (np.arange(64) + 0.5) / 32.0 - 1.0  # of the frame's half width
    assert set(np.round(still, 3)) == {0.0, 1.0}
    # The frame of a lens is 36 mm wide; it is wide as the keys of the shutter say, in line between them.
    times = np.linspace(0.0, 1.0, 2001)
    half = np.interp(times, (0.0, 0.5, 1.0), 18.0 / np.array((35.0, 50.0, 65.0)))
    expected = [(0.2 / half < edge).mean() for edge in edges]
    assert sum(0.02 < each < 0.98 for each in expected) >= 5
    # 256 samples of a pixel: five times the deviation of a half at most.
    assert np.abs(blurred - expected).max() < 5.0 * 0.5 / np.sqrt(256 * 8)


def inside_changing(kind, name, values):
    """A checkered wall through a camera of a kind whose property of that name changes, by both engines."""
    import scenes
    scene = scenes.empty(size=(48, 32))
    scenes.wall(size=6.0, material=scenes.material("Checks", "ShaderNodeTexChecker", Scale=3.0))
    made = scenes.camera(type=kind)
    for frame, value in zip((1, 3), values):
        setattr(made.data, name, value)
        made.data.keyframe_insert(name, frame=frame)
    scenes.set_shutter(scene, length=1.0)
    scene.frame_set(2)
    return scenes.seeds_by_both(64 * len(scenes.SEEDS))


@pytest.mark.parametrize("change", (
    ('PERSP', "shift_x", (0.0, 0.4)), ('PERSP', "lens", (40.0, 90.0)), ('ORTHO', "ortho_scale", (3.0, 9.0))), ids=str)
def test_lenses_blur_as_in_cycles(blender, change):
    """Shift and orthographic scale of the shutter's middle count for all of it: in motion they were 2.7 and 6 % of the
    mean off."""
    ours, theirs = blender.run(inside_changing, *change)
    scale = theirs[..., :3].mean()
    beyond, tile = compare.unexplained(ours[..., :3], theirs[..., :3])
    assert beyond < 0.005 * scale and tile < 0.02 * scale


# Cuts to another camera ----------------------------------------------------------------------------

def inside_cuts(position):
    """Frames of a checkered wall around a marker that switches to a camera farther away, while all cameras turn: of
    Volley and of Cycles, with the shutter open for a frame that is so much before or after."""
    import scenes
    scene = scenes.empty(size=(48, 32))
    scenes.wall(size=6.0, material=scenes.material("Checks", "ShaderNodeTexChecker", Scale=3.0))
    for frame, y in ((1, -6.0), (2, -12.0), (3, -6.0)):
        made = scenes.camera(location=(0.0, y, 0.0))
        for when, angle in ((1, -0.2), (3, 0.2)):
            made.rotation_euler.z = angle
            made.keyframe_insert("rotation_euler", frame=when)
        scene.timeline_markers.new("Cut", frame=frame).camera = made
    scenes.set_shutter(scene, position, 1.0)
    pictures = []
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        pictures.append(scenes.seeds_by_both(64 * len(scenes.SEEDS)))
    return pictures


@pytest.mark.parametrize("position", ('START', 'CENTER', 'END'))
def test_cuts_count_from_frame_to_frame(blender, position):
    """Shutters that looked through both cameras were off by 6 to 33 % of the mean."""
    for ours, theirs in blender.run(inside_cuts, position):
        scale = theirs[..., :3].mean()
        beyond, tile = compare.unexplained(ours[..., :3], theirs[..., :3])
        assert beyond < 0.005 * scale and tile < 0.02 * scale


def inside_orthographic_focus(clip_start):
    """Walls behind each other before an orthographic camera that focuses between them, by both."""
    import scenes
    scenes.empty(size=(48, 36))
    data = scenes.camera().data
    data.type, data.ortho_scale, data.clip_start = 'ORTHO', 6.0, clip_start
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 4.0, 0.6
    scenes.wall("Red", 1.5, 0.0, (-1.2, 0.0), scenes.emitter((1.0, 0.1, 0.05), "Red"))
    scenes.wall("Green", 1.5, 2.0, (1.2, 0.5), scenes.emitter((0.1, 0.8, 0.2), "Green"))
    scenes.wall("Blue", 2.5, 5.0, (0.5, -0.6), scenes.emitter((0.05, 0.2, 0.9), "Blue"))
    return scenes.seeds_by_both(256)


@pytest.mark.parametrize("clip_start", (0.1, 3.0))
def test_orthographic_focus(blender, clip_start):
    """In 3.4 it is from where clipping starts: from the camera on a tile was 2 % of the mean off for .1 m, the mean 6 %
    and a tile 1.7 times it for 3 m."""
    ours, theirs = (seeds[..., :3] for seeds in blender.run(inside_orthographic_focus, clip_start))
    errors = np.array(compare.unexplained(ours, theirs)) / theirs.mean()
    assert (errors <= (0.002, 0.01)).all(), errors


# A camera that its parent shears -------------------------------------------------------------------

def _sheared_camera():
    """Walls before a camera that is turned under a parent of uneven scale."""
    import math
    import bpy
    import scenes
    scene = scenes.empty(size=(72, 48))
    made = scenes.camera(location=(0.0, 0.0, 0.0), rotation=(math.pi / 2 - 0.3, 0.2, -0.4))
    parent = scenes.link("Parent", None)
    parent.location, parent.rotation_euler = (0.0, -6.0, 0.0), (0.2, 0.5, 0.3)
    parent.scale = (1.0, 2.5, 0.6)
    made.parent = parent
    made.data.clip_start, made.data.clip_end, made.data.ortho_scale = 4.0, 12.0, 6.0
    scenes.wall("Red", 2.0, 0.0, (-1.0, 0.0), scenes.emitter((1.0, 0.1, 0.05), "Red"))
    scenes.wall("Green", 2.0, 2.0, (1.2, 0.5), scenes.emitter((0.1, 0.8, 0.2), "Green"))
    scenes.wall("Blue", 19.0, 5.0, (0.5, -0.6), scenes.emitter((0.05, 0.2, 0.9), "Blue"))
    mist = scene.world.mist_settings
    mist.start, mist.depth = 2.0, 12.0
    bpy.context.view_layer.update()
    axes = made.matrix_world.to_3x3().normalized()
    assert abs(axes.col[0].dot(axes.col[1])) > 0.1
    return scene, made, parent


def _swing(scene, made, parent):
    """Camera and parent move around frame 2, so that the shear and the sizes change."""
    for frame, sign in ((0, -1.0), (4, 1.0)):
        parent.scale.y, parent.location.x = 2.5 + 0.8 * sign, 0.6 * sign
        made.rotation_euler.y = 0.2 + 0.2 * sign
        for owner, path in ((parent, "scale"), (parent, "location"), (made, "rotation_euler")):
            owner.keyframe_insert(path, frame=frame)
    scene.frame_set(2)


def _blurred(scene, samples):
    """Our picture with the camera's blur over a frame, and the mean of Cycles' without it, evenly in that
    time: its own blur of a sheared camera shows something else."""
    import scenes
    render, moments = scene.render, 32
    render.use_motion_blur, render.motion_blur_shutter = True, 1.0
    scenes.set_engine('VOLLEY', moments * samples // 4)
    ours = scenes.render()
    render.use_motion_blur = False
    scenes.set_engine('CYCLES', samples // 4)
    stills = []
    for moment in range(moments):
        frame = 1.5 + (moment + 0.5) / moments
        scene.frame_set(int(frame), subframe=frame % 1.0)
        scene.cycles.seed = moment
        stills.append(scenes.render())
    scene.frame_set(2)
    return ours, np.mean(stills, axis=0)


def inside_sheared(kind, samples):
    """The passes of both engines for a camera that is still, one that moves, and pictures with blur of
    its motion and of its lens."""
    import bpy
    import scenes
    scene, made, parent = _sheared_camera()
    made.data.type = kind
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_mist = layer.use_pass_vector = True
    ray_length = scenes.material("Length", "ShaderNodeEmission", Strength=0.1)
    tree = ray_length.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Ray Length"],
                   tree.nodes["Emission"].inputs["Color"])
    names = ["Combined", "Depth", "Mist", "Vector"]
    found = {}

    def look(name, names, samples):
        found[name] = []
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, samples)
            found[name].append(scenes.render_passes(names))

    filters = [(settings, settings.pixel_filter_type, settings.filter_width)
               for settings in (scene.volley, scene.cycles)]
    scenes.sharpen()
    look("still", names, samples)
    layer.material_override = ray_length
    look("ray length", ["Combined"], samples)
    layer.material_override = None
    _swing(scene, made, parent)
    look("moving", names, samples)
    moved = bpy.data.objects["Blue"]
    moved.rotation_euler.x = 0.4
    look("turned", ["Depth"], samples)
    moved.rotation_euler.x = 0.0
    for settings, kind_of_filter, width in filters:
        settings.pixel_filter_type, settings.filter_width = kind_of_filter, width
    found["blurred"] = [{"Combined": picture} for picture in _blurred(scene, samples)]
    if kind == 'PERSP':
        dof = made.data.dof
        dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 0.08, 6.0
        dof.aperture_blades, dof.aperture_ratio = 5, 1.5
        look("lens", ["Combined"], 8 * samples)
    return found, bpy.app.version


def _blocks(picture, size=8):
    """Means over blocks of so many pixels a side."""
    height, width, channels = picture.shape
    return picture.reshape(height // size, size, width // size, size, channels).mean(axis=(1, 3))


def _even_pixels(picture, reach=0.3):
    """Whether a picture is about the same all over the pixels next to each."""
    values = picture[..., :3]
    even = np.ones(values.shape[:2], bool)
    for axis in (0, 1):
        steps = np.abs(np.diff(values, axis=axis)).max(axis=-1) < reach
        for place in (np.s_[:-1], np.s_[1:]):
            index = [np.s_[:], np.s_[:]]
            index[axis] = place
            even[tuple(index)] &= steps
    return even


# An edge of contrast 1 through a block of 8 by 8 pixels: 8 shares of 256 samples on each side, six
# standard deviations of the difference of their means.
EDGE_NOISE = 6.0 * 2.0 ** 0.5 * 0.5 * (8.0 / 256.0) ** 0.5 / 64.0


@pytest.mark.parametrize("kind", ('PERSP', 'ORTHO'))
def test_sheared_cameras_are_those_of_cycles(blender, kind):
    found, version = blender.run(inside_sheared, kind, 32, timeout=300)
    for name, (ours, theirs) in found.items():
        even = _even_pixels(found["moving" if name == "moving" else "still"][1]["Combined"])
        for each in ours:
            a, b = ours[each], theirs[each]
            seen = even & (np.abs(b).max(axis=-1) < 1e9)  # Depth of what is clipped
            error = np.abs(a - b)
            blocks = np.abs(_blocks(a) - _blocks(b)).max()
            print(f"{kind} {name} {each}: means {a[seen].mean():.5f} {b[seen].mean():.5f}, "
                  f"pixels {np.median(error):.2g} {error[seen].max():.2g}, blocks {blocks:.2g}")
            if name in ("blurred", "lens"):
                # The 32 moments of stills are steps as large as noise.
                assert blocks < (2.0 if name == "blurred" else 1.0) * EDGE_NOISE, (name, each)
                continue
            if each == "Vector" and kind == 'ORTHO' and version >= (4, 0, 0):
                continue  # Cycles' is noise then, with any orthographic camera that turns
            assert seen.mean() > 0.5, (name, each)
            # Samples lie up to a hundredth of a pixel apart.
            assert error[seen].max() < (0.02 if each == "Vector" else 2e-3), (name, each)
            if each == "Vector" and name == "moving":
                assert np.abs(b[seen][..., :2]).mean() > 0.5


# Other objects ---------------------------------------------------------------------------------------

OTHER_OFF = 0.004, 0.03  # the ball's outline


def inside_other(kind):
    """Pictures by both of a ball that is seen through a light, a mesh or an Empty instead of a camera."""
    import bpy
    import scenes
    scene = scenes.empty(size=(64, 48))
    made = scenes.camera()
    scenes.sphere(material=scenes.emitter((0.8, 0.5, 0.2)))
    data = None
    if kind == 'MESH':
        data = bpy.data.meshes.new("Seen Through")
    elif kind != 'EMPTY':
        data = bpy.data.lights.new("Seen Through", kind)
        data.energy = 0.0
    if kind == 'SPOT':
        data.spot_size = 0.8
    other = bpy.data.objects.new("Seen Through", data)
    other.matrix_world = made.matrix_world
    scene.collection.objects.link(other)
    scene.camera = other
    return scenes.seeds_by_both(64)


# Blender 5 falls with any engine where an Empty is seen through.
@pytest.mark.parametrize("kind", ('SPOT', 'POINT', 'AREA', 'MESH') + ('EMPTY',) * (blender_support.version() < (5, 0)))
def test_other_objects(blender, kind):
    ours, theirs = (seeds[..., :3] for seeds in blender.run(inside_other, kind))
    assert theirs.any()
    assert all(error <= off * theirs.mean() for error, off in zip(compare.unexplained(ours, theirs), OTHER_OFF))

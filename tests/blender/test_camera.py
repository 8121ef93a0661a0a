# SPDX-License-Identifier: Apache-2.0
"""Camera windows against Blender's own projection matrices, borders, depth of field."""

import itertools

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

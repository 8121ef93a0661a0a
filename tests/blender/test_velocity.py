# SPDX-License-Identifier: Apache-2.0
"""Blur by an attribute of velocities beside Cycles': of meshes, points and curves, whatever else moves them."""

import blender as blender_support
import compare
import numpy as np

SAMPLES = 512      # of each engine, shared out among seeds
OFF = 1e-3, 2e-3   # beyond noise, of a picture and of a tile; without the blur .05 to .2 of a tile
NORMALS_OFF = 2e-3, 1e-2  # Cycles 3.4 forgets to make bent normals as long as they were
STRAIGHT_OFF = 1e-3, 1e-2  # Cycles 5 draws curves of straight pieces straight
IS_OLD = blender_support.version() < (4, 1)  # only vectors and colours of points count


# Inside Blender ------------------------------------------------------------------------------------

def _stage(length=0.8):
    """A lit scene whose frame 1 is blurred, of 24 frames a second."""
    import scenes
    scene = scenes.empty(size=(64, 48))
    scenes.camera(location=(0.0, -7.0, 0.0))
    scenes.light('SUN', energy=3.0, angle=0.2, rotation=(0.9, 0.3, 0.2))
    scenes.wall("Back", 20.0, 4.0, material=scenes.emitter((0.3, 0.3, 0.4), "Grey"))
    scenes.set_shutter(scene, length=length)
    scene.render.fps, scene.render.fps_base = 30, 1.25
    scene.frame_set(1)
    return scene


def _both():
    import scenes
    return [seeds[..., :3] for seeds in scenes.seeds_by_both(SAMPLES)]


def _grey():
    import scenes
    return scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))


def _carry(data, tell, kind='FLOAT_VECTOR', domain='POINT'):
    """Give a mesh velocities: tell(number) of each item."""
    field, width = {'FLOAT': ("value", 1), 'FLOAT_COLOR': ("color", 4)}.get(kind, ("vector", 3))
    for number, item in enumerate(data.attributes.new("velocity", kind, domain).data):
        value = (*tell(number), 1.0)[:width]
        setattr(item, field, value[0] if width == 1 else value)


def _ball(**settings):
    import scenes
    made = scenes.sphere(radius=1.2, material=_grey(), **settings)
    _carry(made.data, lambda number: made.data.vertices[number].co.yzx * 25.0)
    return made


def _stored(owner, *kinds):
    """Nodes of those kinds, then velocities by place and a material."""
    import scenes
    *nodes, store, assign = scenes.geometry_nodes(
        owner, *kinds, "GeometryNodeStoreNamedAttribute", "GeometryNodeSetMaterial")
    group = store.id_data
    store.data_type, store.domain, store.inputs["Name"].default_value = 'FLOAT_VECTOR', 'POINT', "velocity"
    place, scale = group.nodes.new("GeometryNodeInputPosition"), group.nodes.new("ShaderNodeVectorMath")
    scale.operation, scale.inputs["Scale"].default_value = 'SCALE', 12.0
    group.links.new(place.outputs[0], scale.inputs[0])
    group.links.new(scale.outputs[0], next(each for each in store.inputs if each.name == "Value" and each.enabled))
    assign.inputs["Material"].default_value = _grey()
    return nodes


def inside_meshes():
    """Meshes that turn, are scaled, move in other ways as well, and those that may not be blurred."""
    import scenes
    pictures = {}
    _stage()
    made = _ball(smooth=False)
    made.scale = 1.3, 1.0, 0.8
    pictures["scaled"] = _both()
    made.cycles.use_deform_motion = False
    pictures["without deformation blur"] = _both()
    _stage()
    made = _ball(smooth=False)
    made.shape_key_add(name="Base")
    key = made.shape_key_add(name="Far")
    for point in key.data:
        point.co.x += 1.0
    for frame in (0, 2):
        key.value = 0.5 * frame
        key.keyframe_insert("value", frame=frame)
        made.location.z = 0.5 * frame - 0.5
        made.keyframe_insert("location", frame=frame)
    pictures["with shape keys and moved"] = _both()
    return pictures


def inside_smooth():
    """A smooth ball whose normals bend."""
    _stage()
    _ball()
    return {"smooth": _both()}


def inside_strands():
    """Points and curves."""
    import bpy
    import scenes
    pictures = {}
    _stage()
    made = scenes.sphere("Cloud", 1.3)
    radius, = _stored(made, "GeometryNodeMeshToPoints")
    radius.inputs["Radius"].default_value = 0.15
    pictures["points"] = _both()
    _stage()
    shown = scenes.link("Curves", bpy.data.hair_curves.new("Curves"))
    ball = scenes.uv_sphere(16, 8, radius=1.3)
    ball.hide_render = True
    to_curve, radius = _stored(shown, "GeometryNodeMeshToCurve", "GeometryNodeSetCurveRadius")
    radius.inputs["Radius"].default_value = 0.05
    group = to_curve.id_data
    source = group.nodes.new("GeometryNodeObjectInfo")
    source.inputs["Object"].default_value = ball
    group.links.new(source.outputs["Geometry"], to_curve.inputs[0])
    pictures["curves"] = _both()
    return pictures


def inside_types():
    """Attributes of other types and domains."""
    import scenes
    pictures = {}
    for kind, domain in (('FLOAT_COLOR', 'POINT'), ('FLOAT_VECTOR', 'CORNER'), ('FLOAT_VECTOR', 'FACE'),
                         ('FLOAT_VECTOR', 'EDGE')):
        _stage()
        made = scenes.sphere(radius=1.2, material=_grey(), smooth=False)
        _carry(made.data, lambda number: (15.0 + number % 7, 0.0, number % 5), kind, domain)
        pictures[f"{kind} {domain}"] = _both()
    return pictures


# Comparison ----------------------------------------------------------------------------------------

def _agree(pictures, off=OFF):
    for name, (ours, theirs) in pictures.items():
        whole, tile = compare.unexplained(ours, theirs)
        print(name, whole, tile)
    for name, (ours, theirs) in pictures.items():
        assert theirs.std() > 0.02, f"{name}: the picture shows nothing"
        whole, tile = compare.unexplained(ours, theirs)
        assert whole <= off[0] and tile <= off[1], name


def test_meshes(blender):
    pictures = blender.run(inside_meshes)
    _agree(pictures)
    shown = [pictures[name][1].mean(axis=0) for name in ("scaled", "without deformation blur")]
    assert np.abs(shown[0] - shown[1]).max() > 0.1, "nothing is blurred"


def test_smooth_meshes(blender):
    _agree(blender.run(inside_smooth), NORMALS_OFF if IS_OLD else OFF)


def test_points_and_curves(blender):
    _agree(blender.run(inside_strands), STRAIGHT_OFF if blender_support.version() >= (5, 0) else OFF)


def test_types(blender):
    pictures = blender.run(inside_types)
    if IS_OLD:
        shown = [pictures[f"FLOAT_VECTOR {domain}"][0].mean(axis=0) for domain in ("CORNER", "FACE")]
        assert np.abs(shown[0] - shown[1]).max() < 0.1, "corners and faces blur"
    _agree(pictures)

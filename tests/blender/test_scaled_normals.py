# SPDX-License-Identifier: Apache-2.0
"""Smooth normals of objects that are scaled unevenly: Cycles makes those of what it moves to world space unit there,
before they are interpolated, all others after. On coarse meshes that is seen."""

import blender as blender_support
import compare
import pytest

SAMPLES = 64
OFF = 0.01  # of the mean in a tile; the other way is off by up to 55 %
SHARP = "deforming, of faces and corners"
SINCE = (4, 0), "Cycles 3.4 has other normals at sharp edges of what deforms"
KINDS = ("alone", "mirrored", "of faces and corners", "of sharp edges alone", "instanced", "shared", "moving",
         "still in motion blur", "displaced", "with persistent data", "deforming", "deforming, mirrored", SHARP,
         "deforming, shared", "deforming and moving")


# Inside Blender ------------------------------------------------------------------------------------

def _deform(made):
    """Bend a mesh between the frames around the picture's."""
    made.shape_key_add(name="Basis")
    bent = made.shape_key_add(name="Bent")
    for point, vertex in zip(bent.data, made.data.vertices):
        point.co.x, point.co.y = 1.3 * vertex.co.x + 0.3 * vertex.co.z, 0.8 * vertex.co.y
    for frame in (0, 2):
        bent.value = 0.5 * frame
        bent.keyframe_insert("value", frame=frame)


def _cone(kind):
    import bpy
    import scenes
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cone_add(vertices=9, location=(0.3, 0.0, 0.0), rotation=(0.7, 0.4, 0.3))
    made = bpy.context.object
    made.scale = (0.7, 1.0, -1.4 if "mirrored" in kind else 1.4)
    bpy.ops.object.shade_smooth()
    material = scenes.material("Shown", "ShaderNodeEmission")
    tree = material.node_tree
    shown = tree.nodes.new("ShaderNodeVectorMath")
    shown.operation = 'MULTIPLY_ADD'
    shown.inputs[1].default_value, shown.inputs[2].default_value = (0.3,) * 3, (0.5,) * 3
    unit = tree.nodes.new("ShaderNodeVectorMath")  # those of what deforms are not in Cycles 3.4
    unit.operation = 'NORMALIZE'
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"], unit.inputs[0])
    tree.links.new(unit.outputs[0], shown.inputs[0])
    tree.links.new(shown.outputs[0], tree.nodes["Emission"].inputs["Color"])
    made.data.materials.append(material)
    if "of faces and corners" in kind:
        made.data.polygons[0].use_smooth = made.data.polygons[3].use_smooth = False
        for edge in list(made.data.edges)[::4]:
            edge.use_edge_sharp = True
        if hasattr(made.data, "use_auto_smooth"):
            made.data.use_auto_smooth = True
    elif kind == "of sharp edges alone":  # as Smooth by Angle leaves flat faces: smooth flags, and flat from 4.1 on
        for edge in made.data.edges:
            edge.use_edge_sharp = True
    elif kind == "instanced":
        collection = bpy.data.collections.new("Source")
        scene.collection.objects.unlink(made)
        collection.objects.link(made)
        maker = scenes.link("Maker", None)
        maker.instance_type, maker.instance_collection = 'COLLECTION', collection
    elif "shared" in kind:
        scenes.link("Other", made.data).location.y = 50.0
    elif kind == "displaced":
        height = tree.nodes.new("ShaderNodeDisplacement")
        height.inputs["Height"].default_value, height.inputs["Midlevel"].default_value = 0.1, 0.0
        tree.links.new(height.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        (material if hasattr(material, "displacement_method") else material.cycles).displacement_method = 'DISPLACEMENT'
    if "deforming" in kind:
        _deform(made)
    if kind in {"moving", "deforming and moving"}:
        for frame in (0, 2):
            made.location.x = 0.1 + 0.2 * frame
            made.keyframe_insert("location", frame=frame)
    if kind in {"moving", "still in motion blur"} or "deforming" in kind:
        scene.render.use_motion_blur = True
        scene.render.motion_blur_shutter = 1.0 if "deforming" in kind else 0.01
        scene.frame_set(1)
    scene.render.use_persistent_data = kind == "with persistent data"


def inside_cones():
    """{kind: pictures by both engines}"""
    import scenes
    found = {}
    for kind in KINDS:
        scenes.empty(size=(40, 40))
        scenes.camera(location=(0.0, -4.0, 0.0))
        _cone(kind)
        found[kind] = [pictures[..., :3] for pictures in scenes.seeds_by_both(SAMPLES)]
    return found


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return blender_of_module.run(inside_cones)


@pytest.mark.parametrize("kind", [
    pytest.param(kind, marks=pytest.mark.since(*SINCE)) if kind == SHARP else kind for kind in KINDS])
def test_against_cycles(pictures, kind):
    if kind == SHARP and blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    ours, theirs = pictures[kind]
    mean, tile = compare.unexplained(ours, theirs)
    print(f"{kind}: {mean / theirs.mean():.4f} of the mean, {tile / theirs.mean():.4f} in a tile")
    assert tile < OFF * theirs.mean()

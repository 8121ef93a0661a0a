# SPDX-License-Identifier: Apache-2.0
"""Objects while they are edited, sculpted and painted: F12 beside Cycles, and what a viewport sees."""

import compare
import numpy as np

SAMPLES = 64
ROUNDING = 1e-6  # all else is noise, measured on the seeds


def _textured(name):
    """A material that shines with a checker by UV, tinted by the colour attribute."""
    import scenes
    made = scenes.material(name, "ShaderNodeEmission")
    tree = made.node_tree
    checker, mix = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes.new("ShaderNodeVectorMath")
    mix.operation = 'MULTIPLY_ADD'
    mix.inputs[1].default_value = (0.5, 0.5, 0.5)
    checker.inputs["Scale"].default_value = 4.0
    color = tree.nodes.new("ShaderNodeVertexColor")
    color.layer_name = "Tint"
    tree.links.new(tree.nodes.new("ShaderNodeUVMap").outputs[0], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], mix.inputs[0])
    tree.links.new(color.outputs["Color"], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Emission"].inputs["Color"])
    return made


def _tinted_wall(name, center, materials, cuts=2):
    """A wall of cuts by cuts faces with colours, whose last face has the last material."""
    import bmesh
    import scenes
    made = scenes.wall(name, 1.4, 0.0, center)
    editable = bmesh.new()
    editable.from_mesh(made.data)
    bmesh.ops.subdivide_edges(editable, edges=editable.edges[:], cuts=cuts - 1, use_grid_fill=True)
    editable.to_mesh(made.data)
    editable.free()
    tint = made.data.color_attributes.new("Tint", 'FLOAT_COLOR', 'POINT')
    for number, item in enumerate(tint.data):
        item.color = (0.4 * (number % 2), 0.1, 0.3, 1.0)
    for material in materials:
        made.data.materials.append(material)
    made.data.polygons[-1].material_index = len(materials) - 1
    return made


def _make_objects():
    """Meshes with and without modifiers and shape keys, shared and instanced, curves, text and the rest."""
    import bpy
    import scenes
    scenes.empty(size=(96, 64))
    scenes.camera(location=(0.0, -12.0, 0.0))
    materials = _textured("Textured"), scenes.emitter((0.1, 0.9, 0.2), "Green")
    plain = _tinted_wall("Plain", (-3.5, 1.5), materials)
    smooth = _tinted_wall("Smooth", (-1.7, 1.5), materials)
    smooth.modifiers.new("Subdivision", 'SUBSURF').render_levels = 1
    keyed = _tinted_wall("Keyed", (0.1, 1.5), materials)
    keyed.shape_key_add(name="Basis")
    keyed.shape_key_add(name="Aside").data[0].co.z -= 0.8
    keyed.active_shape_key_index, keyed.data.shape_keys.key_blocks["Aside"].value = 1, 1.0
    shared = scenes.link("Shared", plain.data)
    shared.location = (0.0, 0.0, -1.8)
    collection = bpy.data.collections.new("Group")
    collection.objects.link(plain)
    instancer = scenes.link("Instancer", None)
    instancer.instance_type, instancer.instance_collection = 'COLLECTION', collection
    instancer.location, instancer.rotation_euler = (1.9, -0.4, -1.8), (0.0, 0.2, 0.0)  # in no other's plane
    blue = scenes.emitter((0.1, 0.2, 0.9), "Blue")
    others = []
    for operator, location in ((bpy.ops.object.text_add, (1.2, 0, 1.2)),
                               (bpy.ops.object.metaball_add, (0.8, 0, -1.5)),
                               (bpy.ops.curve.primitive_bezier_circle_add, (3.5, 0, 1.5)),
                               (bpy.ops.surface.primitive_nurbs_surface_torus_add, (3.5, 0, -1.5))):
        operator(location=location)
        made = bpy.context.object
        made.rotation_euler, made.scale = (1.5, 0, 0), (0.8, 0.8, 0.8)
        made.data.materials.append(blue)
        if made.type == 'CURVE':
            made.data.bevel_depth = 0.3
        others.append(made)
    return [plain, smooth, keyed], others


def _enter(mode, *objects):
    """Put objects into a mode, the first of them active."""
    import bpy
    for each in bpy.context.scene.objects:
        each.select_set(each in objects)
    bpy.context.view_layer.objects.active = objects[0]
    bpy.ops.object.mode_set(mode=mode)


def inside_edit_mode():
    """F12 by both engines outside Edit Mode and in it, for all meshes at once and each other type."""
    import bpy
    import scenes
    meshes, others = _make_objects()
    pairs = {"OBJECT": scenes.seeds_by_both(SAMPLES)}
    for name, objects in [("meshes", meshes)] + [(each.type, [each]) for each in others]:
        _enter('EDIT', *objects)
        assert all(each.mode == 'EDIT' for each in objects)
        pairs[name] = scenes.seeds_by_both(SAMPLES)
        bpy.ops.object.mode_set(mode='OBJECT')
    return pairs


def _close(ours, theirs, name):
    """Means of the picture and of its tiles are as far apart as noise explains."""
    assert max(compare.unexplained(ours, theirs)) <= ROUNDING, name


def test_edit_mode_is_that_of_cycles(blender):
    pairs = blender.run(inside_edit_mode, timeout=300)
    assert len(pairs) == 6
    for name, (ours, theirs) in pairs.items():
        assert theirs[..., :3].mean() > 0.1, name
        _close(ours, theirs, name)
        # Edited shape keys are summed in another order.
        assert np.abs(ours - pairs["OBJECT"][0]).mean() < 1e-4, name


def inside_posed_edits():
    """A bar that an armature swings, in Edit Mode, with motion blur, by both engines."""
    import math
    import bpy
    import scenes
    scene = scenes.empty(size=(64, 48))
    scenes.camera()
    bar = scenes.mesh("Bar", [(0, 0, -0.3), (2, 0, -0.3), (2, 0, 0.3), (0, 0, 0.3)], [(0, 1, 2, 3)],
                      scenes.emitter((1.0, 0.5, 0.2)))
    rig = scenes.link("Rig", bpy.data.armatures.new("Rig"))
    _enter('EDIT', rig)
    rig.data.edit_bones.new("Bone").tail = (2.0, 0.0, 0.0)
    bpy.ops.object.mode_set(mode='OBJECT')
    bar.vertex_groups.new(name="Bone").add([0, 1, 2, 3], 1.0, 'REPLACE')
    modifier = bar.modifiers.new("Rig", 'ARMATURE')
    modifier.object, modifier.show_in_editmode, modifier.show_on_cage = rig, True, True
    bone = rig.pose.bones["Bone"]
    bone.rotation_mode = 'XYZ'
    for frame, sign in ((0, -1), (2, 1)):
        bone.rotation_euler.z = sign * math.radians(10.0)
        bone.rotation_euler.x = sign * math.radians(10.0)
        bone.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    _enter('EDIT', bar)
    return scenes.seeds_by_both(256)


def test_deformation_blur_in_edit_mode(blender):
    ours, theirs = blender.run(inside_posed_edits)
    shown = theirs.mean(axis=0)[..., 0]
    assert shown.max() > 0.9
    assert ((shown > 0.1) & (shown < 0.9)).mean() > 0.02  # it is blurred
    _close(ours, theirs, "deformation blur")


def inside_viewport_edits():
    """What a viewport shows of edits, one after the other: (name, difference from a scene that is read
    afresh, from the picture before)."""
    import bmesh
    import bpy
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    meshes, _ = _make_objects()
    plain, smooth, keyed = meshes
    follower, told = Follower(), []
    former = follower.picture()

    def look(name):
        nonlocal former
        bpy.context.view_layer.update()
        followed = follower.picture()
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = picture(fresh_sync, Changes.everything())
        fresh_sync.destroy()
        told.append((name, float(np.abs(followed - fresh).max()), float(np.abs(followed - former).mean())))
        former = followed

    def push(owner):
        editable = bmesh.from_edit_mesh(owner.data)
        for vertex in editable.verts[:3]:
            vertex.co.x -= 0.5
        bmesh.update_edit_mesh(owner.data)

    _enter('EDIT', *meshes)
    look("enter")
    for owner in meshes:
        push(owner)
        look("move " + owner.name)
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.subdivide(number_cuts=2, smoothness=1.0)
    look("subdivide")
    plain.active_material_index = 1
    bpy.ops.object.material_slot_assign()
    look("slot")
    bpy.ops.transform.translate(value=(0.0, 0.0, -0.4))
    look("operator")
    smooth.modifiers["Subdivision"].levels = 2
    look("modifier")
    editable = bmesh.from_edit_mesh(plain.data)
    editable.faces.ensure_lookup_table()
    bmesh.ops.delete(editable, geom=editable.faces[:5], context='FACES')
    bmesh.update_edit_mesh(plain.data)
    look("delete")
    bpy.ops.object.mode_set(mode='OBJECT')
    look("leave")
    return told


def test_edits_are_seen_while_they_are_made(blender):
    told = blender.run(inside_viewport_edits, timeout=300)
    for name, error, change in told:
        print(f"{name}: off by {error:.2g}, changed by {change:.2g}")
        assert error == 0.0, name
        # Entering leaves everything as it is; the subdivision's cage is already shown as the modifier has it.
        assert (change > 1e-3) == (name not in ("enter", "leave", "modifier")), name


def inside_other_modes():
    """F12 by both engines and the viewport's picture in the modes that paint and sculpt, with and without
    multiresolution: {(mode, whether with it): pictures}."""
    import bpy
    import scenes
    from follower import Follower
    scenes.empty()
    scenes.camera()
    ball = scenes.sphere("Ball", 1.4, material=scenes.emitter((1.0, 0.5, 0.2)))
    for polygon in ball.data.polygons:
        polygon.use_smooth = False
    bpy.context.view_layer.objects.active = ball
    modifier = ball.modifiers.new("Multires", 'MULTIRES')
    for _ in range(2):
        bpy.ops.object.multires_subdivide(modifier="Multires", mode='CATMULL_CLARK')
    found, warnings = {}, []
    for has_multires in (False, True):
        modifier.show_render = modifier.show_viewport = has_multires
        for mode in ('OBJECT', 'EDIT', 'SCULPT', 'VERTEX_PAINT', 'WEIGHT_PAINT', 'TEXTURE_PAINT'):
            bpy.ops.object.mode_set(mode=mode)
            follower = Follower()
            found[mode, has_multires] = (*scenes.seeds_by_both(SAMPLES), follower.picture())
            warnings.append((mode, has_multires, follower.sync.warnings.take()))
            bpy.ops.object.mode_set(mode='OBJECT')
    return found, [each for each in warnings if each[2]]


def test_paint_and_sculpt_modes(blender):
    found, warnings = blender.run(inside_other_modes, timeout=300)
    for (mode, has_multires), (ours, theirs, viewport) in found.items():
        name = f"{mode} {has_multires}"
        assert theirs[..., 0].mean() > 0.1, name
        _close(ours, theirs, name)
        # Blender keeps what is sculpted to itself; in Edit Mode the modifier is not in force.
        is_base = has_multires and mode in ('SCULPT', 'EDIT')
        expected = found['OBJECT', has_multires and not is_base][2]
        assert np.array_equal(viewport, expected), name
    assert not np.array_equal(found['OBJECT', False][2], found['OBJECT', True][2])
    assert [(mode, has_multires) for mode, has_multires, _ in warnings] == [('SCULPT', True)]
    assert warnings[0][2] == ["Object 'Ball': while it is sculpted, the mesh below its multiresolution is shown"]

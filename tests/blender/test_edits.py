# SPDX-License-Identifier: Apache-2.0
"""Edits one after the other: what the library then holds is what it would be told of the scene afresh."""

import pytest


def _edit_or_undo(random, undoes):
    """Make a random edit, or take one back or make it again; its name."""
    import bpy
    import edits
    if undoes and random.random() < 0.35:
        operator = random.choice((bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo))
        try:
            operator()
        except RuntimeError:  # nothing is left to be taken back or made again
            return "nothing"
        return operator.idname_py()
    edit = random.choice(edits.ALL)
    edit(random)
    if undoes:
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message=edit.__name__)
    return edit.__name__


def inside_random_edits(seed, count, undoes):
    import random
    import bpy
    import edits
    import numpy as np
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    edits.make_scene()
    bpy.ops.ed.undo_push(message="scene")
    random = random.Random(seed)
    follower = Follower()
    follower.picture()
    worst, former, changed_count, misnamed = [], None, 0, []
    for number in range(count):
        name = _edit_or_undo(random, undoes)
        bpy.context.view_layer.update()
        if random.random() < 0.3:  # several edits until the next draw
            continue
        followed = follower.picture()
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = picture(fresh_sync, Changes.everything())
        misnamed += [name] * (follower.sync.cryptomatte_names() != fresh_sync.cryptomatte_names())
        fresh_sync.destroy()
        changed_count += former is None or not np.array_equal(former, fresh)
        former = fresh
        worst.append((float(np.abs(followed - fresh).mean()), name, number))
    return sorted(worst, reverse=True)[:8], changed_count / len(worst), misnamed


@pytest.mark.parametrize("seed, undoes", [(1, False), (2, False), (3, True)])
def test_random_edits_end_in_the_scene_as_it_is(blender, seed, undoes):
    worst, changed_share, misnamed = blender.run(inside_random_edits, seed, 200, undoes)
    assert worst[0][0] == 0.0 and misnamed == [], (worst, misnamed)
    assert changed_share > 0.5  # the edits are seen at all


def _shown_by(material, *nodes):
    """Have a material shine with the output of the last of these nodes, each (type, output) and fed by the
    one before; the nodes."""
    tree, made, source = material.node_tree, [], None
    for kind, output in nodes:
        made.append(tree.nodes.new(kind))
        if source is not None:
            tree.links.new(source, made[-1].inputs[0])
        source = made[-1].outputs[output]
    tree.links.new(source, tree.nodes["Emission"].inputs["Color"])
    return made


def _turned_normals(data, angle):
    """The corners' normals of a mesh, turned about Z, as its own."""
    from mathutils import Matrix
    if hasattr(data, "use_auto_smooth"):  # till 4.0
        data.use_auto_smooth = True
    turn = Matrix.Rotation(angle, 3, 'Z')
    normals = [data.vertices[loop.vertex_index].normal for loop in data.loops]
    data.normals_split_custom_set([(turn @ normal)[:] for normal in normals])
    data.update()


def _lights_of_nodes(other):
    """A light whose nodes look at where an object is, and one with a group of nodes; they and the group."""
    import bpy
    import scenes
    group = bpy.data.node_groups["Tint"].copy()
    lights = [scenes.light('POINT', (x, -5.0, 0.0), energy=300.0) for x in (-3.0, 3.0)]
    for light, kind, output in zip(lights, ("ShaderNodeTexCoord", "ShaderNodeGroup"), ("Object", "Color")):
        light.data.use_nodes = True
        tree = light.data.node_tree
        node = tree.nodes.new(kind)
        if kind == "ShaderNodeGroup":
            node.node_tree = group
        else:
            node.object = other
        tree.links.new(node.outputs[output], tree.nodes["Emission"].inputs["Color"])
    return lights, group


def inside_edits_in_turn():
    """Of each edit, the mean difference of what is followed from a fresh picture, and of that from the one
    before."""
    import bpy
    import edits
    import numpy as np
    import scenes
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    scene = edits.make_scene()
    owned, placed = scenes.emitter((1.0, 1.0, 1.0), "Owned"), scenes.emitter((1.0, 1.0, 1.0), "Placed")
    _, ramp = _shown_by(owned, ("ShaderNodeObjectInfo", "Color"), ("ShaderNodeValToRGB", "Color"))
    coordinates, _ = _shown_by(placed, ("ShaderNodeTexCoord", "Object"), ("ShaderNodeTexWhiteNoise", "Color"))
    coordinates.object = other = scenes.link("Other", None)
    colored = scenes.wall("Colored", 1.0, -2.0, (-2.0, 1.5), owned)
    scenes.wall("Placed", 1.0, -2.0, (0.0, -1.5), placed)
    first = scenes.wall("First", 0.7, -2.0, (1.5, -1.5), scenes.emitter((1.0, 0.5, 0.1), "Shared"))
    scenes.link("Second", first.data).location.z = 3.0
    ball = bpy.data.objects["Ball"].data

    def flatten_half():
        for number in range(0, len(ball.polygons), 2):
            ball.polygons[number].use_smooth = False
        ball.update()

    def displace():
        modifier = first.modifiers.new("Displace", 'DISPLACE')
        modifier.direction, modifier.strength, modifier.mid_level = 'X', 0.6, 0.0

    in_turn = {
        "colour": lambda: setattr(colored, "color", (0.2, 0.5, 0.3, 1.0)),
        "ramp": lambda: setattr(ramp.color_ramp.elements[0], "color", (0.1, 0.8, 0.9, 1.0)),
        "other object": lambda: setattr(other, "location", (0.3, 0.1, 0.2)),
        "half flat": flatten_half,
        "normals": lambda: _turned_normals(ball, 0.3),
        "turned normals": lambda: _turned_normals(ball, -0.6),
        "modifier of one of two": displace}
    lights, group = _lights_of_nodes(other)
    in_turn["light that looks at another object"] = lambda: setattr(other, "location", (0.9, 0.1, 0.7))
    shown, place = scene.world.node_tree, scene.world.node_tree.nodes.new("ShaderNodeTexCoord")
    place.object = other
    in_turn["world that looks"] = lambda: shown.links.new(
        place.outputs["Object"], shown.nodes["Background"].inputs["Color"])
    in_turn["object that it looks at"] = lambda: setattr(other, "location", (-0.9, -0.5, -0.7))
    in_turn["light's group"] = lambda: setattr(
        group.nodes["RGB"].outputs[0], "default_value", (0.9, 0.1, 0.1, 1.0))
    collection = bpy.data.collections.new("Cut")
    scene.collection.children.link(collection)
    collection.objects.link(bpy.data.objects["Ball"])
    scene.collection.objects.unlink(bpy.data.objects["Ball"])
    cut = bpy.context.view_layer.layer_collection.children["Cut"]
    in_turn["hole"] = lambda: setattr(cut, "holdout", True)
    in_turn["no hole"] = lambda: setattr(cut, "holdout", False)
    follower = Follower()
    former, found = follower.picture(), {}
    for name, edit in in_turn.items():
        edit()
        bpy.context.view_layer.update()
        followed = follower.picture()
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = picture(fresh_sync, Changes.everything())
        fresh_sync.destroy()
        found[name] = [float(np.abs(each - fresh).mean()) for each in (followed, former)]
        former = fresh
    return found


def test_edits_in_turn_end_in_the_scene_as_it_is(blender):
    for name, (error, change) in blender.run(inside_edits_in_turn).items():
        assert change > 1e-4, name  # it is seen
        assert error == 0.0, name

# SPDX-License-Identifier: Apache-2.0
"""Volumes, which are not rendered: what they leave is the scene without them, in one piece and one warning."""

import numpy as np

SAMPLES = 32
ROUNDING = 1e-6  # where objects come in another order


def _volume(name, surface=None, density=0.0):
    """A material with a volume, and a surface of that colour if there is one. Without density Cycles, too,
    shows what is behind."""
    import bpy
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    fog = tree.nodes.new("ShaderNodeVolumePrincipled")
    fog.inputs["Density"].default_value = density
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    if surface is not None:
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = (*surface, 1.0)
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def _box(name, size, location, *materials):
    import bpy
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    made = bpy.context.object
    made.name = name
    for material in materials:
        made.data.materials.append(material)
    return made


def _stage():
    """A floor with a ball in the sun."""
    import scenes
    scene = scenes.empty(size=(64, 48))
    scenes.camera(location=(0.0, -6.0, 3.0), rotation=(1.1, 0.0, 0.0))
    scenes.mesh("Floor", [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)], [(0, 1, 2, 3)],
                scenes.material("Floor", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.6, 0.4)))
    scenes.sphere(radius=0.8, location=(0.0, 0.0, 0.8),
                  material=scenes.material("Ball", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.5, 0.8)))
    scenes.light('SUN', (0, 0, 4), (0.6, 0.3, 0), energy=3.0, angle=0.1)
    scenes.world_color(scene.world, (0.1, 0.2, 0.4))
    return scene


def _nested(fog):
    for number in range(12):  # more than rays see through
        _box(f"Nested{number}", 1.0 + 0.1 * number, (1.5, 0.0, 1.2), fog)


def _sides(fog):
    """A box whose front and left are there."""
    import scenes
    box = _box("Sides", 1.5, (1.5, 0.0, 0.8), fog, scenes.emitter((0.9, 0.3, 0.1)))
    for polygon in box.data.polygons:
        polygon.material_index = int(polygon.normal.y < -0.5 or polygon.normal.x < -0.5)


def _shadowless(fog):
    for name in ("use_transparent_shadow",):
        for owner in (fog, fog.cycles):
            if hasattr(owner, name):
                setattr(owner, name, False)
    _box("Fog", 2.0, (1.0, 0.0, 1.2), fog)


def _holdout(fog):
    _box("Fog", 2.0, (1.0, 0.0, 1.2), fog).is_holdout = True


def _dead_link(fog):
    """A reroute that nothing feeds, at the surface."""
    tree = fog.node_tree
    tree.links.new(tree.nodes.new("NodeReroute").outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    _box("Fog", 2.0, (1.0, 0.0, 1.2), fog)


_CASES = {
    "box": lambda fog: _box("Fog", 2.0, (1.0, 0.0, 1.2), fog),
    "around the camera": lambda fog: _box("Fog", 40.0, (0.0, 0.0, 0.0), fog),
    "nested": _nested,
    "sides": _sides,
    "shadowless": _shadowless,
    "holdout": _holdout,
    "dead link": _dead_link,
    "surface": lambda _: _box("Solid", 1.2, (1.5, 0.0, 0.6), _volume("Solid", (0.7, 0.2, 0.2))),
}


def inside_materials():
    """Of each case the pictures of Volley and Cycles, that of Volley where the volume is dense, and the
    latter's warnings; and the stage alone."""
    import bpy
    import scenes
    import volley.session
    found, told = {}, []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    _stage()
    alone = scenes.by_both(SAMPLES)[0]
    for name, build in _CASES.items():
        _stage()
        build(_volume("Fog"))
        told.clear()
        pair = scenes.by_both(SAMPLES)
        messages = list(told)
        for material in bpy.data.materials:
            fog = material.node_tree.nodes.get("Principled Volume")
            if fog is not None:
                fog.inputs["Density"].default_value = 2.0
        scenes.set_engine('VOLLEY', SAMPLES)
        dense = scenes.render()
        found[name] = (*pair, dense, messages)
    return alone, found


def test_volumes_are_left_out(blender):
    alone, found = blender.run(inside_materials, timeout=300)
    for name, (ours, theirs, dense, messages) in found.items():
        difference = np.abs(ours - theirs)[..., :3]
        means = [picture[..., :3].mean() for picture in (ours, theirs)]
        print(f"{name}: means {means[0]:.5f} {means[1]:.5f}, pixels {np.median(difference):.2g} "
              f"{np.percentile(difference, 99):.2g}")
        assert theirs[..., :3].mean() > 0.1, name
        if name != "nested":  # in Cycles shadow rays see through no more than eight sides
            # Edges of 32 samples of contrast .5: deviations of .06 a pixel on few of them, of .001 in the mean.
            assert abs(means[0] - means[1]) < 3e-3, name
            assert np.percentile(difference, 99) < 0.2 and difference.mean() < 0.015, name
        assert np.allclose(ours, dense, atol=ROUNDING), name
        owner = "Solid" if name == "surface" else "Fog"
        assert messages == [f"Material '{owner}': volume is not supported and is left out"], name
        if name not in ("sides", "surface"):
            assert np.allclose(ours, alone, atol=ROUNDING), name


def inside_objects():
    """Volume objects and volumes of geometry nodes: pictures without and with them and the warnings."""
    import bpy
    import scenes
    import volley.session
    told = []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    scene = _stage()
    alone = scenes.render()
    fog = _volume("Fog", density=1.0)
    for number in range(3):
        scenes.link(f"Cloud{number}", bpy.data.volumes.new("Cloud")).data.materials.append(fog)
    ball = scenes.sphere("Filled", 0.7, (1.5, 0.0, 1.0), fog)
    scenes.geometry_nodes(ball, "GeometryNodeMeshToVolume")
    pictures = [scenes.render()]
    messages = list(told)
    tree = scene.world.node_tree
    if tree is None:
        scene.world.use_nodes = True
        tree = scene.world.node_tree
    tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(scatter.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    told.clear()
    pictures.append(scenes.render())
    return alone, pictures, messages, told


def test_volume_objects_and_worlds_are_left_out(blender):
    alone, pictures, messages, of_world = blender.run(inside_objects)
    for picture in pictures:
        assert np.allclose(picture, alone, atol=ROUNDING)
    left_out = "Volumes are not supported: object 'Cloud0' and 3 more is left out"
    assert sorted(messages) == ["Material 'Fog': volume is not supported and is left out", left_out]
    assert sorted(of_world) == sorted(messages + ["World 'World': volume is not supported and is left out"])


def inside_viewport():
    """A box whose surface goes and comes, is made of fog, and moves, as a viewport follows it."""
    import bpy
    import scenes
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    _stage()
    fog, solid = _volume("Fog", (0.7, 0.2, 0.2)), scenes.emitter((0.2, 0.9, 0.3))
    box = _box("Fog", 1.5, (1.5, 0.0, 0.8), fog)
    tree = fog.node_tree
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

    surface = tree.nodes["Diffuse BSDF"].outputs[0], tree.nodes["Material Output"].inputs["Surface"]
    tree.links.remove(surface[1].links[0])
    look("cut")
    box.location.x -= 0.3
    look("move unseen")
    tree.links.new(*surface)
    look("link")
    box.material_slots[0].link = 'OBJECT'
    box.material_slots[0].material = solid
    look("other material")
    tree.links.remove(surface[1].links[0])
    look("cut unseen")
    box.material_slots[0].material = fog
    look("fog")
    return told


def test_viewports_follow_volumes(blender):
    for name, error, change in blender.run(inside_viewport):
        assert error == 0.0, name
        assert (change > 1e-3) == ("unseen" not in name), name

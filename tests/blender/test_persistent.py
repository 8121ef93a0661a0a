# SPDX-License-Identifier: Apache-2.0
"""Final renders with persistent data read again what changed alone."""

import pytest

FRESH_EVERY = 10  # renders, of which the last is compared with one that keeps nothing


def _checking_reads(found):
    """Note of each mesh that a render keeps, whether reading it would give the same; undo()."""
    from volley.sync import mesh, walk
    read_mesh = walk.Walk.read_mesh

    def checked(self, item, each, pointer):
        meshes, names = self._sync._meshes, self._names_of(pointer)
        is_kept = not self._source.changes.geometry_of(item.owner) and meshes.reuse(item.key, pointer, names)
        if not is_kept:
            found["read"] += 1
            return read_mesh(self, item, each, pointer)
        with mesh.shown_mesh(each.object) as shape:
            data, _ = self._extract(item, each, shape, names)
        normals = None if data.normals is None else data.normals[None]
        entry = meshes._entries[item.key]
        if (entry.topology, entry.shape) != meshes._signatures(data, data.positions[None], normals):
            found["stale"].append(item.owner)
        found["kept"] += 1
        return True

    walk.Walk.read_mesh = checked

    def undo():
        walk.Walk.read_mesh = read_mesh
    return undo


def _scene(shutter=None):
    """The scene of the edits with one view layer; shutter: its position, None without motion blur."""
    import bpy
    import edits
    import scenes
    scene = edits.make_scene()
    scene.render.use_persistent_data = True
    if shutter is not None:
        scenes.set_shutter(scene, shutter)
        bone = bpy.data.objects["Rig"].pose.bones["Bone"]
        bone.rotation_mode = 'XYZ'
        for frame in (1, 20):
            bone.rotation_euler.x = 0.1 * frame
            bone.keyframe_insert("rotation_euler", frame=frame)
    for layer in scene.view_layers[1:]:
        layer.use = False
    scene.volley.samples = 1
    return scene


def inside_random_edits(seed, count, shutter):
    import random
    import bpy
    import edits
    import scenes
    scene = _scene(shutter)
    random = random.Random(seed)
    found = {"read": 0, "kept": 0, "stale": [], "renders": 0, "differ": []}
    scenes.render()
    undo = _checking_reads(found)
    walks, undo_count = _counting_walks()
    for _ in range(count):
        edit = random.choice(edits.ALL)
        edit(random)
        if random.random() < 0.3:  # several edits until the next render
            continue
        before = len(found["stale"])
        bpy.ops.render.render(write_still=True)  # pictures are loaded where they are compared: that names the scene
        found["stale"][before:] = [(name, edit.__name__) for name in found["stale"][before:]]
        found["renders"] += 1
        if found["renders"] % FRESH_EVERY == 0:
            kept = scenes.load(scene.render.filepath)
            scene.render.use_persistent_data = False
            found["differ"] += [edit.__name__] * bool(abs(scenes.render() - kept).max())
            scene.render.use_persistent_data = True
            scenes.render()
    undo_count()
    undo()
    found["walks"] = len(walks)
    return found


SHUTTERS = pytest.mark.parametrize("shutter", [None, 'CENTER', 'START'])


@SHUTTERS
def test_meshes_that_are_kept_are_as_they_would_be_read(blender, shutter):
    found = blender.run(inside_random_edits, 1, 150, shutter)
    assert found["stale"] == [] and found["differ"] == []
    assert found["read"] > 30 and found["kept"] > 30
    assert found["walks"] < found["renders"], found


def _counting_walks():
    """How many walks over everything there were, as the length of a list; undo()."""
    from volley.sync import walk
    run, walks = walk.Walk.run, []

    def counted(self, former):
        walks.append(self)
        run(self, former)

    walk.Walk.run = counted

    def undo():
        walk.Walk.run = run
    return walks, undo


def inside_unchanged():
    import bpy
    import scenes
    scene = _scene()
    walks, undo = _counting_walks()
    first = scenes.render()
    bpy.ops.render.render(write_still=True)  # which comes with an image more: the scene is named
    before = len(walks)
    bpy.ops.render.render(write_still=True)
    undo()
    return len(walks) - before, float(abs(scenes.load(scene.render.filepath) - first).max())


def test_nothing_is_read_again_where_nothing_changed(blender):
    assert blender.run(inside_unchanged) == (0, 0.0)


def _key(data, path, values):
    """Animate a setting, over frames 1, 2, 3, 4."""
    for frame, value in enumerate(values, 1):
        setattr(data, path, value)
        data.keyframe_insert(path, frame=frame)


def _animate(scene):
    """Something of every kind: where things are, whether they are shown, their shape and color, lights, a material of
    what is not instanced, the world and the camera."""
    import bpy
    import scenes
    objects = bpy.data.objects
    _key(objects["Ball"], "location", [(-2.0, 0.0, z) for z in (0.0, 0.3, 0.6, 0.1)])
    _key(objects["Ball"], "color", [(x, 0.5, 0.2, 1.0) for x in (0.2, 0.6, 0.9, 0.4)])
    _key(objects["Light"].data, "energy", [300.0, 100.0, 500.0, 200.0])
    _key(scene.camera, "location", [(x, -9.0, 0.0) for x in (0.0, 0.2, 0.1, 0.3)])
    lamp = scenes.light('POINT', (0.0, -4.0, -2.0), energy=50.0).data
    lamp.use_nodes = True
    _key(lamp.node_tree.nodes["Emission"].inputs["Strength"], "default_value", [1.0, 3.0, 2.0, 4.0])
    own = scenes.material("Own", "ShaderNodeBsdfDiffuse")
    colors = own.node_tree.nodes["Diffuse BSDF"].inputs["Color"]
    _key(colors, "default_value", [(x, 0.3, 0.2, 1.0) for x in (0.8, 0.2, 0.5, 0.9)])
    _key(scene.world.node_tree.nodes["Background"].inputs["Strength"], "default_value", [1.0, 3.0, 0.5, 2.0])
    shown = scenes.material("Shown", "ShaderNodeBsdfDiffuse")
    info = shown.node_tree.nodes.new("ShaderNodeObjectInfo")
    shown.node_tree.links.new(info.outputs["Color"], shown.node_tree.nodes["Diffuse BSDF"].inputs["Color"])
    objects["Ball"].data.materials[0] = shown
    _key(scenes.sphere("Blinking", 0.4, (2.0, -1.0, -1.0), shown), "hide_render", [False, True, False, False])
    bent = scenes.sphere("Bent", 0.5, (0.0, -1.0, -1.0), own)
    bent.shape_key_add(name="Basis")
    key = bent.shape_key_add(name="Tall")
    for point in key.data:
        point.co.z *= 2.0
    _key(key, "value", [0.0, 0.5, 1.0, 0.2])


def _jolt(_scene):
    """An object and a shape that a handler has elsewhere for a short while, of which Blender hears only then."""
    import bpy
    import scenes
    bent = scenes.sphere("Bent", 0.5, (0.0, -1.0, -1.0), bpy.data.materials["Plain"])
    bent.shape_key_add(name="Basis")
    tall = bent.shape_key_add(name="Tall")
    tall.value = 0.0  # as it is before 5.0
    for point in tall.data:
        point.co.z *= 2.0
    lid = scenes.wall("Jolted", 0.5, -1.0, material=bpy.data.materials["Plain"])

    def jolt(scene, _depsgraph=None):
        value = float(2.1 < scene.frame_current_final < 2.4)
        if lid.location.x != value:
            lid.location.x = tall.value = value

    bpy.app.handlers.frame_change_pre.append(jolt)


def _sprout(scene):
    """An object whose nodes make instances from frame 3 on."""
    import scenes
    stem = scenes.sphere("Stem", 0.5, (1.5, -1.0, 1.0), scenes.material("Leaf", "ShaderNodeBsdfDiffuse"))
    nodes = scenes.geometry_nodes(stem, "GeometryNodeJoinGeometry")
    tree = stem.modifiers["Nodes"].node_group
    points, leaf, time, later = (tree.nodes.new(kind) for kind in (
        "GeometryNodeInstanceOnPoints", "GeometryNodeMeshCube", "GeometryNodeInputSceneTime", "ShaderNodeMath"))
    leaf.inputs["Size"].default_value = (0.3, 0.3, 0.3)
    later.operation, later.inputs[1].default_value = 'GREATER_THAN', 2.5
    own = next(node for node in tree.nodes if node.type == 'GROUP_INPUT').outputs[0]
    tree.links.new(own, points.inputs["Points"])
    tree.links.new(leaf.outputs["Mesh"], points.inputs["Instance"])
    tree.links.new(time.outputs["Frame"], later.inputs[0])
    tree.links.new(later.outputs[0], points.inputs["Selection"])
    tree.links.new(points.outputs[0], nodes[0].inputs[0])


def _frames(scene, keeps):
    """Pictures of an animation, and how many walks it took until each was written."""
    import bpy
    import scenes
    scene.render.use_persistent_data = keeps
    walks, undo = _counting_walks()
    until, frames = [], range(scene.frame_start, scene.frame_end + 1)

    def note(_scene):
        until.append(len(walks))

    bpy.app.handlers.render_write.append(note)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.render_write.remove(note)
    undo()
    return [scenes.load(scene.render.frame_path(frame=frame)) for frame in frames], until


def inside_animation(animate, shutter=None):
    """[(walks until then, difference from a render that keeps nothing, from the frame before)] of frames 2, 3, 4."""
    import tempfile
    scene = _scene(shutter)
    globals()[animate](scene)
    scene.frame_start, scene.frame_end = 1, 4
    scene.render.image_settings.file_format = 'OPEN_EXR'
    scene.render.filepath = tempfile.mkdtemp(prefix="volley_") + "/"
    fresh, _ = _frames(scene, False)
    kept, walks = _frames(scene, True)
    return [(walks[n], float(abs(kept[n] - fresh[n]).max()), float(abs(kept[n] - kept[n - 1]).max()))
            for n in range(1, 4)]


@SHUTTERS
def test_frames_are_those_of_renders_that_keep_nothing(blender, shutter):
    """What is animated alone is looked at; an object that is hidden or shown takes a walk."""
    (first, *_), (second, *_), (third, *_) = found = blender.run(inside_animation, "_animate", shutter)
    assert [difference for _walks, difference, _change in found] == [0.0] * 3
    assert all(change > 0.05 for _walks, _difference, change in found)
    assert (first, second, third) == (2, 3, 3), found


@SHUTTERS
def test_what_moved_for_a_moment_is_seen_to_stand_still(blender, shutter):
    found = blender.run(inside_animation, "_jolt", shutter)
    assert [difference for _walks, difference, _change in found] == [0.0] * 3
    assert all(change > 0.05 for _walks, _difference, change in found[:2])


@SHUTTERS
def test_instances_may_appear_in_time(blender, shutter):
    found = blender.run(inside_animation, "_sprout", shutter)
    assert [difference for _walks, difference, _change in found] == [0.0] * 3
    assert found[1][2] > 0.05, found


def inside_switched_blur():
    """The largest differences of renders that keep what they read from those that do not, motion blur off and on."""
    import scenes
    scene = _scene('CENTER')
    _jolt(scene)
    scene.frame_set(2)
    pictures = {}
    for keeps in (True, False):
        scene.render.use_persistent_data = keeps
        pictures[keeps] = []
        for is_on in (False, True, False, True):
            scene.render.use_motion_blur = is_on
            pictures[keeps].append(scenes.render())
    changes = [float(abs(after - before).max()) for before, after in zip(pictures[False], pictures[False][1:])]
    return [float(abs(a - b).max()) for a, b in zip(*pictures.values())], min(changes)


def test_motion_blur_may_be_switched(blender):
    differences, least_change = blender.run(inside_switched_blur)
    assert differences == [0.0] * 4 and least_change > 0.0


def inside_warnings():
    """What two renders of an unchanged scene warn of."""
    import bpy
    import scenes
    _scene()
    volume = bpy.data.objects.new("Cloud", bpy.data.volumes.new("Cloud"))
    bpy.context.scene.collection.objects.link(volume)
    from volley import session
    report, told = session.report_warning, []
    session.report_warning = lambda _engine, message: told.append(message)
    scenes.render()
    first = list(told)
    scenes.render()
    session.report_warning = report
    return first, told[len(first):]


def test_renders_of_what_is_kept_warn_again(blender):
    first, second = blender.run(inside_warnings)
    assert any("Volumes" in message for message in first) and second == first


def inside_collections():
    """Whether Python collects within a sync and after it, where it did before and where it did not."""
    import gc
    import scenes
    from volley.sync import walk
    _scene()
    run, seen = walk.Walk.run, []

    def watched(self, former):
        seen.append(gc.isenabled())
        run(self, former)

    walk.Walk.run = watched
    try:
        for collects in (True, False):
            (gc.enable if collects else gc.disable)()
            scenes.render()
            seen.append(gc.isenabled())
    finally:
        gc.enable()
        walk.Walk.run = run
    return seen


def test_python_does_not_collect_within_a_sync(blender):
    assert blender.run(inside_collections) == [False, True, False, False]

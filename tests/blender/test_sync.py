# SPDX-License-Identifier: Apache-2.0
"""What is copied out of Blender: meshes, instances, visibility, motion. No rendering."""

import blender as blender_support
import pytest


class _Recorder:
    """Stands for the library's scene and writes down what it is told."""

    def __init__(self):
        self.calls, self._last = [], 0

    def __getattr__(self, name):
        def call(*arguments, **values):
            self.calls.append((name, arguments, values))
            self._last += 1
            return self._last
        return call

    def all(self, name):
        return [(arguments, values) for called, arguments, values in self.calls if called == name]


def _sync(changes=None, sync=None):
    """Sync the current scene into a recorder; the sync and what it sent."""
    import bpy
    from volley.sync import SceneSync, Source
    from volley.sync.changes import Changes
    if sync is None:
        sync = SceneSync(True, 0, True, make_scene=lambda *_: _Recorder())
    sync.scene.calls.clear()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    sync.update(Source(depsgraph, changes or Changes.everything()))
    return sync, sync.scene


def inside_meshes():
    import bpy
    import numpy as np
    import scenes
    scenes.empty()
    red, green = scenes.emitter((1, 0, 0), "Red"), scenes.emitter((0, 1, 0), "Green")
    wall = scenes.mesh("Two", [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (2, 0, 0), (2, 0, 1)],
                       [(0, 1, 2, 3), (1, 4, 5, 2)], red)
    wall.data.materials.append(green)
    wall.data.polygons[1].material_index = 1
    wall.data.polygons[1].use_smooth = True
    again = scenes.link("Again", wall.data)
    again.scale = (-1, 1, 1)
    again.material_slots[0].link = 'OBJECT'
    again.material_slots[0].material = green
    again.visible_shadow = again.visible_glossy = False
    again.pass_index = 7
    hidden = scenes.link("Hidden", wall.data)
    hidden.hide_viewport = True  # the depsgraph of a test is the viewport's
    scenes.link("Empty mesh", bpy.data.meshes.new("Nothing"))
    collection = bpy.data.collections.new("Group")
    collection.objects.link(wall)
    for x in range(3):
        instancer = scenes.link(f"Instancer{x}", None)
        instancer.instance_type, instancer.instance_collection = 'COLLECTION', collection
        instancer.location.x = 10.0 + x
    bpy.ops.object.text_add()
    bpy.ops.object.metaball_add()
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.data.bevel_depth = 0.1
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    _, told = _sync()
    meshes = told.all("create_mesh")
    shared = next(arguments for arguments, _ in meshes if len(arguments[1]) == 4)
    instances = [(v["mesh"], np.array(v["transforms"]).reshape(-1, 3, 4)[0], v["materials"],
                  v["visibility"], v["pass_index"]) for _, v in told.all("create_instance")]
    return {"count": len(meshes), "index": shared[5].tolist(), "normal_kind": shared[3],
            "smooth": None if shared[4] is None else shared[4].tolist(), "instances": instances}


def test_meshes_are_shared_and_complete(blender):
    found = blender.run(inside_meshes)
    assert found["count"] == 5  # one shared by five instances; text, metaball, curve, surface
    assert found["index"] == [0, 0, 1, 1]
    # Flat and smooth faces together: flags per face, or (4.1 on) normals per corner.
    assert (found["normal_kind"], found["smooth"]) in ((1, [0, 0, 1, 1]), (2, None))
    shared = found["instances"][0][0]
    of_shared = [each for each in found["instances"] if each[0] == shared]
    assert len(of_shared) == 5 and len(found["instances"]) == 9
    plain, mirrored = of_shared[0], next(each for each in of_shared if each[4] == 7)
    assert mirrored[1][0, 0] == -1.0 and plain[1][0, 0] == 1.0
    assert mirrored[2][0] == mirrored[2][1] == plain[2][1] != plain[2][0]
    assert mirrored[3] == 31 & ~(4 | 16) and plain[3] == 31
    assert sorted(each[1][0, 3] for each in of_shared if each[1][0, 3] > 5) == [10.0, 11.0, 12.0]


def inside_normals():
    import math
    import bpy
    import numpy as np
    import scenes
    scenes.empty()
    bpy.ops.mesh.primitive_cylinder_add(vertices=32)
    cylinder = bpy.context.object
    kinds = {}

    def look(name):
        _, told = _sync()
        arguments = told.all("create_mesh")[0][0]
        kinds[name] = (arguments[3], None if arguments[2] is None else np.array(arguments[2][0]),
                       np.array(arguments[1]), np.array(arguments[0][0]))

    look("flat")
    for polygon in cylinder.data.polygons:
        polygon.use_smooth = True
    look("smooth")
    if hasattr(cylinder.data, "use_auto_smooth"):
        cylinder.data.use_auto_smooth, cylinder.data.auto_smooth_angle = True, math.radians(30)
    else:
        cylinder.data.set_sharp_from_angle(angle=math.radians(30))
    look("auto")
    return kinds


def test_normals_are_what_blender_shades_with(blender):
    import numpy as np
    kinds = blender.run(inside_normals)
    assert kinds["flat"][0] == 0 and kinds["flat"][1] is None
    assert kinds["smooth"][0] == 1 and kinds["smooth"][1].shape == (64, 3)
    kind, normals, indices, positions = kinds["auto"]
    assert kind == 2 and normals.shape == (len(indices) * 3, 3)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)
    corners = positions[indices.reshape(-1)]
    on_caps = np.abs(normals[:, 2]) > 0.99
    assert on_caps.any() and (~on_caps).any()
    radial = corners[~on_caps, :2]
    assert np.allclose(normals[~on_caps, :2], radial / np.linalg.norm(radial, axis=1)[:, None], atol=2e-2)


def inside_memory():
    """Values as they lie in memory beside those Blender copies; what a misfit gives."""
    import bpy
    import numpy as np
    import scenes
    from volley.sync import mesh
    scenes.empty()
    data = scenes.sphere().data
    count = len(data.vertices)
    normals = np.empty(count * 3, np.float32)
    data.vertex_normals.foreach_get("vector", normals)
    corners = np.empty(len(data.loops), np.uint32)
    data.loops.foreach_get("vertex_index", corners)
    fits = {"normals": np.array_equal(mesh.memory_of(data.vertex_normals, "vector", 3, np.float32),
                                      normals.reshape(count, 3)),
            "corners": np.array_equal(mesh.memory_of(data.loops, "vertex_index", 1, np.uint32)[:, 0],
                                      corners)}
    too_wide = mesh.memory_of(data.vertex_normals, "vector", 4, np.float32)
    other = mesh.memory_of(data.loops, "edge_index", 1, np.uint32)
    topology = mesh.Topology(data)
    before = topology.is_of(data)
    data.polygons[40].vertices = tuple(reversed(data.polygons[40].vertices))
    return {**fits, "too wide": too_wide is None, "other": other is None, "same": before,
            "turned": not topology.is_of(data)}


def test_memory_is_looked_at_only_where_it_fits(blender):
    assert all(blender.run(inside_memory).values())


def inside_resync():
    import bpy
    import scenes
    scenes.empty()
    sphere = scenes.sphere(material=scenes.emitter((1, 0, 0)))
    lamp = scenes.light(energy=10.0)
    sync, _ = _sync()
    told = {}

    def names(label):
        _, scene = _sync(sync=sync)
        told[label] = sorted({name for name, _, _ in scene.calls} - {"set_world"})

    names("nothing")
    sphere.location.x = 1.0
    names("moved")
    sphere.data.vertices[0].co.x += 0.01
    sphere.data.update()
    names("posed")
    sphere.modifiers.new("Subdivision", 'SUBSURF')
    names("topology")
    sphere.active_material.node_tree.nodes["Emission"].inputs["Strength"].default_value = 3.0
    names("material")
    lamp.data.energy = 20.0
    names("light")
    bpy.data.objects.remove(sphere)
    names("deleted")
    return told


def test_a_second_sync_sends_only_what_differs(blender):
    told = blender.run(inside_resync)
    assert told["nothing"] == []
    assert told["moved"] == ["move_instances"]
    assert told["posed"] == ["update_mesh"]
    assert told["topology"] == ["create_mesh", "destroy_mesh", "update_instance"]
    assert told["material"] == ["update_material"]
    assert told["light"] == ["update_light"]
    assert told["deleted"] == ["destroy_instance", "destroy_material", "destroy_mesh"]


def inside_motion(position):
    """A cube that moves 10 m a frame and grows by a shape key, a mesh built face by face and its points."""
    import bpy
    import numpy as np
    import scenes
    from volley import abi, native
    scenes.empty()
    made = scenes.camera()
    made.keyframe_insert("location", frame=1)
    made.location.z = 2.0
    made.keyframe_insert("location", frame=3)
    cube = scenes.wall(material=scenes.emitter((1, 1, 1)))
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="Wide")
    key.data[0].co.x -= 8.0
    for frame, value in ((1, 0.0), (3, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
        cube.location.x = value * 20.0
        cube.keyframe_insert("location", frame=frame)
    built = scenes.sphere("Built")
    dotted = scenes.sphere("Dotted")
    for changing in (built, dotted):
        modifier = changing.modifiers.new("Build", 'BUILD')
        modifier.frame_start, modifier.frame_duration = 0, 4
    scenes.geometry_nodes(dotted, "GeometryNodeMeshToPoints")
    for animated in (*bpy.data.objects, *bpy.data.shape_keys):
        for curve in scenes.curves(animated) if animated.animation_data else ():
            for point in curve.keyframe_points:
                point.interpolation = 'LINEAR'
    scene = bpy.context.scene
    scene.frame_set(2)
    scenes.set_shutter(scene, position)
    cube.cycles.motion_steps = 3
    told, original = _Recorder(), native.Scene
    told.stats_features = []

    class Stop(Exception):
        pass

    def stop(*_, **__):
        raise native.TracerError(abi.StatusCode.ERROR_CANCELLED, "stopped by the test")

    told.commit = stop
    told.warnings = lambda: []
    native.Scene = lambda *_: told
    from volley.sync import SceneSync
    warnings = []
    original_destroy = SceneSync.destroy

    def destroy(self):
        warnings.extend(self.warnings.take())
        original_destroy(self)

    SceneSync.destroy = destroy
    bpy.ops.render.render()
    native.Scene, SceneSync.destroy = original, original_destroy
    moving = [np.array(v["transforms"]).reshape(-1, 12)[:, 3].tolist() for _, v in
              told.all("create_instance")]
    shapes = [np.array(a[0])[:, 0, 0].tolist() for a, _ in told.all("create_mesh")]
    camera = told.all("set_camera")[0]
    return {"moving": moving, "shapes": shapes, "frame": scene.frame_current_final,
            "camera_z": [t[11] for t in camera[0][0]], "shutter": camera[1]["shutter_time"],
            "warnings": warnings}


@pytest.mark.parametrize("position, start", [('CENTER', 1.75), ('START', 2.0), ('END', 1.5)])
def test_motion_keys_follow_the_shutter(blender, position, start):
    found = blender.run(inside_motion, position)
    times = [start + 0.5 * i / 8 for i in range(9)]
    moving = next(keys for keys in found["moving"] if len(keys) == 9)
    assert moving == pytest.approx([(t - 1.0) * 10.0 for t in times], abs=1e-3)
    deforming = next(keys for keys in found["shapes"] if len(keys) == 9)
    assert deforming == pytest.approx([-1.0 - (t - 1.0) * 4.0 for t in times], abs=1e-3)
    assert found["camera_z"] == pytest.approx([(t - 1.0) for t in times[::4]], abs=1e-3)
    assert found["shutter"] == 0.5 and found["frame"] == 2.0
    for name in ("Built", "Dotted"):
        assert [w for w in found["warnings"] if name in w and "topology" in w]


def inside_tangents():
    """Which of two walls bring tangents (width 4): of plain and normal-mapped materials, and after
    edits."""
    import bpy
    import scenes
    from volley.sync.changes import Changes
    scenes.empty()
    plain, mapped = scenes.emitter((1, 1, 1), "Plain"), scenes.emitter((1, 1, 1), "Mapped")
    walls = [scenes.wall("Left", material=plain), scenes.wall("Right", 3.0, material=mapped)]
    for wall in walls:
        wall.data.uv_layers.new()
    sync, told, found = None, None, {}

    def map_normals(material):
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(node.outputs[0], tree.nodes["Emission"].inputs["Color"])

    def look(name, *touched):
        nonlocal sync, told
        changes = Changes() if touched else None
        for each in touched:
            getattr(changes, "objects" if each in bpy.data.objects.values() else "materials").add(each.name)
        sync, told = _sync(changes, sync)
        # Their width tells walls apart.
        found[name] = sorted((int(arguments[0][0][:, 0].max()), [v.shape[1] for _, v in arguments[6]])
                             for arguments, _ in told.all("create_mesh"))

    look("none")
    map_normals(mapped)
    look("one", mapped)
    map_normals(plain)
    look("both", plain)
    return found


def test_tangents_are_made_where_they_are_read(blender):
    found = blender.run(inside_tangents)
    assert found["none"] == [(1, []), (1, [])]
    assert found["one"] == [(1, [4])]
    assert found["both"] == [(1, [4])]


def inside_attributes():
    import bpy
    import numpy as np
    import scenes
    from volley.sync import mesh
    scenes.empty()
    wall = scenes.mesh("Wall", [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (2, 0, 0), (2, 0, 1)],
                       [(0, 1, 2, 3), (1, 4, 5, 2)])
    data = wall.data
    second, _, default = (data.uv_layers.new(name=name) for name in ("Second", "Other", "UVMap"))
    for i, loop in enumerate(second.data):
        loop.uv = (i * 0.1, 0.5)
    default.active_render = True
    paint = data.color_attributes.new("Paint", 'FLOAT_COLOR', 'POINT')
    for i, item in enumerate(paint.data):
        item.color = (i * 0.25, 0.5, 0.75, 1.0)
    value = data.attributes.new("Value", 'FLOAT', 'FACE')
    value.data[0].value, value.data[1].value = 0.625, 0.25
    evaluated = wall.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    taken = mesh.extract(evaluated, {"", "Second", "Missing"}, {"Paint", "Value", "Nothing", ""})
    loops, vertices = np.empty(12, np.int32), np.empty(12, np.int32)
    evaluated.loop_triangles.foreach_get("loops", loops)
    evaluated.loop_triangles.foreach_get("vertices", vertices)
    return [(name, values.tolist()) for name, values in taken.attributes], loops.tolist(), vertices.tolist()


def test_attributes_in_triangle_order(blender):
    attributes, loops, vertices = blender.run(inside_attributes)
    assert [name for name, _ in attributes] == ["UVMap", "Second", "", "Paint", "Value"]
    by_name = dict(attributes)
    assert by_name["Second"] == [pytest.approx([loop * 0.1, 0.5]) for loop in loops]
    assert by_name["Paint"] == [pytest.approx([vertex * 0.25, 0.5, 0.75, 1.0]) for vertex in vertices]
    assert by_name["Value"] == [pytest.approx([value, value, value, 1.0]) for value in (0.625, 0.25)
                                for _ in range(6)]
    assert by_name[""] == by_name["Paint"]


def inside_hidden_flags():
    import bpy
    import scenes
    from volley import abi
    scene = scenes.empty()
    scenes.wall("Seen")
    scenes.wall("Holdout").is_holdout = True
    layer = bpy.context.view_layer
    indirect = bpy.data.collections.new("Indirect")
    scene.collection.children.link(indirect)
    far = scenes.wall("Far")
    scene.collection.objects.unlink(far)
    indirect.objects.link(far)
    layer.layer_collection.children["Indirect"].indirect_only = True
    bpy.context.view_layer.update()
    _, told = _sync()
    holdout = {number + 1 for number, (name, _, values) in enumerate(told.calls)
               if name == "create_material" and values.get("flags", 0) & abi.MaterialFlags.CUTS_OUT}
    return sorted((v["visibility"], set(v["materials"]) <= holdout and bool(v["materials"]))
                  for _, v in told.all("create_instance"))


def test_holdout_and_indirect_only(blender):
    # A hole is two instances, one for the camera and one for all other rays.
    assert blender.run(inside_hidden_flags) == [(1, True), (30, False), (30, False), (31, False)]


def inside_edit_costs():
    import random
    import bpy
    import edits
    from volley.sync.changes import Changes
    edits.make_scene()
    sync, _ = _sync()
    told, random = {}, random.Random(1)

    def mark(_scene, depsgraph):
        changes.follow(depsgraph)

    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(mark)
    for edit in (edits.pose, edits.transform, edits.material, edits.light_energy, edits.move_light,
                 edits.world, edits.ray_visibility):
        changes = Changes()
        edit(random)
        bpy.context.view_layer.update()
        sync, recorder = _sync(changes, sync)
        told[edit.__name__] = [name for name, _, _ in recorder.calls]
    return told


def test_an_edit_sends_what_it_touches(blender):
    assert blender.run(inside_edit_costs) == {
        "pose": ["update_mesh"], "transform": ["move_instances"], "material": ["update_material"],
        "light_energy": ["update_light"], "move_light": ["update_light"], "world": ["update_material"],
        "ray_visibility": ["update_instance"]}


def inside_structural_reads():
    """The objects that are described after edits that name the scene, by edit."""
    import random
    import bpy
    import edits
    from volley.sync import instance
    from volley.sync.changes import Changes
    edits.make_scene()
    sync, _ = _sync()
    describe, described, random = instance.describe, [], random.Random(1)

    def noted(each, *arguments):
        described.append(each.object.name)
        return describe(each, *arguments)

    def mark(_scene, depsgraph):
        changes.follow(depsgraph)

    def select(_random):
        bpy.data.objects["Ball"].select_set(True)

    def lone_instance(_random):
        bpy.data.objects["Crates"].location.x = 0.5

    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(mark)
    instance.describe = noted
    found = {}
    for edit in (select, edits.add, edits.delete, edits.node_group, edits.image, lone_instance, edits.move_middle):
        changes = Changes()
        edit(random)
        bpy.context.view_layer.update()
        described.clear()
        sync, _ = _sync(changes, sync)
        found[edit.__name__] = sorted(each for each in described if not each.startswith("Light"))
    instance.describe = describe
    return found


def test_an_edit_of_the_scene_reads_what_it_names(blender):
    """Blender 4 names all objects where one comes or goes, as lights may be linked, and those whose materials shade
    otherwise."""
    found = blender.run(inside_structural_reads)
    shaded = blender_support.version() >= (4, 0)
    if shaded:
        found["add"], found["delete"] = ["New"] * ("New" in found["add"]), []
    assert found == {"select": [], "add": ["New"], "delete": [], "node_group": ["Tube"] * shaded,
                     "image": ["Back"] * shaded,
                     "lone_instance": ["Lid", "Lid"], "move_middle": ["Lid"]}


def inside_swapped_names():
    """Whether everything is to be looked at again after names were swapped, without and with a new shape between."""
    import bpy
    import edits
    from volley.sync.changes import Changes
    edits.make_scene()
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(lambda _scene, depsgraph: changes.follow(depsgraph))
    found = []
    for edit in (lambda _random: None, edits.shading):
        changes = Changes()
        edits.swap_names(None)
        edit(None)
        bpy.context.view_layer.update()
        edits.swap_names(None)
        bpy.context.view_layer.update()
        found.append(changes.full)
    return found


def test_a_shape_is_of_the_object_that_had_the_name(blender):
    assert blender.run(inside_swapped_names) == [False, True]


def inside_originals():
    import bpy
    import scenes
    from volley.sync.source import Originals
    scenes.empty()
    names = [scenes.link(f"Object{number}", None).name for number in range(20)]
    originals = Originals()
    return all(originals.get(name) == bpy.data.objects[name] for name in names), originals.get("None such") is None


def test_objects_are_found_by_name(blender):
    assert blender.run(inside_originals) == (True, True)


def inside_edited_topology():
    """What is sent when a face is turned while the mesh is posed, in ways that mark different things."""
    import random
    import bmesh
    import bpy
    import edits
    from volley.sync.changes import Changes
    edits.make_scene()
    sync, _ = _sync()
    data, told = bpy.data.objects["Tube"].data, []

    def mark(_scene, depsgraph):
        changes.follow(depsgraph)

    def turn_in_place():
        data.polygons[5].vertices = tuple(reversed(data.polygons[5].vertices))
        data.update()

    def turn_untold():
        editable = bmesh.new()
        editable.from_mesh(data)
        editable.faces.ensure_lookup_table()
        bmesh.ops.reverse_faces(editable, faces=[editable.faces[3]])
        editable.to_mesh(data)
        editable.free()

    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(mark)
    for turn in (turn_in_place, turn_untold, lambda: None):
        changes = Changes()
        turn()
        edits.pose(random.Random(len(told)))
        bpy.context.view_layer.update()
        sync, recorder = _sync(changes, sync)
        told.append({name for name, _, _ in recorder.calls} & {"create_mesh", "update_mesh"})
    return told


def test_a_pose_with_other_faces_sends_them(blender):
    assert blender.run(inside_edited_topology) == [{"create_mesh"}, {"create_mesh"}, {"update_mesh"}]

# SPDX-License-Identifier: Apache-2.0
"""Adaptive subdivision beside Cycles', shown by emissions of normals and positions: how far apart the means are of
whole pictures and of their tiles."""

import blender as blender_support
import numpy as np
from reliefs import Tree, noise, stage

SAMPLES = 16
TILE = 16
PANORAMAS = {"equirectangular": {"panorama_type": 'EQUIRECTANGULAR'},
             "equidistant": {"panorama_type": 'FISHEYE_EQUIDISTANT', "fisheye_fov": 1.5}}


# Inside Blender ------------------------------------------------------------------------------------

def _tree(shown, scale=0.0, kind="NewGeometry"):
    """A material that shows an output of a node, displaced by noise."""
    tree = Tree()
    tree.show(tree.add(kind), shown)
    tree.displace(tree.add("Displacement", Height=noise("Object", 2.0)(tree), Scale=scale), 'DISPLACEMENT')
    return tree.material


def _make(shape, levels=0, kind='CATMULL_CLARK', has_other=False, **settings):
    """A plane or a cube that is subdivided adaptively, maybe on top of another modifier, which does nothing."""
    import bpy
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(**settings)
    made = bpy.context.object
    for polygon in made.data.polygons:
        polygon.use_smooth = True
    if has_other:
        made.modifiers.new("Cast", 'CAST').factor = 0.0
    modifier = made.modifiers.new("Subdivision", 'SUBSURF')
    modifier.levels = modifier.render_levels = levels
    modifier.subdivision_type = kind
    if hasattr(modifier, "use_adaptive_subdivision"):
        modifier.use_adaptive_subdivision = True
    else:
        bpy.context.scene.cycles.feature_set = 'EXPERIMENTAL'
        made.cycles.use_adaptive_subdivision = True
    return made


def _crease(made, of_edges=None, of_vertices=None):
    """Creases by the numbers of edges or vertices; all others are smooth."""
    import bmesh
    mesh = bmesh.new()
    mesh.from_mesh(made.data)
    for items, name, values in (mesh.edges, "crease_edge", of_edges), (mesh.verts, "crease_vert", of_vertices):
        if not values:
            continue
        layers = items.layers
        if hasattr(layers, "crease"):
            layer = layers.crease.verify()
        else:
            layer = layers.float.get(name) or layers.float.new(name)
        for item in items:
            item[layer] = values.get(item.index, 0.0)
    mesh.to_mesh(made.data)
    mesh.free()
    made.data.update()


def _by_both(made, material):
    import scenes
    made.data.materials.append(material)
    return scenes.by_both(SAMPLES)


def inside_pictures():
    import math
    import bpy
    pictures = {}
    ground = {"location": (0.0, -5.0, 1.0), "rotation": (math.radians(75.0), 0.0, 0.0), "lens": 35.0}
    for name, kind in (("ground, simple", 'SIMPLE'), ("ground, Catmull-Clark", 'CATMULL_CLARK')):
        stage(**ground)
        pictures[name] = _by_both(_make("plane", kind=kind, size=12.0), _tree("Normal", 0.6))
    for levels in (0, 1, 2):
        stage()
        made = _make("cube", levels, rotation=(0.3, 0.2, 0.5))
        pictures[f"sphere, level {levels}"] = _by_both(made, _tree("Normal", 0.3))
        stage()
        made = _make("cube", levels, rotation=(0.3, 0.2, 0.5))
        pictures[f"smooth, level {levels}"] = _by_both(made, _tree("UV", kind="TexCoord"))
        stage()
        made = _make("cube", levels, has_other=True, rotation=(0.3, 0.2, 0.5))
        pictures[f"on another, level {levels}"] = _by_both(made, _tree("Normal"))
    stage(type='ORTHO', ortho_scale=4.0)
    bpy.context.scene.cycles.dicing_rate = 8.0
    pictures["coarse"] = _by_both(_make("cube", size=3.0), _tree("Position"))
    for name, settings in PANORAMAS.items():
        stage(type='PANO', location=(0.0, 0.0, 2.2), rotation=(0.0, 0.0, 0.0))
        data = bpy.context.scene.camera.data
        for key, value in settings.items():
            setattr(data if hasattr(data, key) else data.cycles, key, value)
        bpy.context.scene.cycles.dicing_rate = 1.0 if name == "equirectangular" else 3.0  # small there
        pictures[name] = _by_both(_make("cube", size=3.0), _tree("Position"))
    return pictures


def inside_creases():
    import bpy
    ring = (0, 1, 2, 3)  # around one side of the cube
    cases = {"sharp": {"of_edges": dict.fromkeys(ring, 1.0)}, "firm": {"of_edges": dict.fromkeys(ring, 0.6)},
             "soft": {"of_edges": dict.fromkeys(ring, 0.3)},
             "fraction": {"of_edges": {0: 0.05, 1: 0.05, 2: 0.15, 3: 0.15, 4: 0.25, 9: 0.25}},
             "all edges": {"of_edges": dict.fromkeys(range(12), 1.0)},
             "corners": {"of_edges": {**dict.fromkeys(ring, 1.0), 4: 0.12, 9: 0.2}},
             "vertices": {"of_vertices": {0: 0.3, 3: 0.2, 5: 0.07, 6: 0.2}},
             "spike": {"of_vertices": {0: 1.0}},
             "level 2": {"of_edges": dict.fromkeys(ring, 1.0), "of_vertices": {5: 0.2}, "levels": 2},
             "off": {"of_edges": dict.fromkeys(ring, 1.0), "use_creases": False},
             "plane": {"shape": "plane", "of_edges": {0: 1.0, 1: 1.0, 2: 0.2, 3: 0.2}}}
    pictures = {}
    for name, case in cases.items():
        stage()
        made = _make(case.get("shape", "cube"), case.get("levels", 0), rotation=(0.3, 0.2, 0.5))
        made.modifiers[-1].use_creases = case.get("use_creases", True)
        _crease(made, case.get("of_edges"), case.get("of_vertices"))
        bpy.context.view_layer.update()
        pictures[name] = _by_both(made, _tree("Normal"))
    return pictures


def inside_settings():
    """{name: fields of a plane with one setting changed, None where it is not diced, warnings, and creases}"""
    import bpy
    from volley.sync import camera, dicing
    from volley.log import Warnings
    found = {}

    def look(name, is_final=True):
        bpy.context.scene.update_tag()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        scene, warnings = depsgraph.scene_eval, Warnings()
        lens, frame = camera.lens_of(scene.camera, warnings), camera.frame_of(scene.render)
        keys = camera.CameraKeys(lens, [camera.rows12(scene.camera.matrix_world)], [camera.window(lens, frame)])
        shown = dicing.Dicing(scene, keys, frame, is_final, warnings)
        for each in depsgraph.object_instances:  # which lasts no longer than its turn
            if each.object.type == 'MESH':
                fields = shown.fields_of(each)
                creases = shown.creases_of(each, each.object.data, fields) if fields else {}
                found[name] = (fields, list(warnings.take()),
                               {field: values.tolist() for field, values in creases.items()})

    stage()
    made, settings = _make("plane"), bpy.context.scene.cycles
    modifier = made.modifiers[-1]
    look("plain")
    look("preview", is_final=False)
    settings.dicing_rate = 3.0
    look("rate")
    settings.dicing_rate, settings.max_subdivisions, settings.offscreen_dicing_scale = 1.0, 5, 2.0
    look("limits")
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    other.location, other.data.lens = (1.0, 2.0, 3.0), 42.5
    settings.dicing_camera = other
    look("camera")
    settings.dicing_camera = None
    _crease(made, {0: 0.0}, {1: 0.0})
    look("creases of 0")
    _crease(made, {1: 1.0, 2: 0.25}, {1: 0.5})
    look("creases")
    modifier.use_creases = False
    look("no creases")
    modifier.subdivision_type = 'SIMPLE'
    look("creases, simple")
    modifier.subdivision_type = 'CATMULL_CLARK'
    modifier.show_render = False
    look("hidden")
    modifier.show_render = True
    if hasattr(modifier, "adaptive_space"):
        modifier.adaptive_space, modifier.adaptive_object_edge_length = 'OBJECT', 0.25
        look("length")
        modifier.levels = modifier.render_levels = 1
        look("alone, level 1")
        made.modifiers.new("Cast", 'CAST').factor = 0.0
        made.modifiers.move(1, 0)
        look("level 1")
        modifier.levels = modifier.render_levels = 2
        look("level 2")
        modifier.use_creases = True
        look("level 2, creases")
        modifier.use_adaptive_subdivision = False
    else:
        settings.feature_set = 'SUPPORTED'
    look("off")
    return found


def inside_edits():
    """Of each edit, the mean difference of what is followed from a fresh picture and of that from the one before,
    and how many meshes were sent anew."""
    import bpy
    from follower import Follower, picture
    from volley.sync import SceneSync
    from volley.sync.changes import Changes
    stage()
    made, settings = _make("cube", rotation=(0.3, 0.2, 0.5)), bpy.context.scene.cycles
    made.data.materials.append(_tree("Normal", 0.3))
    settings.preview_dicing_rate = 16.0
    follower, found = Follower(), {}
    former, ids = follower.picture(), set(follower.sync._meshes.ids().values())

    def look(name):
        nonlocal former, ids
        bpy.context.scene.update_tag()  # as the panels do
        bpy.context.view_layer.update()
        followed, now = follower.picture(), set(follower.sync._meshes.ids().values())
        fresh_sync = SceneSync(is_final=False, thread_count=0, will_resync=False)
        fresh = picture(fresh_sync, Changes.everything())
        fresh_sync.destroy()
        found[name] = [float(np.abs(each - fresh).mean()) for each in (followed, former)] + [len(now - ids)]
        former, ids = fresh, now

    settings.preview_dicing_rate = 2.0
    look("rate")
    settings.max_subdivisions = 2
    look("limit")
    _crease(made, dict.fromkeys(range(4), 1.0))
    look("creases")
    made.modifiers[-1].levels = 1
    _crease(made, dict.fromkeys(range(4), 0.1))
    look("creases and levels")
    bpy.context.scene.render.film_transparent = True
    look("another setting")
    bpy.context.scene.camera.location.z += 3.0
    look("camera")
    return found


# Comparison ----------------------------------------------------------------------------------------

def _tiles(image):
    count = len(image) // TILE
    return image.reshape(count, TILE, count, TILE, -1).mean(axis=(1, 3))


def _differences(pictures):
    """{name: how far apart the means are of both pictures, and those of their tiles}"""
    found = {}
    for name, (ours, theirs) in pictures.items():
        ours, theirs = ours[..., :3], theirs[..., :3]
        mean = abs(ours.mean() / theirs.mean() - 1.0)
        tile = np.abs(_tiles(ours) - _tiles(theirs)).max() / theirs.mean()
        found[name] = float(mean), float(tile)
        print(f"{name}: means differ by {mean:.2%}, of tiles by up to {tile:.2%}, {theirs.mean():.3f}")
    return found


def test_creases(blender):
    is_isolated = blender_support.version() >= (5, 0)  # for three levels; Cycles rounds what is still sharp then
    for name, (mean, tile) in _differences(blender.run(inside_creases)).items():
        assert mean < 0.01, f"{name}: means differ by {mean:.2%}"
        worse = 2.0 if is_isolated and name == "spike" else 1.0
        assert tile < 0.08 * worse, f"{name}: those of tiles differ by up to {tile:.2%}"


def test_pictures(blender):
    found = _differences(blender.run(inside_pictures))
    is_curved = blender_support.version() >= (5, 0)  # on another modifier, not subdivided
    for name, (mean, tile) in found.items():
        worse = 2.5 if is_curved and name == "on another, level 1" else 1.0  # of which a warning tells
        assert mean < 0.01 * worse, f"{name}: means differ by {mean:.2%}"
        assert tile < 0.08 * worse, f"{name}: those of tiles differ by up to {tile:.2%}"


def test_viewport_follows_settings(blender):
    found = blender.run(inside_edits)
    for name in ("rate", "limit", "creases", "creases and levels"):
        error, change, sent = found[name]
        assert error == 0.0 and change > 1e-4 and sent == 1, (name, found)
    assert found["another setting"][2] == 0 and found["camera"][2] == 0, found


def test_settings(blender):
    found = blender.run(inside_settings)
    plain = found["plain"][0]
    assert plain["max_subdivisions"] == 12 and plain["offscreen_scale"] == 4.0
    assert np.isclose(plain["side"], 36.0 / 85.0 / 96.0)  # a pixel at a distance of 1
    assert np.isclose(found["preview"][0]["side"], 8.0 * plain["side"])
    assert np.isclose(found["rate"][0]["side"], 3.0 * plain["side"])
    assert (found["limits"][0]["max_subdivisions"], found["limits"][0]["offscreen_scale"]) == (5, 2.0)
    assert np.isclose(found["camera"][0]["side"], 2.0 * plain["side"])
    assert np.allclose(np.reshape(found["camera"][0]["object_to_camera"], (3, 4))[:, 3], (-1.0, -2.0, -3.0))
    assert found["hidden"][0] is None and found["off"][0] is None
    assert not found["plain"][1] and not found["creases"][1]
    assert found["plain"][2] == found["creases of 0"][2] == found["creases, simple"][2] == {}
    creases = found["creases"][2]
    assert sorted(creases["crease_sharpness"]) == [2.5, 10.0]
    corner, = set(creases["crease_edges"][0]) & set(creases["crease_edges"][1])
    expected = [0.0] * 4
    expected[1] += 5.0
    expected[corner] += 2.5  # of two edges: as the smoother one
    assert creases["vertex_sharpness"] == expected
    assert found["no creases"][2] == ({} if "length" in found else creases)  # Cycles 4.3 heeds them all the same
    if "length" in found:
        assert np.isclose(found["length"][0]["side"], 0.25)
        assert found["alone, level 1"][0]["surface"] == found["plain"][0]["surface"] != found["level 1"][0]["surface"]
        assert "too coarse for Cycles' surface" in found["level 1"][1][0]
        assert not found["alone, level 1"][1] and not found["level 2"][1]
        assert "creases are not those of Cycles" in found["level 2, creases"][1][0]

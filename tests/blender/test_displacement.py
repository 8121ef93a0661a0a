# SPDX-License-Identifier: Apache-2.0
"""The Displacement and Vector Displacement nodes beside Cycles': as bumps, as moved vertices, as both; shown
by emissions of the normal and the position, one sample in the middle of each pixel."""

import blender as blender_support
import numpy as np
from reliefs import Tree, check, noise, pictures_of, stage, waves

EDGES = 0.02  # of the pixels: where the outline of moved triangles runs, either engine may see what is behind


# Inside Blender ------------------------------------------------------------------------------------

def _tree(shown, kind="Displacement", space='OBJECT', method='BUMP', height=None, **inputs):
    """A material that shows an output of the Geometry node and is displaced by a node of that kind."""
    tree = Tree()
    tree.show(tree.add("NewGeometry"), shown)
    socket = "Height" if kind == "Displacement" else "Vector"
    node = tree.add(kind, {"space": space}, **{socket: (height or noise("Object"))(tree)}, **inputs)
    tree.displace(node, method)
    return tree.material


def _shape(subdivisions=5, smooth=True, **settings):
    import bpy
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions)
    made = bpy.context.object
    made.rotation_euler, made.scale = (0.3, 0.2, 0.5), (1.1, 1.1, 1.1)
    for polygon in made.data.polygons:
        polygon.use_smooth = smooth
    for name, value in settings.items():
        setattr(made, name, value)
    return made


def _color(tree):
    return noise("Object")(tree)[0], "Color"


def inside_bumps():
    import scenes
    stage()
    made = scenes.sphere()
    made.rotation_euler, made.scale = (0.3, 0.2, 0.5), (1.1, 1.1, 1.1)
    return pictures_of({
        "object space": _tree("Normal", Scale=0.1, Midlevel=0.3),
        "world space": _tree("Normal", space='WORLD', Scale=0.15),
        "UV": _tree("Normal", height=noise("UV", 8.0), Scale=0.1),
        "vector, object": _tree("Normal", "VectorDisplacement", height=_color, Scale=0.1),
        "vector, world": _tree("Normal", "VectorDisplacement", 'WORLD', height=_color, Scale=0.1),
        "vector, tangent": _tree("Normal", "VectorDisplacement", 'TANGENT', height=_color, Scale=0.1),
        "true normal": _tree("True Normal", Scale=0.2),
    }, made)


def inside_moved():
    stage()
    made = _shape()
    return pictures_of({
        "moved, normal": _tree("Normal", method='DISPLACEMENT', Scale=0.3),
        "moved, position": _tree("Position", method='DISPLACEMENT', Scale=0.3),
        "moved, world": _tree("Position", space='WORLD', method='DISPLACEMENT', Scale=0.3),
        "moved, vector": _tree("Position", "VectorDisplacement", 'OBJECT', 'DISPLACEMENT', _color, Scale=0.3),
        "moved, generated": _tree("Position", method='DISPLACEMENT', height=noise(""), Scale=0.3),
        "moved, image": _tree("Position", method='DISPLACEMENT', height=waves, Scale=0.5),
    }, made)


def inside_both():
    stage()
    return pictures_of({
        name: _tree("Normal", method='BOTH', height=noise(name), Scale=0.2)
        for name in ("Generated", "UV", "Object")}, _shape())


def inside_hair():
    """[[by Volley, by Cycles]] of hair of a material that moves vertices, and of the same without."""
    import scenes
    stage()
    skin = _shape(3)
    skin.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    hair = skin.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.radius_scale = 'HAIR', 60, 0.5, 0.05
    skin.show_instancer_for_render = False
    return list(pictures_of({scale: _tree("Position", method='DISPLACEMENT', Scale=scale)
                             for scale in (0.3, 0.0)}, skin).values())


def inside_meshes():
    """Flat faces, two materials of which one is moved, and two objects of one mesh."""
    import bpy
    import scenes
    pictures = {}
    stage()
    made = _shape(4, smooth=False)
    pictures.update(pictures_of({"flat": _tree("Normal", method='DISPLACEMENT', Scale=0.2)}, made))
    for name in ("Normal", "Position"):
        stage()
        made = _shape()
        made.data.materials.append(_tree(name, method='DISPLACEMENT', Scale=0.3))
        made.data.materials.append(_tree(name, Scale=0.0))
        for polygon in made.data.polygons:
            polygon.material_index = int(polygon.center.z > 0.0)
        pictures[f"two materials, {name}"] = scenes.by_both(1)
    stage(type='ORTHO', ortho_scale=5.0)
    made = _shape(location=(-1.2, 0.0, 0.0))
    made.data.materials.append(_tree("Position", method='DISPLACEMENT', Scale=0.3))
    other = scenes.link("Other", made.data)
    other.location = (1.2, 0.0, 0.0)
    pictures["two objects"] = scenes.by_both(1)
    return pictures


def inside_changes():
    """A moved sphere after its material, its transform and its method have changed: as a fresh render."""
    import bpy
    import scenes
    stage()
    scenes.set_engine('VOLLEY', 1)
    made = _shape(4)
    tree = _tree("Position", method='DISPLACEMENT', Scale=0.3)
    made.data.materials.append(tree)
    bpy.context.scene.render.use_persistent_data = True
    scenes.render()
    node = next(n for n in tree.node_tree.nodes if n.type == 'DISPLACEMENT')
    node.inputs["Scale"].default_value = 0.1
    made.location.x = 0.2
    kept = [scenes.render()]
    bpy.context.scene.render.use_persistent_data = False
    fresh = [scenes.render()]
    return kept, fresh


# Comparison ----------------------------------------------------------------------------------------

def test_bumps(blender):
    check(blender.run(inside_bumps), 0.005)


def test_moved_vertices(blender):
    check(blender.run(inside_moved), EDGES)


def test_both(blender):
    """Slopes are those of the mesh before it moved; Cycles 4 differs a little, by up to .28 of the pixels at
    1e-3 (coordinates of the object) and .006 at 1e-2."""
    tolerance = 1e-3 if blender_support.version() < (4, 0) else 1e-2
    check(blender.run(inside_both), EDGES, tolerance)


def test_hair_keeps_its_shape(blender):
    """Moved or not, it is the same to each engine."""
    moved, still = blender.run(inside_hair)
    for one, other in zip(moved, still):
        assert one[..., :3].std() > 0.05
        assert np.abs(one - other).max() < 1e-5


def test_meshes(blender):
    check(blender.run(inside_meshes), EDGES)


def test_changes(blender):
    kept, fresh = blender.run(inside_changes)
    assert all(np.array_equal(a, b) for a, b in zip(kept, fresh))

# SPDX-License-Identifier: Apache-2.0
"""The Bump node beside Cycles': the normal shown by an emission, one sample in the middle of each pixel,
and surfaces that are lit by it."""

import numpy as np
from reliefs import Tree, check, noise, pictures_of, stage, waves

SHARE_BEYOND = 0.005  # of the pixels


# Inside Blender ------------------------------------------------------------------------------------

def _bumped(height, **inputs):
    """A tree that shows the normal of a Bump node, whose height makes height(tree)."""
    tree = Tree()
    settings = {name: inputs.pop(name) for name in ("invert",) if name in inputs}
    bump = tree.add("Bump", settings, Height=height(tree), **inputs)
    tree.show(bump, "Normal")
    return tree.material


def _attribute(tree):
    return tree.add("Attribute", {"attribute_name": "Ramp"}), "Fac"


def _colors(tree):
    return tree.add("VertexColor", {"layer_name": "Tint"}), "Color"


def _parametric(tree):
    return tree.add("NewGeometry"), "Parametric"


def _wires(settings=(), **inputs):
    return lambda tree: (tree.add("Wireframe", settings, **inputs), "Fac")


def _gradient(tree):
    return tree.add("TexWave", {"wave_type": 'RINGS', "rings_direction": 'SPHERICAL'}, Scale=1.5,
                    Vector=(tree.add("TexCoord"), "Object")), "Fac"


def _mixed(tree):
    """What is constant, what is not, and the middle's use elsewhere."""
    height = noise("Object")(tree)
    ramp = tree.add("ValToRGB", Fac=height)
    power = tree.add("Math", {"operation": 'POWER'}, _0=height, _1=2.0)
    return tree.add("Mix", {"data_type": 'FLOAT'}, _0=0.4, _2=(ramp, 0), _3=(power, 0)), 0


def _chained():
    tree = Tree()
    first = tree.add("Bump", Height=noise("Object", 2.0)(tree), Distance=0.3)
    tree.show(tree.add("Bump", Height=_gradient(tree), Distance=0.1, Normal=(first, 0)), 0)
    return tree.material


def _after_normal_map():
    tree = Tree()
    normal_map = tree.add("NormalMap", Color=(0.7, 0.4, 0.8, 1.0))
    tree.show(tree.add("Bump", Height=noise("UV", 8.0)(tree), Distance=0.1, Normal=(normal_map, 0)), 0)
    return tree.material


def _fresnel():
    import bpy
    tree = Tree()
    # Beside Cycles 4 .53 % of the pixels differ at .05, a little more than may.
    distance = 0.05 if bpy.app.version < (4, 0, 0) else 0.04
    bump = tree.add("Bump", Height=noise("Object")(tree), Distance=distance)
    tree.show(tree.add("Fresnel", IOR=1.5, Normal=(bump, 0)), 0)
    return tree.material


def _shape(smooth=True):
    """A turned sphere, scaled evenly (Cycles scales normals before it bends them between corners), with a ramp
    of an attribute along X."""
    import scenes
    made = scenes.sphere(smooth=smooth)
    made.rotation_euler, made.scale = (0.3, 0.2, 0.5), (1.1, 1.1, 1.1)
    ramp = made.data.attributes.new("Ramp", 'FLOAT', 'POINT')
    ramp.data.foreach_set("value", [v.co.x ** 2 for v in made.data.vertices])
    tint = made.data.color_attributes.new("Tint", 'FLOAT_COLOR', 'POINT')
    for each, vertex in zip(tint.data, made.data.vertices):
        each.color = (vertex.co.x ** 2, vertex.co.y ** 2, vertex.co.z ** 2, 1.0)
    return made


HEIGHTS = {
    "noise, unasked": (noise(""), {"Distance": 0.2}),
    "noise, generated": (noise("Generated"), {"Distance": 0.2}),
    "noise, UV": (noise("UV", 8.0), {"Distance": 0.1}),
    "noise, object": (noise("Object"), {"Distance": 0.3, "Strength": 0.4}),
    "noise, camera": (noise("Camera"), {"Distance": 0.1, "invert": True}),
    "noise, normal": (noise("Normal"), {"Distance": 0.1}),
    "noise, window": (noise("Window", 8.0), {"Distance": 0.2}),
    "noise, position": (noise("Position"), {"Distance": 0.06, "Strength": 1.7}),
    "image": (waves, {"Distance": 0.3}),
    "attribute": (_attribute, {"Distance": 0.4}),
    "colors": (_colors, {"Distance": 0.4}),
    "parametric": (_parametric, {"Distance": 0.2}),
    "wires": (_wires(Size=0.1), {"Distance": 0.1}),
    "wires, pixels": (_wires({"use_pixel_size": True}, Size=3.0), {"Distance": 0.05}),
    "wave": (_gradient, {"Distance": 0.1}),
    "mixed": (_mixed, {"Distance": 0.1}),
}


def inside_normals():
    """{name: [by Volley, by Cycles]} of a smooth sphere."""
    import bpy
    stage()
    # Cycles 5 puts the steps of Window, along the picture's sides, with steps of the surface along others.
    left_out = {"noise, window"} if bpy.app.version >= (5, 0, 0) else set()
    materials = {name: _bumped(height, **inputs) for name, (height, inputs) in HEIGHTS.items()
                 if name not in left_out}
    materials.update(chained=_chained(), fresnel=_fresnel(), **{"after a normal map": _after_normal_map()})
    return pictures_of(materials, _shape())


def inside_places():
    """{name: [by Volley, by Cycles]} of other surfaces and cameras."""
    import bpy
    import scenes
    pictures = {}
    for name, camera in (("orthographic", {"type": 'ORTHO', "ortho_scale": 2.6}), ("flat", {})):
        stage(**camera)
        _shape(smooth=name != "flat").data.materials.append(_bumped(noise("UV", 8.0), Distance=0.1))
        pictures[name] = scenes.by_both(1)
    stage()
    bowl = _shape()
    bowl.rotation_euler.z += np.pi
    for kind in ("Object", "UV"):
        bowl.data.materials.clear()
        bowl.data.materials.append(_bumped(noise(kind, 3.0 if kind == "Object" else 8.0), Distance=0.1))
        bpy.context.scene.camera.data.clip_start = 6.0  # behind the front
        pictures[f"from behind, {kind}"] = scenes.by_both(1)
    return pictures


def inside_light():
    """{name: [by Volley, by Cycles]} of a lit surface, and of one in a mirror."""
    import bpy
    import scenes
    pictures = {}
    for name in ("diffuse", "glossy"):
        stage()
        scenes.light('SUN', rotation=(0.6, 0.3, 0.0), energy=1.0, angle=0.0)
        bpy.context.scene.cycles.light_sampling_threshold = 0.0  # what is faint is not left to chance
        tree = Tree()
        bump = tree.add("Bump", Height=noise("Object")(tree), Distance=0.06)
        kind, inputs = ("BsdfDiffuse", {}) if name == "diffuse" else ("BsdfGlossy", {"Roughness": 0.5})
        tree.surface(tree.add(kind, Normal=(bump, 0), **inputs))
        _shape().data.materials.append(tree.material)
        pictures[name] = scenes.by_both(1)
    stage()
    mirror = scenes.wall(size=6.0, material=scenes.material("Mirror", "ShaderNodeBsdfGlossy", Roughness=0.0))
    mirror.rotation_euler.z = 0.5
    made = _shape()
    made.location = (3.4, -2.2, 0.0)
    made.data.materials.append(_bumped(noise("Object"), Distance=0.1))
    pictures["in a mirror"] = scenes.by_both(1)
    return pictures


def inside_shadows():
    """{name: [by Volley, by Cycles]} of what lies in the light of surfaces whose transparency has pixels' widths."""
    import scenes
    pictures = {}
    for name, receiver, inputs in (("bumps", "Diffuse", {}), ("wires", "Diffuse", {}),
                                   ("wires, gloss", "Glossy", {"Roughness": 0.7})):
        stage()
        scenes.light('SUN', rotation=(1.2, 0.0, 0.3), energy=3.0, angle=0.0)
        scenes.wall(size=6.0, y=2.0, material=scenes.material("Lit", "ShaderNodeBsdf" + receiver, **inputs))
        tree = Tree()
        opaque = (tree.add("Wireframe", {"use_pixel_size": True}, Size=0.05), "Fac")
        if name == "bumps":
            bump = tree.add("Bump", Height=noise("Object")(tree), Distance=0.05)
            opaque = (tree.add("Fresnel", IOR=1.5, Normal=(bump, 0)), 0)
        clear, matt = tree.add("BsdfTransparent"), tree.add("BsdfDiffuse")
        tree.surface(tree.add("MixShader", _0=opaque, _1=(clear, 0), _2=(matt, 0)))
        made = _shape()
        made.data.materials.append(tree.material)
        made.visible_camera = made.visible_glossy = False
        pictures[name] = scenes.by_both(1)
    return pictures


def inside_normal_pass():
    """{name: [by Volley, by Cycles]} of the Normal pass: the mean of what all lobes have, weighted."""
    import bpy
    import scenes
    pictures = {}
    for name, (other, inputs) in {
            "bump": (None, {}),
            "transparent": ("BsdfTransparent", {}),
            "gloss": ("BsdfGlossy", {"Roughness": 0.5, "Color": (0.4, 0.4, 0.4, 1.0)}),
            "glass": ("BsdfGlass", {"Roughness": 0.6})}.items():
        stage()
        bpy.context.view_layer.use_pass_normal = True
        tree = Tree()
        bump = tree.add("Bump", Height=noise("Object")(tree), Distance=0.1)
        surface = tree.add("BsdfDiffuse", Normal=(bump, 0), Color=(0.8, 0.8, 0.8, 1.0))
        if other is not None:
            surface = tree.add("MixShader", _0=0.3, _1=(surface, 0), _2=(tree.add(other, **inputs), 0))
        tree.surface(surface)
        _shape().data.materials.append(tree.material)
        pictures[name] = [seeds[0, ..., :3] for seeds in scenes.passes_by_both(["Normal"], 1)["Normal"]]
    return pictures


# Comparison ----------------------------------------------------------------------------------------

def test_normals(blender):
    check(blender.run(inside_normals), SHARE_BEYOND)


def test_places(blender):
    check(blender.run(inside_places), SHARE_BEYOND)


def test_light(blender):
    check(blender.run(inside_light), SHARE_BEYOND)


def test_shadows(blender):
    check(blender.run(inside_shadows), SHARE_BEYOND)


def test_normal_pass(blender):
    check(blender.run(inside_normal_pass), 2 * SHARE_BEYOND)  # of normals themselves, not half of them

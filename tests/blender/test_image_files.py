# SPDX-License-Identifier: Apache-2.0
"""Images of several files, limited ones and projected ones against Cycles'."""

import itertools
import os

import numpy as np
import pytest

SIZE = 48


def _tile(path, width, seed):
    """Write a smooth picture of random colours."""
    import bpy
    image = bpy.data.images.new("Tile", width, width)
    rows = np.linspace(0.0, 1.0, width)
    random = np.random.default_rng(seed).uniform(0.1, 0.9, (2, 3))
    pixels = np.ones((width, width, 4), np.float32)
    pixels[..., :3] = random[0] + 0.4 * (rows[:, None, None] - rows[None, :, None]) * random[1]
    image.pixels.foreach_set(pixels.clip(0.0, 1.0).reshape(-1))
    image.filepath_raw, image.file_format = path, 'PNG'
    image.save()
    bpy.data.images.remove(image)


def _stage(image):
    """A wall that shows an image over UVs from 0.02 to 1.98; one sharp sample a pixel."""
    import bpy
    import scenes
    scene = scenes.empty(size=(SIZE, SIZE), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=2.0)
    scenes.sharpen()
    wall = scenes.wall(material=scenes.emitter((1.0, 1.0, 1.0)))
    for uv in wall.data.uv_layers[0].data:
        uv.uv = (1.96 * uv.uv[0] + 0.02, 1.96 * uv.uv[1] + 0.02)
    tree = wall.data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image()
    emission = next(n for n in tree.nodes if n.type == 'EMISSION')
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    return wall


def _both(samples=1):
    import scenes
    return [picture[..., :3] for picture in scenes.by_both(samples)]


def inside_tiles(is_packed):
    """Three of four tiles, of different sizes, by UDIM numbers; packed: and their files are gone."""
    import shutil
    import tempfile
    import bpy
    folder = tempfile.mkdtemp(prefix="volley_")

    def image():
        for number, width in ((1001, 64), (1002, 32), (1012, 128)):
            _tile(os.path.join(folder, f"t.{number}.png"), width, number)
        made = bpy.data.images.load(os.path.join(folder, "t.1001.png"))
        made.source = 'TILED'
        for number in (1002, 1012):
            if made.tiles.get(number) is None:
                made.tiles.new(number)
        made.filepath = os.path.join(folder, "t.<UDIM>.png")
        if is_packed:
            made.pack()
            shutil.rmtree(folder)
        return made
    _stage(image)
    return _both()


def inside_projections():
    """A turned sphere that shows an image in every projection over its generated coordinates."""
    import tempfile
    import bpy
    import scenes
    path = os.path.join(tempfile.mkdtemp(prefix="volley_"), "image.png")
    _tile(path, 32, 3)
    scenes.empty(size=(2 * SIZE, 2 * SIZE), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=2.2)
    scenes.sharpen()
    ball = scenes.sphere(material=scenes.emitter((1.0, 1.0, 1.0)))
    ball.rotation_euler = (0.5, 0.3, 0.7)
    tree = ball.data.materials[0].node_tree
    node, place = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeTexCoord")
    node.image = bpy.data.images.load(path)
    emission = next(n for n in tree.nodes if n.type == 'EMISSION')
    tree.links.new(place.outputs["Generated"], node.inputs["Vector"])
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    pictures = {}
    for projection, blend in (('FLAT', 0.0), ('BOX', 0.0), ('BOX', 0.4), ('BOX', 1.0), ('SPHERE', 0.0),
                              ('TUBE', 0.0)):
        node.projection, node.projection_blend = projection, blend
        pictures[projection, blend] = _both()
    return pictures


def _close(ours, theirs, tolerance=1e-3):
    assert theirs.std() > 0.03
    assert (np.abs(ours - theirs) > tolerance).any(axis=-1).mean() <= 0.005


@pytest.mark.parametrize("is_packed", (False, True), ids=("files", "packed"))
def test_tiles(blender, is_packed):
    ours, theirs = blender.run(inside_tiles, is_packed)
    _close(ours, theirs)
    assert "tiles" not in blender.output


def _noise_file(width):
    """An image from a file of noise."""
    import tempfile
    import bpy
    path = os.path.join(tempfile.mkdtemp(prefix="volley_"), "large.png")
    made = bpy.data.images.new("Noise", width, width)
    pixels = np.ones((width, width, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(1).uniform(0.0, 1.0, (width, width, 3))
    made.pixels.foreach_set(pixels.reshape(-1))
    made.filepath_raw, made.file_format = path, 'PNG'
    made.save()
    return bpy.data.images.load(path)


def inside_limit():
    """[Volley's, Cycles'] of noise as it is and where Simplify makes a quarter of its side."""
    import bpy
    _stage(lambda: _noise_file(512))
    scene = bpy.context.scene
    pairs = [_both()]
    scene.render.use_simplify, scene.cycles.texture_limit_render = True, '128'
    return pairs + [_both()]


def test_limit(blender):
    (full, _), (ours, theirs) = blender.run(inside_limit)
    assert full.std() > 2.0 * theirs.std()  # noise that is averaged
    _close(ours, theirs, 0.02)


def inside_rewritten():
    """[Volley's, Cycles'] of a file, and of what another program has made of it, in one session."""
    import tempfile
    import bpy
    import scenes
    path = os.path.join(tempfile.mkdtemp(prefix="volley_"), "image.png")

    def image():
        _tile(path, 32, 4)
        return bpy.data.images.load(path)
    _stage(image)
    pictures = []
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, 1)
        # Cycles would go on with the file as it was.
        bpy.context.scene.render.use_persistent_data = engine == 'VOLLEY'
        for seed in (5, 6):
            _tile(path, 32, seed)
            bpy.data.images["image.png"].reload()
            pictures.append(scenes.render()[..., :3])
    return pictures[::2], pictures[1::2]


def test_files_that_are_written_again(blender):
    before, after = blender.run(inside_rewritten)
    _close(*before)
    _close(*after)
    assert np.abs(before[1] - after[1]).max() > 0.1


def inside_read_beside_meshes(is_packed):
    """The calls of a render that make meshes, and that ask for a file and wait for it."""
    import contextlib
    from unittest import mock
    import bpy
    import scenes
    import volley.native
    _stage(lambda: _noise_file(64))
    if is_packed:
        bpy.data.images["large.png"].pack()
    calls = []

    def noted(name):
        method = getattr(volley.native.Scene, name)

        def call(*arguments, **values):
            calls.append(name)
            return method(*arguments, **values)
        return call
    with contextlib.ExitStack() as changes:
        for name in ("expect_image", "create_mesh", "update_image", "commit"):
            changes.enter_context(mock.patch.object(volley.native.Scene, name, noted(name)))
        return calls, scenes.render()


@pytest.mark.parametrize("is_packed", [False, True], ids=["file", "packed"])
def test_files_are_read_while_meshes_are(blender, is_packed):
    calls, picture = blender.run(inside_read_beside_meshes, is_packed)
    assert calls == ["expect_image", "create_mesh", "update_image", "commit"]
    assert picture[..., :3].std() > 0.05


def inside_full_disk():
    """Pictures of packed images that are copied, that are read one by one, and that cannot be copied, and copies that
    are left."""
    import tempfile
    from unittest import mock
    import bpy
    import scenes
    from volley.sync import image
    wall = _stage(lambda: _noise_file(64))
    bpy.data.images["large.png"].pack()
    second = bpy.data.images.new("Second", 16, 16)
    second.pack()
    tree = wall.data.materials[0].node_tree
    shown, node = tree.nodes["Image Texture"], tree.nodes.new("ShaderNodeTexImage")
    node.image = second
    added = tree.nodes.new("ShaderNodeVectorMath")
    tree.links.new(shown.outputs["Color"], added.inputs[0])
    tree.links.new(node.outputs["Color"], added.inputs[1])
    tree.links.new(added.outputs[0], next(n for n in tree.nodes if n.type == 'EMISSION').inputs["Color"])
    pictures, folder = [], tempfile.mkdtemp()
    for changes in ({}, {"_MAX_COPIED_BYTES": 0}, {"_write_copy": mock.Mock(side_effect=OSError("full"))}):
        with mock.patch.object(tempfile, "tempdir", folder), mock.patch.dict(vars(image), changes):
            pictures.append(scenes.render())
    return pictures, [name for name in os.listdir(folder) if not name.startswith("volley_")]  # but for pictures


def test_packed_files_where_there_is_no_room(blender):
    pictures, left = blender.run(inside_full_disk)
    assert pictures[0][..., :3].std() > 0.05
    assert (pictures[1] == pictures[0]).all() and np.abs(pictures[2] - pictures[0]).max() < 0.01
    assert not left and "magenta" not in blender.output


def inside_lost():
    """Volley's pictures of a file of text, which becomes an image, and again text, with persistent data."""
    import bpy
    import scenes
    _stage(lambda: _noise_file(64))
    path = bpy.data.images[0].filepath
    with open(path, "rb") as file:
        noise = file.read()
    bpy.context.scene.render.use_persistent_data = True
    pictures = []
    for content in (b"no image", noise, b"no image"):
        with open(path, "wb") as file:
            file.write(content)
        bpy.data.images[0].reload()
        pictures.append(scenes.render()[..., :3])
    return pictures


def test_files_that_cannot_be_read(blender):
    first, noise, last = blender.run(inside_lost)
    assert np.abs(first - (1.0, 0.0, 1.0)).max() < 1e-6 and (last == first).all()
    assert noise.std() > 0.05
    assert "magenta is used" in blender.output


def inside_memory():
    """Noise of 4 MiB and its levels within 2 MiB, and at half its side by Simplify."""
    import bpy
    import scenes
    _stage(lambda: _noise_file(1024))
    scene = bpy.context.scene
    scene.volley.texture_memory = 2
    limited = scenes.render()
    scene.volley.texture_memory = 0
    full = scenes.render()
    scene.render.use_simplify, scene.cycles.texture_limit_render = True, '512'
    return limited, full, scenes.render()


def test_memory(blender):
    limited, full, simplified = blender.run(inside_memory)
    assert (limited == simplified).all() and not (limited == full).all()
    assert "1 images are shown smaller, to keep all within 2 MiB" in blender.output


def inside_minified():
    """[Volley's, Cycles'] of noise of which a pixel has hundreds of texels, seen at a slant and in a
    rough mirror: by 4 samples and by many."""
    import scenes
    import bpy
    wall = _stage(lambda: _noise_file(2048))
    wall.rotation_euler = (0.0, 0.0, 0.7)
    mirror = scenes.mesh("Mirror", [(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], [(0, 1, 2, 3)])
    mirror.data.materials.append(
        scenes.material("Rough", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9), Roughness=0.4))
    camera = bpy.context.scene.camera
    camera.data.type, camera.data.lens = 'PERSP', 60.0
    camera.location, camera.rotation_euler = (0.0, -6.0, 1.5), (1.3, 0.0, 0.0)
    for settings in (bpy.context.scene.volley, bpy.context.scene.cycles):
        settings.pixel_filter_type, settings.filter_width = 'BLACKMAN_HARRIS', 1.5
    return _both(4), _both(4096)


def _variance(pictures, reference):
    return [((picture - reference) ** 2).mean() for picture in pictures]


def test_minified(blender):
    few, (ours, theirs) = blender.run(inside_minified)
    assert abs(ours.mean() / theirs.mean() - 1.0) < 1e-3
    assert np.abs(ours - theirs).max() < 0.03 and np.abs(ours - theirs).mean() < 3e-3
    own, cycles = _variance(few, theirs)
    assert own < 0.5 * cycles


def test_projections(blender):
    pictures = blender.run(inside_projections)
    for ours, theirs in pictures.values():
        _close(ours, theirs, 2e-3)
    assert np.abs(pictures['BOX', 0.4][1] - pictures['BOX', 0.0][1]).max() > 0.02


# name: (file format and channels, or None for Blender's own pixels; bits; whether it is packed)
ALPHA_SOURCES = {
    "packed PNG": (('PNG', 'RGBA'), 8, True), "packed PNG of 16 bits": (('PNG', 'RGBA'), 16, True),
    "packed half floats": (('OPEN_EXR', 'RGBA'), 16, True), "packed floats": (('OPEN_EXR', 'RGBA'), 32, True),
    "packed JPEG": (('JPEG', 'RGB'), 8, True), "packed WebP": (('WEBP', 'RGBA'), 8, True),
    "packed TIFF": (('TIFF', 'RGBA'), 16, True), "TIFF": (('TIFF', 'RGBA'), 16, False),
    "bytes": (None, 8, False), "floats": (None, 32, False),
    "packed bytes": (None, 8, True), "packed floats of Blender": (None, 32, True),
}
ALPHA_CASES = list(itertools.product(
    ('STRAIGHT', 'PREMUL', 'CHANNEL_PACKED', 'NONE'), ("sRGB", "Non-Color"), ("Color", "Alpha")))
ALPHA_GRID, ALPHA_SIDE = 4, 8  # panels, and pixels of one, along each side of the picture


def _alpha_image(source, space, mode, folder):
    """Colours that are above their alpha as often as not."""
    import bpy
    kind, bits, is_packed = ALPHA_SOURCES[source]
    made = bpy.data.images.new(source, ALPHA_SIDE, ALPHA_SIDE, alpha=True, float_buffer=kind is not None or bits > 8)
    # Before there are pixels, which these would make anew.
    made.colorspace_settings.name, made.alpha_mode = ("Non-Color", 'CHANNEL_PACKED') if kind else (space, mode)
    pixels = np.random.default_rng(3).uniform(0.05, 0.95, 4 * ALPHA_SIDE ** 2).astype(np.float32)
    made.pixels.foreach_set(pixels)
    made.update()
    if kind:
        settings = bpy.context.scene.render.image_settings
        settings.file_format, settings.color_mode = kind
        if kind[0] not in ('JPEG', 'WEBP'):
            settings.color_depth = str(bits)
        path = os.path.join(folder, source)
        made.save_render(path)
        made = bpy.data.images.load(path)
        made.colorspace_settings.name, made.alpha_mode = space, mode
    if is_packed:
        made.pack()
    return made


def inside_alpha(source):
    """{case: [picture by Volley, by Cycles]} of an image in every alpha mode, as data and as colours, shown as it
    is and dimmed by its alpha."""
    import tempfile
    import bpy
    import scenes
    scene = scenes.empty(size=(ALPHA_GRID * ALPHA_SIDE,) * 2, samples=1)
    scenes.camera(type='ORTHO', ortho_scale=ALPHA_GRID)
    scenes.sharpen()
    folder = tempfile.mkdtemp(prefix="volley_")
    for number, (mode, space, output) in enumerate(ALPHA_CASES):
        center = [part - 0.5 * (ALPHA_GRID - 1) for part in (number % ALPHA_GRID, number // ALPHA_GRID)]
        tree = scenes.wall(f"Wall{number}", 1.0, center=center,
                           material=scenes.emitter((1.0, 1.0, 1.0))).data.materials[0].node_tree
        node, emission = tree.nodes.new("ShaderNodeTexImage"), tree.nodes["Emission"]
        node.image, node.interpolation = _alpha_image(source, space, mode, folder), 'Closest'
        tree.links.new(node.outputs["Color"], emission.inputs["Color"])
        if output == "Alpha":
            tree.links.new(node.outputs["Alpha"], emission.inputs["Strength"])
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = 'OPEN_EXR', 'RGBA', '32'
    pictures, found = _both(), {}
    for number, case in enumerate(ALPHA_CASES):
        x, y = number % ALPHA_GRID * ALPHA_SIDE, number // ALPHA_GRID * ALPHA_SIDE
        found[case] = [picture[y:y + ALPHA_SIDE, x:x + ALPHA_SIDE] for picture in pictures]
    return found


@pytest.mark.parametrize("source", ALPHA_SOURCES)
def test_alpha_modes(blender, source):
    """Read as files, packed PNGs that are said to be multiplied by alpha were .24 off in a channel, packed floats that
    are said not to be .69; and colours above their alpha had the error of a polynomial out of its range, hundreds."""
    for case, (ours, theirs) in blender.run(inside_alpha, source).items():
        assert theirs.std() > 0.02, case
        error = np.abs(ours - theirs) / np.maximum(theirs.max(axis=-1, keepdims=True), 1.0)
        assert error.max() <= 3e-3, (case, error.max())  # half floats, which Cycles rounds towards 0


def inside_opened():
    """Processes that opening files starts: one of Cycles with an image, one of Volley without, one with."""
    import tempfile
    import bpy
    import processes
    import scenes
    path = os.path.join(tempfile.mkdtemp(prefix="volley_"), "saved.blend")
    counts = []
    for engine, has_image in (('CYCLES', True), ('VOLLEY', False), ('VOLLEY', True)):
        if has_image:
            _stage(lambda: _noise_file(16))
        else:
            scenes.empty()
        bpy.context.scene.render.engine = engine
        bpy.ops.wm.save_as_mainfile(filepath=path)
        before = processes.child_count(os.getpid())
        bpy.ops.wm.open_mainfile(filepath=path)
        counts.append(processes.child_count(os.getpid()) - before)
    return counts


def test_reader_starts_when_a_file_is_opened(blender):
    assert blender.run(inside_opened) == [0, 0, 1]

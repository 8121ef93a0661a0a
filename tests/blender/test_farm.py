# SPDX-License-Identifier: Apache-2.0
"""Farms: parts of frames, merged to the bits of one render; what does not fit is refused with the reason, and
nothing is overwritten; exit codes, summaries, signals."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time

import numpy as np

from blender import Blender, executable, user_scripts, version

MAIN = "import volley.farm.command as c; c.main()"
SAMPLES = 64


# In Blender --------------------------------------------------------------------------------------

def _make_scene(path):
    """A moving half transparent cube over a floor, with most kinds of passes."""
    import bpy
    bpy.ops.wm.read_factory_settings()
    import addon_utils
    addon_utils.enable("volley")
    scene = bpy.context.scene
    render = scene.render
    render.engine = 'VOLLEY'
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 32, 100
    render.use_motion_blur = True
    scene.volley.samples = SAMPLES
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -1.0))
    cube = bpy.data.objects["Cube"]
    cube.data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.6
    for frame, x in ((1, 0.0), (8, 2.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_diffuse_direct = True
    layer.use_pass_object_index = layer.use_pass_cryptomatte_object = True
    layer.volley.use_pass_sample_count = True
    layer.lightgroups.add(name="Key")
    bpy.data.objects["Light"].lightgroup = "Key"
    bpy.ops.wm.save_as_mainfile(filepath=path)


def _whole(scene):
    """{channel: array} of the picture of one render, through Blender's result as this version names it."""
    import bpy
    from volley import passes
    kept = {}
    write = passes.write

    def keep(render, layer, entries):
        width, height = render.size
        for entry in entries:
            pixels = render.read(entry.index, np.empty(width * height * len(entry.channels), np.float32))
            for k, letter in enumerate(entry.channels):
                kept[f"ViewLayer.{passes.name_of(entry)}.{letter}"] = pixels.reshape(height, width, -1)[..., k]
        write(render, layer, entries)
    passes.write = keep
    try:
        bpy.ops.render.render()
    finally:
        passes.write = write
    return kept


def _same(path, whole):
    """How many numbers of a merged file differ in their bits."""
    from volley.farm import exr
    _, channels, attributes = exr.read(path)
    assert channels.keys() == whole.keys()
    assert any(key.endswith("/manifest") for key in attributes)
    return sum(int((channels[name].view(np.uint32) != np.ascontiguousarray(whole[name]).view(np.uint32)).sum())
               for name in whole)


def merged_bits(folder):
    """{case: numbers that differ} of parts of 1, 2, 5 and 64 blocks and of an odd range, and settings that stop
    pixels or denoise."""
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    scene, found = bpy.context.scene, {}
    cases = {"plain": {}, "adaptive": {"use_adaptive_sampling": True, "noise_threshold": 0.05,
                                       "adaptive_min_samples": 8}, "denoise": {"use_denoising": True}}
    for case, settings in cases.items():
        for name, value in settings.items():
            setattr(scene.volley, name, value)
        scene.volley.extra_samples = 0.0
        whole = _whole(scene)
        scene.volley.property_unset("extra_samples")  # parts have none
        for count in {"plain": (1, 2, 5, 64), "adaptive": (16,), "denoise": (2,)}[case]:
            parts = f"{folder}/{case}{count}"
            assert command.run(["render", "--parts", parts, "--blocks", f"0-{count - 1}/{count}"]) == 0
            assert command.run(["merge", parts, "--output", f"{parts}_##"]) == 0
            found[f"{case} {count}"] = _same(f"{parts}_01.exr", whole)
            if count == 5:
                assert bpy.ops.volley.merge_parts(directory=parts, output="../operator_##") == {'FINISHED'}
                found["operator"] = _same(f"{folder}/operator_01.exr", whole)
        for name in settings:
            scene.volley.property_unset(name)
    assert not scene.volley.sample_offset and not scene.volley.sample_subset
    return found


def test_merged_frames_have_the_bits_of_one_render(tmp_path):
    assert Blender().run(merged_bits, str(tmp_path)) == dict.fromkeys(
        ("plain 1", "plain 2", "plain 5", "operator", "plain 64", "adaptive 16", "denoise 2"), 0)


@contextlib.contextmanager
def _full_disk():
    """As one that is full after 4 KiB: by the limit of a file's size."""
    import resource
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as Python itself has it, unless Blender embeds it
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limit[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)


def _refusal(folder, names, output, around=contextlib.nullcontext):
    """What a merge of some parts says, with a file at the output that must stay."""
    import io
    import shutil
    from volley.farm import command
    chosen = os.path.join(folder, "chosen")
    shutil.rmtree(chosen, ignore_errors=True)
    os.makedirs(chosen)
    for name in names:
        shutil.copy(os.path.join(folder, name), os.path.join(chosen, os.path.basename(name)))
    with open(output, "w", encoding="utf-8") as file:
        file.write("before")
    said = io.StringIO()
    with contextlib.redirect_stdout(said), around():
        code = command.run(["merge", chosen, "--frames", "1", "--output", output])
    with open(output, encoding="utf-8", errors="replace") as file:
        assert code == 1 and file.read() == "before", said.getvalue()
    assert sorted(os.listdir(chosen)) == sorted({os.path.basename(name) for name in names})
    return said.getvalue()


@contextlib.contextmanager
def _read_only(output):
    """As a folder in which nothing may be made, for root too."""
    import errno
    import tempfile
    from unittest import mock
    refusal = PermissionError(errno.EACCES, "Permission denied", output)
    with mock.patch.object(tempfile, "mkstemp", side_effect=refusal):
        yield


def _operator_refusal(folder, names, output):
    """What the operator says of chosen files, with a file at the output that must stay."""
    import bpy
    try:
        bpy.ops.volley.merge_parts(directory=folder, files=[{"name": name} for name in names], output=output[:-8])
    except RuntimeError as error:
        with open(output, encoding="utf-8") as file:
            assert file.read() == "before"
        return str(error)
    return ""


def refusals(folder):
    """{case: what was said}."""
    import bpy
    from volley.farm import command, parts
    _make_scene(f"{folder}/farm.blend")
    scene, said, output = bpy.context.scene, {}, f"{folder}/frame_0001.exr"

    def render(name, samples):
        assert command.run(["render", "--parts", f"{folder}/{name}", "--samples", samples]) == 0, name
        return [f"{name}/{file}" for file in os.listdir(f"{folder}/{name}")]

    first, second = render("first", "0:20"), render("second", "20:64")
    overlap = render("overlap", "10:64")
    said["overlap"] = _refusal(folder, first + overlap, output)
    said["missing before"] = _refusal(folder, second, output)
    said["missing after"] = _refusal(folder, first, output)
    said["none"] = _refusal(folder, [], output)
    said["operator"] = _operator_refusal(f"{folder}/first", [os.path.basename(name) for name in first], output)
    said["operator, none"] = _operator_refusal(folder, ["farm.blend"], output)
    scene.volley.seed = 7
    said["seed"] = _refusal(folder, first + render("seed", "20:64"), output)
    scene.volley.seed = 0
    version = parts.version
    parts.version = lambda: {**version(), "volley": "libtracer 9.9.9"}
    said["version"] = _refusal(folder, first + render("version", "20:64"), output)
    parts.version = version
    with open(f"{folder}/{first[0]}", "rb") as file:
        data = file.read()
    name = os.path.basename(first[0])
    os.makedirs(f"{folder}/damaged")
    for case, bad in (("cut short", data[:-100]), ("flipped", data[:-50] + bytes([data[-50] ^ 4]) + data[-49:]),
                      ("relabelled", data.replace(b'"begin": 0', b'"begin": 1')), ("no picture", b"hello")):
        with open(f"{folder}/damaged/{name}", "wb") as file:
            file.write(bad)
        said[case] = _refusal(folder, [f"damaged/{name}"] + second, output)
    # A disk that is full halfway, a folder that cannot be written.
    said["full"] = _refusal(folder, first + second, output, _full_disk)
    with _full_disk():
        assert command.run(["render", "--parts", f"{folder}/full", "--samples", "0:20"]) == 1
    assert not os.listdir(f"{folder}/full")
    assert not [name for name in os.listdir(folder) if name.endswith(".part")]
    assert command.run(["render", "--parts", f"{folder}/farm.blend/parts", "--samples", "0:20"]) == 1
    said["no permission"] = _refusal(folder, first + second, output, lambda: _read_only(output))
    bpy.data.objects["Cube"].scale.x = 2.0
    bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/other.blend")
    said["file"] = _refusal(folder, first + render("file", "20:64"), output)
    return said


def test_parts_that_do_not_fit_are_refused_with_the_reason(tmp_path):
    said = Blender().run(refusals, str(tmp_path))
    reasons = {"overlap": "overlap", "missing before": "samples 0 to 20", "missing after": "samples 20 to 64",
               "none": "there are no parts", "seed": "seed is 7, not 0", "version": "libtracer 9.9.9",
               "file": "scene is", "cut short": "", "flipped": "damaged", "relabelled": "damaged",
               "no picture": "no OpenEXR file", "full": "File too large",
               "no permission": "Permission denied"}
    assert "Frame 1: " in said["operator"] and "samples 20 to 64" in said.pop("operator")
    assert "None of these files is a part" in said.pop("operator, none")
    for case, reason in reasons.items():
        assert reason in said[case] and "error: frame 1" in said[case], (case, said[case])
    assert said.keys() == reasons.keys()
    assert ".part.exr" in said["overlap"] and ".part.exr" in said["cut short"]


def inside_file_browser(folder):
    """What leads to the operator, what the file browser that it opens is for, and its frame."""
    import bpy
    import drawing
    from volley.farm import command, operator
    from volley.ui import render
    yield 0.1
    _make_scene(f"{folder}/farm.blend")
    assert command.run(["render", "--parts", f"{folder}/parts", "--blocks", "0-1/2"]) == 0
    yield 0.1
    context = drawing.Context(engine='VOLLEY')
    menu = drawing.Instance(bpy.types.TOPBAR_MT_render)
    operator._draw_menu(menu, context)
    found = {"buttons": menu.layout.operators
             + drawing.draw(render.VOLLEY_RENDER_PT_sampling_advanced, context).operators}
    manager = bpy.context.window_manager
    with bpy.context.temp_override(window=manager.windows[0]):
        bpy.ops.volley.merge_parts('INVOKE_DEFAULT', directory=f"{folder}/parts/")
    yield 1.0
    window, area = next((window, area) for window in manager.windows for area in window.screen.areas
                        if area.type == 'FILE_BROWSER')
    space = area.spaces.active
    found["shown"] = space.active_operator.bl_idname, space.params.filter_glob
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.file.execute()
    yield 0.5
    found["frames"] = [name for name in os.listdir(f"{folder}/parts") if name.startswith("frame")]
    return found


def test_parts_are_merged_from_the_file_browser(window, tmp_path):
    found = window.run_in_window(inside_file_browser, str(tmp_path))
    assert found == {"buttons": ["volley.merge_parts"] * 2, "shown": ("VOLLEY_OT_merge_parts", "*.part.exr"),
                     "frames": ["frame_0001.exr"]}
    assert "Traceback" not in window.output


def save_scene(path, samples):
    """A scene with an image and a library that are not there any more."""
    import bpy
    library = os.path.join(os.path.dirname(path), "library.blend")
    bpy.ops.wm.read_factory_settings()
    bpy.ops.wm.save_as_mainfile(filepath=library)
    _make_scene(path)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Cube"]
    bpy.context.collection.objects.link(wanted.objects[0])
    os.remove(library)
    image = bpy.data.images.new("gone", 4, 4)
    image.filepath, image.source, image.use_fake_user = "//gone.png", 'FILE', True
    bpy.context.scene.volley.samples = samples
    bpy.ops.wm.save_mainfile()


def inside_edits(folder):
    """{edit after the file was read: (exit code of the merge, what it says)}."""
    import io
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    _save_image(f"{folder}/plain.tga", (0.5, 0.25, 0.125, 1.0))
    scene, cube, light = bpy.context.scene, bpy.data.objects["Cube"], bpy.data.objects["Light"]
    _show_image(cube.data.materials[0].node_tree, f"{folder}/plain.tga", 'FILE')
    scene.volley.samples = 4
    bad = bpy.data.meshes.new("bad")
    bad.from_pydata([(float("nan"), float("inf"), 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)], [], [(0, 1, 2)])
    scene.collection.objects.link(bpy.data.objects.new("bad", bad))
    bpy.ops.wm.save_mainfile()
    found = {}

    def halves(edit, reload=False):
        parts, before = f"{folder}/{edit.replace(' ', '_')}", "1-3" if reload else "3"
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            assert command.run(["render", "--frames", before, "--parts", parts, "--samples", "0:2"]) == 0
            if reload:
                bpy.ops.wm.open_mainfile(filepath=f"{folder}/farm.blend")
            else:
                edits[edit]()
            assert command.run(["render", "--frames", "3", "--parts", parts, "--samples", "2:4"]) == 0
            found[edit] = command.run(["merge", parts, "--frames", "3", "--output", f"{parts}_#"]), said.getvalue()

    def change(owner, name, value):
        kept = getattr(owner, name)
        setattr(owner, name, value)
        undo.append((owner, name, kept))

    shader = cube.data.materials[0].node_tree.nodes["Principled BSDF"]
    vertex, background = cube.data.vertices[0], scene.world.node_tree.nodes["Background"]
    edits = {"nothing": lambda: None,
             "rounding": lambda: change(cube.scale, "x", 1.0 + 2.0 ** -23),
             "object": lambda: change(cube.scale, "x", 1.01),
             "vertex": lambda: change(vertex.co, "x", 1.01 * vertex.co.x),
             "camera": lambda: change(scene.camera.location, "x", scene.camera.location.x + 0.01),
             "lens": lambda: change(scene.camera.data, "lens", 51.0),
             "light": lambda: change(light.data, "energy", 999.0),
             "light's place": lambda: change(light.location, "z", light.location.z + 0.01),
             "material": lambda: change(shader.inputs["Roughness"], "default_value", 0.4),
             "world": lambda: change(background.inputs["Strength"], "default_value", 2.0),
             "hidden": lambda: change(cube, "visible_glossy", False)}
    for edit in edits:
        undo = []
        halves(edit)
        for owner, name, kept in undo:
            setattr(owner, name, kept)
    halves("read anew", reload=True)
    return found


def test_edits_that_no_file_has_are_noticed(tmp_path):
    found = Blender().run(inside_edits, str(tmp_path))
    changed = {"object": "instances", "vertex": "meshes", "camera": "camera", "lens": "camera",
               "light": "lights", "light's place": "lights",
               "material": "instances, materials", "world": "materials, world", "hidden": "instances"}
    for edit, (code, said) in found.items():
        if edit in changed:
            assert code == 1 and "changed after the file was read" in said, (edit, said)
            assert f".part.exr: {changed[edit]}\n" in said, (edit, said)
        else:
            assert code == 0, (edit, said)
    assert found.keys() == {"nothing", "rounding", "read anew", *changed}


def _save_image(path, color, size=(4, 4)):
    import bpy
    image = bpy.data.images.new("made", *size)
    image.generated_color = color
    image.filepath_raw, image.file_format = path, 'TARGA_RAW'  # not compressed
    image.save()
    bpy.data.images.remove(image)


def _show_image(tree, path, source):
    import bpy
    image = bpy.data.images.load(path.replace("<UDIM>", "1001"))
    image.source = source
    image.filepath = path
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    surface = next(node for node in tree.nodes if node.type == 'BSDF_PRINCIPLED')
    tree.links.new(node.outputs["Color"], surface.inputs["Base Color"])
    return node, image


def inside_files(folder):
    """{case: paths of images that the library is given, and those that are said to be read}, and which names
    have another digest after one byte in the middle of each file is another."""
    import bpy
    from volley import native
    from volley.farm import files
    _make_scene(f"{folder}/farm.blend")
    bpy.ops.wm.save_mainfile()
    scene, tree = bpy.context.scene, bpy.data.objects["Cube"].data.materials[0].node_tree
    scene.render.use_motion_blur = False
    scene.volley.samples = 1
    given, update = [], native.Scene.update_image

    def note(self, image, **values):
        given.append(values.get("path"))
        update(self, image, **values)
    native.Scene.update_image = note
    for name in ("plain", "t.1001", "t.1012", *(f"s_{number:03d}" for number in range(3, 13))):
        _save_image(f"{folder}/{name}.tga", (0.5, 0.25, 0.125, 1.0), (1024, 1024) if name == "plain" else (4, 4))
    found, changed = {}, set()
    for name, source in (("plain", 'FILE'), ("t.<UDIM>", 'TILED'), ("s_005", 'SEQUENCE')):
        node, image = _show_image(tree, f"{folder}/{name}.tga", source)
        if source == 'TILED':
            image.tiles.new(1012)
        user = node.image_user
        user.frame_duration, user.frame_start, user.frame_offset = 4, 2, 5
        cases = (1, 3, 8) if source == 'SEQUENCE' else (1,)
        for is_cyclic in (False, True) if source == 'SEQUENCE' else (False,):
            user.use_cyclic, user.use_auto_refresh = is_cyclic, True
            for frame in cases:
                scene.frame_set(frame)
                given.clear()
                bpy.ops.render.render()
                said = [path for name, path in files.paths(frame).items() if name.startswith("image")]
                found[source, is_cyclic, frame] = sorted(given), sorted(said)
        before = files.digests(frame)
        for path in said:
            with open(path, "r+b") as file:
                file.seek(os.path.getsize(path) // 2)
                byte = file.read(1)[0]
                file.seek(-1, os.SEEK_CUR)
                file.write(bytes([byte ^ 1]))
            os.utime(path, ns=(0, 0))
        after = files.digests(frame)
        changed |= {name for name in after if after[name] != before[name]}
        bpy.data.images.remove(image)
        tree.nodes.remove(node)
    return found, changed


def test_files_that_a_frame_reads_are_known(tmp_path):
    found, changed = Blender().run(inside_files, str(tmp_path))
    for case, (given, said) in found.items():
        assert given == said and all(given), (case, given, said)
    assert len(found) == 8 and len({tuple(given) for given, _ in found.values()}) == 6
    assert changed == {"image plain.tga", "image t.1001.tga 1001", "image t.1001.tga 1012", "image s_005.tga 8"}


def inside_names(folder):
    """How many parts there are of two halves of two layers, and the layers of the merged frame: names differ in letters
    that files do not get, and are as long as Blender lets them be."""
    import bpy
    from volley.farm import command, exr
    _make_scene(f"{folder}/farm.blend")
    scene, parts = bpy.context.scene, f"{folder}/parts"
    scene.volley.samples, scene.name = 2, "s" * 200
    scene.view_layers[0].name = "\u80cc\u666f"
    scene.view_layers.new("\u4eba\u7269")
    scene.view_layers.new("n" * 200)
    bpy.ops.wm.save_mainfile()
    assert command.run(["render", "--parts", parts, "--blocks", "0-1/2"]) == 0
    assert command.run(["merge", parts, "--output", f"{folder}/merged_#"]) == 0
    _, channels, _ = exr.read(f"{folder}/merged_1.exr")
    return len(os.listdir(parts)), {name.split(".")[0] for name in channels}, {each.name for each in scene.view_layers}


def test_layers_have_files_whatever_their_names(tmp_path):
    """Two layers of Chinese names had one file, so that the merged frame lacked one of them; names of 200 letters had
    none."""
    count, merged, layers = Blender().run(inside_names, str(tmp_path))
    assert count == 6 and merged == layers and len(layers) == 3


def inside_more_files(folder):
    """Which files are said to be missing of two IES files of one name, and of a mesh's cache that is shown and of one
    that is not."""
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    for place in ("one", "two"):
        light = bpy.data.lights.new(place, 'POINT')
        light.use_nodes = True
        node = light.node_tree.nodes.new("ShaderNodeTexIES")
        node.mode, node.filepath = 'EXTERNAL', f"//{place}/lamp.ies"
    for name in ("shown", "off"):
        modifier = bpy.data.objects["Cube"].modifiers.new(name, 'MESH_CACHE')
        modifier.filepath, modifier.show_render = f"//{name}.mdd", name == "shown"
    return [message.replace(folder, "") for message in command.missing_files([1])]


def test_files_of_one_name_and_caches_are_known(tmp_path):
    """The first of the IES files, and the cache, were not looked for."""
    assert sorted(Blender().run(inside_more_files, str(tmp_path))) == [
        f"{kind} {path}: there is no such file"
        for kind, path in (("cache", "/shown.mdd"), ("light", "/one/lamp.ies"), ("light", "/two/lamp.ies"))]


# The command line --------------------------------------------------------------------------------

def inside_numbers(folder):
    """What numbers of frames stand for or what is said of them, and exit codes of command lines with bad ones."""
    from volley.farm import command
    found = {}
    for text in ("1,5-8", "1-20:6", "-8--6", "-2-3:2", "8-5", "3-", "", "1:0", "x"):
        try:
            found[text] = command.numbers_of(text)
        except ValueError as error:
            found[text] = str(error)
    lines = ("render --frames 8-5", "render --parts x --blocks 0/0", "render --parts x --blocks=-1/4",
             "render --parts x --samples 5", "merge x --output y --frames z")
    return found, [command.run(line.replace("x", folder, 1).split()) for line in lines]


def test_numbers_of_frames(tmp_path):
    """Ranges that begin below 0 were none, and empty ones, blocks of none and half a range of samples ended in an
    error of Python's."""
    found, codes = Blender().run(inside_numbers, str(tmp_path))
    assert found == {"1,5-8": [1, 5, 6, 7, 8], "1-20:6": [1, 7, 13, 19], "-8--6": [-8, -7, -6], "-2-3:2": [-2, 0, 2],
                     "8-5": "'8-5' has no frames", **{text: f"'{text}' tells no frames"
                                                      for text in ("3-", "", "1:0", "x")}}
    assert codes == [2] * len(codes)


def inside_views(folder):
    """{format of views: (exit code, files)} of a stereo frame by the command line."""
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    render, found = bpy.context.scene.render, {}
    render.use_multiview, bpy.context.scene.volley.samples = True, 1
    for views in ('INDIVIDUAL', 'STEREO_3D'):
        render.image_settings.views_format = views
        summary = f"{folder}/{views}.json"
        code = command.run(["render", "--output", f"{folder}/{views}_#", "--summary", summary])
        with open(summary, encoding="utf-8") as file:
            outputs = json.load(file)["outputs"]
        found[views] = code, [os.path.basename(path) for path in outputs if os.path.isfile(path)]
    return found


def test_views_may_have_files_of_their_own(tmp_path):
    """Such frames failed, as the file that they have otherwise was not there."""
    assert Blender().run(inside_views, str(tmp_path)) == {
        'INDIVIDUAL': (0, ["INDIVIDUAL_1_L.png", "INDIVIDUAL_1_R.png"]), 'STEREO_3D': (0, ["STEREO_3D_1.png"])}


def inside_lines(folder):
    """Numbers that differ in a frame of parts with Freestyle from one without, its warnings, and whether it is still
    on."""
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    scene = bpy.context.scene
    scene.volley.samples = 2
    whole = _whole(scene)
    scene.render.use_freestyle = scene.view_layers[0].use_freestyle = True
    parts, summary = f"{folder}/lines", f"{folder}/summary.json"
    assert command.run(["render", "--parts", parts, "--blocks", "0-1/2", "--summary", summary]) == 0
    assert command.run(["merge", parts, "--output", f"{parts}_#"]) == 0
    with open(summary, encoding="utf-8") as file:
        told = [message for message in json.load(file)["warnings"] if "Freestyle" in message]
    return _same(f"{parts}_1.exr", whole), told, scene.render.use_freestyle


def test_parts_are_those_of_the_picture_below_lines(tmp_path):
    """Lines are a scene that Blender renders after the picture, with layers of the same names."""
    assert Blender().run(inside_lines, str(tmp_path)) == (
        0, ["Parts have no lines of Freestyle, which whole frames have"], True)


def _command(*arguments, blend=None, is_blenders=False, **options):
    """A Blender that runs the command line; is_blenders: as a command of its own, where it has such."""
    environment = {**os.environ, "BLENDER_USER_SCRIPTS": user_scripts()}
    way = ["--command", "volley"] if is_blenders and version() >= (4, 2) else ["--python-expr", MAIN, "--"]
    return subprocess.Popen([executable(), "-b", "--addons", "volley", *([blend] if blend else []), *way,
                             *arguments], env=environment, text=True,
                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)


def test_command_line(tmp_path):
    """Missing files, SIGTERM and going on after it, summaries, two starts at once, no writes elsewhere."""
    blend, parts = str(tmp_path / "farm.blend"), tmp_path / "parts"
    Blender().run(save_scene, blend, 16384)
    before = set(os.listdir(tmp_path))
    strict = _command("render", "--parts", str(parts), "--strict", blend=blend)
    stopped = _command("render", "--parts", str(parts), "--blocks", "0-63/64", "--threads", "1", blend=blend)
    said = strict.communicate()[0]
    assert strict.returncode == 2 and "gone.png: there is no such file" in said, said
    assert f"error: library {tmp_path}/library.blend: there is no such file" in said, said
    end = time.monotonic() + 100.0
    while not (parts.is_dir() and list(parts.glob("0*.exr"))) and time.monotonic() < end:
        time.sleep(0.05)
    stopped.send_signal(signal.SIGTERM)
    said = stopped.communicate()[0]
    assert stopped.returncode == 143 and "stopped by SIGTERM" in said, said
    finished = set(parts.glob("*"))
    assert finished and len(finished) < 64 and all(path.name.endswith(".part.exr") for path in finished)
    times = {path: path.stat().st_mtime_ns for path in finished}
    # The same again takes what is there as it is.
    summary = tmp_path / "summary.json"
    last = len(finished)
    again = _command("render", "--parts", str(parts), "--blocks", f"0-{last}/64", "--summary", str(summary),
                     blend=blend, is_blenders=True)
    refused = _command("render", "--samples", "5:4", "--parts", str(parts), blend=blend, is_blenders=True)
    said, refused_said = again.communicate()[0], refused.communicate()[0]
    assert again.returncode == 0, said
    assert refused.returncode == 2 and "no such samples" in refused_said, refused_said
    assert {path: path.stat().st_mtime_ns for path in finished} == times
    values = json.loads(summary.read_text())
    assert values["status"] == "done" and values["frame"] == 1 and len(values["outputs"]) == last + 1
    assert values["rays"] > 0 and values["peak_memory_bytes"] > 0 and not values["errors"]
    assert "progress 100.0%" in said
    assert set(os.listdir(tmp_path)) == before | {"parts", "summary.json"}


def _contents(folder):
    """{path: time of change} of all in a folder."""
    return {os.path.join(place, name): os.stat(os.path.join(place, name)).st_mtime_ns
            for place, folders, names in os.walk(folder) for name in folders + names}


def test_nodes_of_farms(tmp_path):
    """A user who may write into the output's folder alone, with the add-on in a folder shared by all, without
    a home and a display; two starts at once."""
    open_folder = tempfile.mkdtemp(prefix="volley_node")  # pytest's own are not for other users
    try:
        os.chmod(open_folder, 0o755)
        shared, work, temporary, output = (os.path.join(open_folder, name)
                                           for name in ("shared", "work", "temporary", "output"))
        shutil.copytree(user_scripts(), shared, ignore=shutil.ignore_patterns("__pycache__"))
        os.mkdir(work)
        Blender(str(tmp_path)).run(_make_scene, f"{work}/farm.blend")
        for folder in (shared, work):
            subprocess.run(["chmod", "-R", "a-w,a+rX", folder], check=True)
        for folder in (temporary, output):
            os.mkdir(folder)
            os.chmod(folder, 0o777)
        before = _contents(shared), _contents(work)
        environment = {name: value for name, value in os.environ.items()
                       if name not in ("DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR")}
        environment.update(BLENDER_USER_SCRIPTS=shared, TMPDIR=temporary, HOME="/nonexistent")
        user = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
        line = [executable(), "-b", "--addons", "volley", f"{work}/farm.blend", "--python-expr", MAIN, "--", "render"]
        starts = [subprocess.Popen([*line, *more], env=environment, text=True, cwd=work, **user,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT) for more in (
            ["--frames", "1-2", "--output", f"{output}/one_#", "--strict"],
            ["--parts", f"{output}/parts", "--summary", f"{output}/summary.json"])]
        said = [start.communicate()[0] for start in starts]
        assert [start.returncode for start in starts] == [0, 0], said
        assert (_contents(shared), _contents(work)) == before
        assert not os.listdir(temporary)
        assert sorted(os.listdir(output)) == ["one_1.png", "one_2.png", "parts", "summary.json"]
    finally:
        shutil.rmtree(open_folder)


def inside_little_memory(folder):
    """What is said, and the exit code: of a limit below what Blender has, of one that leaves some for a frame that
    needs more, and for one that does not."""
    import io
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    bpy.context.scene.volley.samples = 1
    found = []
    for side, more in ((32, -1), (8192, 2000), (32, 2000)):
        bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = side
        used = command.address_space() or (1000 if more > 0 else 0)  # a system without /proc
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            code = command.run(["render", "--output", f"{folder}/picture_#", "--memory", str(max(used + more, 1))])
        found.append((code, said.getvalue()))
    return found


def test_frames_that_need_too_much_memory_fail(tmp_path):
    refused, failed, done = Blender().run(inside_little_memory, str(tmp_path))
    assert refused[0] == 2 and "MiB already" in refused[1]
    assert failed[0] == 1 and ("no memory" in failed[1] or "MiB left" in failed[1]), failed
    assert done[0] == 0, done
    assert [name for name in os.listdir(tmp_path) if name.startswith("picture")] == ["picture_1.png"]


def test_animations_take_steady_memory(tmp_path):
    """Frames of one Blender by the command line: pictures there, as much memory at most in 32 as in 8."""
    assert Blender().run(animation_growth, str(tmp_path)) < 4096


def animation_growth(folder):
    """KiB by which the largest size of the process grows after the first frames."""
    import resource
    import bpy
    from volley.farm import command
    _make_scene(f"{folder}/farm.blend")
    bpy.context.scene.volley.samples = 1
    sizes = []
    for frames in ("1-8", "9-32"):
        assert command.run(["render", "--frames", frames, "--output", f"{folder}/picture_###"]) == 0
        sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert len([name for name in os.listdir(folder) if name.startswith("picture_")]) == 32
    return sizes[1] - sizes[0]

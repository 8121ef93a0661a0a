# SPDX-License-Identifier: Apache-2.0
"""Packages: made of the staged add-on, installed as a user does, used, brought up to date, removed.

Blender runs with a home folder of its own and without the user scripts of the build, so that the package
is all there is of Volley."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile

import pytest

import blender as blender_support

_REPOSITORY = blender_support.REPOSITORY
_HAS_EXTENSIONS = (4, 2)  # the first Blender that has them
_EXTENSION = "bl_ext.user_default.volley"

# Two tiles and the second frame of a sequence side by side: right only where files are read one by one.
_RENDER = """
import addon_utils, bpy, importlib.util, os, sys
module, has_images, folder = sys.argv[-3:]
if has_images == "0":  # as if Blender's Python had no OpenImageIO
    addon_utils.disable(module)
    find = importlib.util.find_spec
    importlib.util.find_spec = lambda name, *rest: None if name == "OpenImageIO" else find(name, *rest)
    addon_utils.enable(module)
scene = bpy.context.scene
for name, color in (("t.1001", (1, 0, 0, 1)), ("t.1002", (0, 1, 0, 1)), ("f1", (1, 1, 0, 1)), ("f2", (0, 0, 1, 1))):
    made = bpy.data.images.new("Made", 8, 8)
    made.pixels.foreach_set(color * 64)
    made.filepath_raw, made.file_format = os.path.join(folder, name + ".png"), 'PNG'
    made.save()
bpy.ops.object.select_all(action='SELECT')
bpy.ops.object.delete()

def plane(x, image):
    bpy.ops.mesh.primitive_plane_add(location=(x, 0, 0))
    material = bpy.data.materials.new("Image")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    texture, emission = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeEmission")
    texture.image = image
    links.new(texture.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
    bpy.context.object.data.materials.append(material)
    return texture

tiled = bpy.data.images.load(os.path.join(folder, "t.1001.png"))
tiled.source = 'TILED'
tiled.tiles.get(1002) or tiled.tiles.new(1002)
tiled.filepath = os.path.join(folder, "t.<UDIM>.png")
plane(-1, tiled)
for uv in bpy.context.object.data.uv_layers[0].data:
    uv.uv[0] *= 2
sequence = bpy.data.images.load(os.path.join(folder, "f1.png"))
sequence.source = 'SEQUENCE'
plane(1, sequence).image_user.frame_duration = 2
scene.frame_set(2)
bpy.ops.object.camera_add(location=(0, 0, 4))
scene.camera = bpy.context.object
scene.render.engine = 'VOLLEY'
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.volley.samples = 4
scene.render.image_settings.file_format = 'PNG'
scene.view_settings.view_transform = 'Raw'
scene.render.filepath = os.path.join(sys.argv[-1], "picture.png")
bpy.ops.render.render(write_still=True)
pixels = bpy.data.images.load(scene.render.filepath).pixels[:]
print("pixels:", [round(pixels[4 * (32 * 12 + x) + channel]) for x in (4, 12, 20) for channel in range(3)])
"""

_REMOVE = """
import bpy
assert bpy.context.scene.volley.samples
bpy.ops.preferences.addon_disable(module='volley')
assert not hasattr(bpy.context.scene, "volley")
bpy.ops.preferences.addon_enable(module='volley')
assert bpy.context.scene.volley.samples
screen = bpy.context.window_manager.windows[0].screen
with bpy.context.temp_override(area=screen.areas[0]):  # which the operator redraws
    bpy.ops.preferences.addon_remove(module='volley')
"""

# Operators of the preferences, in one Blender that renders with each of two versions.
_USE_EXTENSION = """
import bpy, os, sys
module, *packages = sys.argv[-3:]

def install(package):
    bpy.ops.extensions.package_install_files(filepath=package, repo='user_default', enable_on_install=True)
    scene = bpy.context.scene
    scene.render.engine = 'VOLLEY'
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.volley.samples = 1
    bpy.ops.render.render()
    return {name: part for name, part in sys.modules.items() if name.startswith(module + ".")}

first, second = map(install, packages)
kept = [name for name, part in first.items() if second.get(name) is part]
assert not kept, kept
assert second[module + ".log"].EDITION == 2
assert not second[module + ".native"].load_error()
if os.path.exists("/proc/self/maps"):  # not where a change of root hides it
    with open("/proc/self/maps") as file:
        loaded = {line.split(maxsplit=5)[5].strip() for line in file if "libtracer" in line}
    assert len(loaded) == 1 and "deleted" not in loaded.pop()
bpy.ops.preferences.addon_disable(module=module)
assert not hasattr(bpy.context.scene, "volley")
bpy.ops.preferences.addon_enable(module=module)
assert bpy.context.scene.volley.samples
index = [repository.module for repository in bpy.context.preferences.extensions.repos].index("user_default")
bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="volley")
assert not hasattr(bpy.context.scene, "volley")
print("used")
"""


@pytest.fixture
def home(tmp_path):
    """Runs Blender for a user who has nothing yet; the finished process."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("BLENDER_USER")}
    environment.update(HOME=str(tmp_path), XDG_CONFIG_HOME=str(tmp_path / "config"))

    def run(*arguments):
        done = subprocess.run([blender_support.executable(), *map(str, arguments)], env=environment, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              timeout=120, check=False)
        assert done.returncode == 0, done.stdout
        assert "Traceback" not in done.stdout, done.stdout
        return done.stdout
    return run


def _call(command, *arguments):
    subprocess.run([sys.executable, os.path.join(_REPOSITORY, "examples/package.py"), command, *arguments],
                   check=True)


def _pack(stage, out):
    """The packages of a staged add-on: (extension, legacy)."""
    _call("pack", "--stage", stage, "--platform", "linux-x64", "--out", out)
    extension, = out.glob("*.zip")
    legacy, = out.glob("legacy/*.zip")
    return extension, legacy


@pytest.fixture
def stage(tmp_path):
    """The staged add-on as it is in packages."""
    folder = tmp_path / "stage"
    shutil.copytree(os.path.join(blender_support.user_scripts(), "addons", "volley"), folder,
                    ignore=shutil.ignore_patterns("tracer_reader", "__pycache__"))
    return folder


@pytest.fixture
def packages(stage, tmp_path):
    return _pack(stage, tmp_path / "packages")


@pytest.fixture
def next_packages(packages, stage, tmp_path):
    """Those of a later version, which differs in one module."""
    with open(stage / "log.py", "a", encoding="utf-8") as file:
        file.write("\nEDITION = 2\n")
    manifest = stage / "blender_manifest.toml"
    manifest.write_text(re.sub('^version = .*', 'version = "99.0.0"', manifest.read_text(), flags=re.MULTILINE))
    return _pack(stage, tmp_path / "next")


def test_contents(packages):
    extension, legacy = packages
    with zipfile.ZipFile(extension) as archive:
        names = set(archive.namelist())
        manifest = archive.read("blender_manifest.toml").decode()
        assert 'platforms = ["linux-x64"]' in manifest
        assert archive.getinfo("lib/libtracer.so").external_attr >> 16 & 0o111
    with zipfile.ZipFile(legacy) as archive:
        expected = {f"volley/{name}" for name in names - {"blender_manifest.toml"}} | {"volley/"}
        assert set(archive.namelist()) == expected
        module = ast.parse(archive.read("volley/__init__.py"))
    assert {"__init__.py", "LICENSE", "lib/libtracer.so"} <= names
    assert not any("__pycache__" in name for name in names)
    # One version, which is the library's; Blender reads that of an add-on without running it.
    with open(os.path.join(_REPOSITORY, "libtracer/include/tracer/version.h"), encoding="utf-8") as file:
        version = tuple(map(int, re.findall(r"TRC_VERSION_\w+ (\d+)", file.read())))
    info, = (ast.literal_eval(node.value) for node in module.body
             if isinstance(node, ast.Assign) and node.targets[0].id == "bl_info")
    text = ".".join(map(str, version))
    assert info["version"] == version and extension.name == f"volley-{text}-linux-x64.zip"
    assert f'version = "{text}"' in manifest


def _render(home, tmp_path, module, readers=(True, False)):
    """Images are right, whether Blender's Python has OpenImageIO or Blender itself reads them."""
    script = tmp_path / "render.py"
    script.write_text(_RENDER)
    for has_images in readers:
        output = home("-b", "--addons", module, "--python-exit-code", 1, "--python", script, "--", module,
                      int(has_images), tmp_path)
        assert "pixels: [1, 0, 0, 0, 1, 0, 0, 0, 1]" in output, output
        assert ("Blender reads them" in output) != has_images, output


def _render_by_command(home, tmp_path, module):
    """The command line of farms, as README has it."""
    home("-b", "--addons", module, "-E", "VOLLEY", "--python-expr", f"import {module}.farm.command as c; c.main()",
         "--", "render", "--frames", 1, "--output", tmp_path / "frame_##")
    assert (tmp_path / "frame_01.png").exists()


@pytest.fixture
def is_extension():
    return blender_support.version() >= _HAS_EXTENSIONS


def test_legacy_package(home, packages, tmp_path, is_extension):
    """Installed by the preferences' operators, twice, as an update is; then removed."""
    if is_extension:
        pytest.skip("installs extensions")
    install = (f"import bpy; bpy.ops.preferences.addon_install(filepath={str(packages[1])!r}); "
               "bpy.ops.preferences.addon_enable(module='volley')")
    home("-b", "--python-exit-code", 1, "--python-expr", install)
    _render(home, tmp_path, "volley")
    _render_by_command(home, tmp_path, "volley")
    home("-b", "--addons", "volley", "--python-exit-code", 1, "--python-expr", install +
         "; assert bpy.context.scene.volley.samples")
    home("-b", "--addons", "volley", "--python-exit-code", 1, "--python-expr", _REMOVE)
    assert not list(tmp_path.glob("config/blender/*/scripts/addons/volley"))


def test_extension(home, packages, tmp_path, is_extension):
    """Checked and installed by Blender's command, twice, as an update is; then removed."""
    if not is_extension:
        pytest.skip("installs add-ons")
    extension = packages[0]
    home("--command", "extension", "validate", extension)
    for readers in (True, False), ():
        home("--command", "extension", "install-file", "--repo", "user_default", "--enable", extension)
        _render(home, tmp_path, _EXTENSION, readers)
    _render_by_command(home, tmp_path, _EXTENSION)
    folder, = tmp_path.glob("config/blender/*/extensions/user_default/volley")
    home("--command", "extension", "remove", "volley")
    assert not folder.exists()


def test_extension_by_operators(home, packages, next_packages, tmp_path, is_extension):
    """Installed, brought up to date, disabled and removed in a running Blender."""
    if not is_extension:
        pytest.skip("installs add-ons")
    script = tmp_path / "use.py"
    script.write_text(_USE_EXTENSION)
    assert "used" in home("-b", "--python-exit-code", 1, "--python", script, "--", _EXTENSION, packages[0],
                          next_packages[0])


def test_repository(home, packages, tmp_path, is_extension):
    """The folder of packages is a repository as Blender would make it, and serves one."""
    if not is_extension:
        pytest.skip("installs add-ons")
    folder = packages[0].parent
    _call("index", "--out", folder)
    index = json.loads((folder / "index.json").read_text())
    home("--command", "extension", "server-generate", "--repo-dir", folder)
    assert json.loads((folder / "index.json").read_text()) == index
    home("--command", "extension", "repo-add", "studio", "--name", "Studio", "--url",
         (folder / "index.json").as_uri())
    home("--online-mode", "--command", "extension", "install", "--sync", "--enable", "studio.volley")
    _render(home, tmp_path, "bl_ext.studio.volley", [True])

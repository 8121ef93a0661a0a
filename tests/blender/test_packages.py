# SPDX-License-Identifier: Apache-2.0
"""Packages: made of the staged add-on, installed as a user does, used, brought up to date, removed.

Blender runs with a home folder of its own and without the user scripts of the build, so that the package
is all there is of Volley."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest

import blender as blender_support

_REPOSITORY = blender_support.REPOSITORY
_HAS_EXTENSIONS = (4, 2)  # the first Blender that has them
_EXTENSION = "bl_ext.user_default.volley"

# A red tile beside a green one: right only where files are read tile by tile.
_RENDER = """
import bpy, os, sys
scene = bpy.context.scene
for number, color in ((1001, (1, 0, 0, 1)), (1002, (0, 1, 0, 1))):
    made = bpy.data.images.new("Tile", 8, 8)
    made.pixels.foreach_set(color * 64)
    made.filepath_raw, made.file_format = os.path.join(sys.argv[-1], f"t.{number}.png"), 'PNG'
    made.save()
image = bpy.data.images.load(os.path.join(sys.argv[-1], "t.1001.png"))
image.source = 'TILED'
image.tiles.get(1002) or image.tiles.new(1002)
image.filepath = os.path.join(sys.argv[-1], "t.<UDIM>.png")
bpy.ops.object.select_all(action='SELECT')
bpy.ops.object.delete()
bpy.ops.mesh.primitive_plane_add()
for uv in bpy.context.object.data.uv_layers[0].data:
    uv.uv[0] *= 2
material = bpy.data.materials.new("Tiles")
material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
texture, emission = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeEmission")
texture.image = image
links.new(texture.outputs["Color"], emission.inputs["Color"])
links.new(emission.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
bpy.context.object.data.materials.append(material)
bpy.ops.object.camera_add(location=(0, 0, 3))
scene.camera = bpy.context.object
scene.render.engine = 'VOLLEY'
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.volley.samples = 4
scene.render.image_settings.file_format = 'PNG'
scene.view_settings.view_transform = 'Raw'
scene.render.filepath = os.path.join(sys.argv[-1], "picture.png")
bpy.ops.render.render(write_still=True)
pixels = bpy.data.images.load(scene.render.filepath).pixels[:]
print("red and green:", [round(pixels[4 * (32 * 12 + x) + channel], 2) for x in (12, 20) for channel in range(3)])
"""

_REMOVE = """
import bpy
screen = bpy.context.window_manager.windows[0].screen
with bpy.context.temp_override(area=screen.areas[0]):  # which the operator redraws
    bpy.ops.preferences.addon_remove(module='volley')
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


@pytest.fixture
def packages(tmp_path):
    """The packages made of the staged add-on: (extension, legacy)."""
    stage, out = tmp_path / "stage", tmp_path / "packages"
    shutil.copytree(os.path.join(blender_support.user_scripts(), "addons", "volley"), stage,
                    ignore=shutil.ignore_patterns("tracer_reader"))
    subprocess.run([sys.executable, os.path.join(_REPOSITORY, "examples/package.py"), "pack", "--stage", stage,
                    "--platform", "linux-x64", "--out", out], check=True)
    extension, = out.glob("*.zip")
    legacy, = out.glob("legacy/*.zip")
    return extension, legacy


def test_contents(packages):
    extension, legacy = packages
    with zipfile.ZipFile(extension) as archive:
        names = set(archive.namelist())
        assert b'platforms = ["linux-x64"]' in archive.read("blender_manifest.toml")
        assert archive.getinfo("lib/libtracer.so").external_attr >> 16 & 0o111
    with zipfile.ZipFile(legacy) as archive:
        expected = {f"volley/{name}" for name in names - {"blender_manifest.toml"}} | {"volley/"}
        assert set(archive.namelist()) == expected
    assert {"__init__.py", "LICENSE", "lib/libtracer.so"} <= names
    assert not any("__pycache__" in name for name in names)


def _render(home, tmp_path, *arguments):
    script = tmp_path / "render.py"
    script.write_text(_RENDER)
    output = home("-b", *arguments, "--python-exit-code", 1, "--python", script, "--", tmp_path)
    assert "red and green: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]" in output, output
    assert "Blender reads them" not in output, output  # as where no program for it is found


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
    _render(home, tmp_path, "--addons", "volley")
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
    for _ in range(2):
        home("--command", "extension", "install-file", "--repo", "user_default", "--enable", extension)
        _render(home, tmp_path, "--addons", _EXTENSION)
    folder, = tmp_path.glob("config/blender/*/extensions/user_default/volley")
    home("--command", "extension", "remove", "volley")
    assert not folder.exists()

# SPDX-License-Identifier: Apache-2.0
"""Prepare scenes and settings for comparing engines; runs inside Blender.

Make a scene, ready to render, from files of a scene folder:

    blender -b --factory-startup -P scene_setups.py -- prepare NAME SCENES_DIR OUT.blend

Before a render, set resolution, samples and comparable transport from a JSON object:

    blender -b FILE.blend -P scene_setups.py -E ENGINE -o OUT -f FRAME -- settings '{"samples": 64}'

Render many pictures of the open file, one after the other in one process, and write down how long
each took; JOBS.json is a list of {"engine", "frame", "settings", "output"}:

    blender -b FILE.blend -P scene_setups.py -- batch JOBS.json SECONDS.json

``SCENES`` and ``source_key`` can also be read outside Blender. Lengths are metres, powers watts.
"""

import hashlib
import inspect
import json
import math
import pathlib
import runpy
import sys
import tempfile
import time
from dataclasses import dataclass
from typing import Callable, Optional

try:
    import bpy
    from mathutils import Vector
except ImportError:  # outside Blender only the table of scenes is of use
    bpy = None

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import effect_scenes  # noqa: E402  (the folder is on the path only now)
import hair_scenes  # noqa: E402
import large_scenes  # noqa: E402
from scene_blocks import (  # noqa: E402
    add_area_light, add_ball, add_camera, add_floor, animate, open_blend, pose_from_action, set_world)

# Raise this when a helper, here or in scene_blocks.py, changes what prepared scenes look like.
SETUP_VERSION = 2

DEFAULT_SETTINGS = {
    "width": 320, "height": 180, "samples": 64, "seed": 0, "max_depth": 50,
    "filter": "BLACKMAN_HARRIS", "filter_width_px": 1.5, "volley": {},
}


# Comparable settings ---------------------------------------------------------------------------

def apply_settings(scene, settings):
    """Set output, sampling and the same light transport for Cycles and Volley."""
    settings = {**DEFAULT_SETTINGS, **settings}
    apply_output(scene, settings)
    apply_cycles(scene, settings)
    apply_volley(scene, settings)
    for layer in scene.view_layers:
        layer.samples = 0
        set_if_present(getattr(layer, "cycles", None), {"use_denoising": False})


def apply_output(scene, settings):
    """Whole frame, no compositor, float EXR."""
    render = scene.render
    render.resolution_x, render.resolution_y = settings["width"], settings["height"]
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    render.use_border = False
    render.use_compositing = render.use_sequencer = False
    render.use_file_extension = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "ZIP"


def apply_cycles(scene, settings):
    """Cycles without diffuse interreflection, clamps, adaptive sampling and denoising."""
    depth = settings["max_depth"]
    set_if_present(getattr(scene, "cycles", None), {
        "device": "CPU", "samples": settings["samples"], "seed": settings["seed"],
        "use_animated_seed": False, "use_adaptive_sampling": False, "use_denoising": False,
        "time_limit": 0.0, "use_fast_gi": False, "use_guiding": False,
        "max_bounces": depth, "diffuse_bounces": 0, "glossy_bounces": depth,
        "transmission_bounces": depth, "transparent_max_bounces": depth, "volume_bounces": 0,
        "min_light_bounces": 0, "min_transparent_bounces": 0,
        "sample_clamp_direct": 0.0, "sample_clamp_indirect": 0.0, "blur_glossy": 0.0,
        "light_sampling_threshold": 0.0, "caustics_reflective": True, "caustics_refractive": True,
        "film_exposure": 1.0, "pixel_filter_type": settings["filter"],
        "filter_width": settings["filter_width_px"]})


def apply_volley(scene, settings):
    """Distribution without clamps and filters; ``settings["volley"]`` overrides any property."""
    set_if_present(getattr(scene, "volley", None), {
        "integrator": "DISTRIBUTION", "samples": settings["samples"], "seed": settings["seed"],
        "max_depth": settings["max_depth"], "max_transparent_depth": settings["max_depth"],
        "clamp_direct": 0.0, "clamp_indirect": 0.0, "filter_glossy": 0.0,
        **settings["volley"]})


def set_if_present(target, values):
    """Set those properties that ``target`` has in this Blender."""
    for name, value in values.items():
        if hasattr(target, name):
            setattr(target, name, value)


# Scenes ----------------------------------------------------------------------------------------

def prepare_as_is(source, _folder):
    """A .blend that already has camera and lights."""
    open_blend(source)


def prepare_robot(source, _folder):
    """The robot on a polished floor, running, under three area lights, with depth of field."""
    open_blend(source)
    pose_from_action("RobotArmature", "Robot_Running", SCENES["robot"].frame)
    add_floor(60.0, (0.16, 0.18, 0.20), 0.06)
    set_world((0.10, 0.13, 0.18))
    add_area_light("Key", (-5.0, -6.0, 8.0), (0, 0, 2.2), 4.0, 1600.0, (1.0, 0.95, 0.88))
    add_area_light("Rim", (5.0, 5.0, 6.0), (0, 0, 2.5), 2.5, 1300.0, (0.7, 0.85, 1.0))
    add_area_light("Fill", (7.0, -6.0, 3.0), (0, 0, 2.0), 5.0, 350.0)
    add_camera((-4.8, -13.5, 3.6), (0.0, 0.0, 2.0), 52.0, fstop=0.35, focus=(-0.3, -1.2, 3.4))


def prepare_knight(source, folder):
    """The knight striking, with one sword and one shield, on a glossy floor."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    shims = folder / "import_shims.py"
    runpy.run_path(str(shims))
    bpy.ops.import_scene.gltf(filepath=str(source))
    for name in ("1H_Sword_Offhand", "2H_Sword", "Badge_Shield", "Rectangle_Shield",
                 "Spike_Shield"):
        bpy.data.objects[name].hide_render = True
    pose_from_action("Rig", "1H_Melee_Attack_Slice_Diagonal_Rig",
                     SCENES["knight"].frame)
    add_floor(40.0, (0.25, 0.20, 0.15), 0.12)
    set_world((0.10, 0.12, 0.15))
    add_area_light("Key", (-3.0, -3.0, 4.5), (0, 0, 1.0), 2.0, 420.0, (1.0, 0.92, 0.82))
    add_area_light("Rim", (3.0, 2.5, 3.0), (0, 0, 1.2), 1.5, 350.0, (0.65, 0.8, 1.0))
    add_area_light("Fill", (4.0, -3.5, 1.6), (0, 0, 1.0), 3.0, 90.0)
    add_camera((1.6, -6.2, 1.7), (0.0, 0.0, 1.07), 45.0, fstop=0.6, focus=(0.0, -0.4, 1.6))


def prepare_conference(source, _folder):
    """The conference room from a camera that moves past the table, with depth of field."""
    open_blend(source)
    camera = bpy.context.scene.camera
    camera.data.dof.use_dof, camera.data.dof.aperture_fstop = True, 0.25
    animate(camera, "location", {0: Vector((-0.06, 0.03, 0.0)), 2: Vector((0.06, -0.03, 0.0))})


def prepare_billiards(_source, _folder):
    """Five glossy balls on cloth under one lamp: one rolls, one is struck within the frame, three
    rest (the arrangement of R. L. Cook, T. Porter and L. Carpenter, "Distributed Ray Tracing",
    1984)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_floor(8.0, (0.02, 0.16, 0.06), 0.8)
    set_world((0.04, 0.05, 0.06))
    add_area_light("Lamp", (-0.6, 0.8, 2.2), (0, 0, 0), 0.8, 60.0, (1.0, 0.93, 0.82))
    add_area_light("Window", (2.5, -1.5, 1.6), (0, 0, 0), 1.0, 25.0, (0.75, 0.85, 1.0))
    balls = [add_ball(f"Ball {i}", (x, y, 0.25), 0.25, color) for i, (x, y, color) in enumerate((
        (-0.75, 0.25, (0.75, 0.50, 0.03)), (-0.15, 0.55, (0.80, 0.80, 0.72)),
        (0.45, 0.80, (0.45, 0.02, 0.02)), (0.35, -0.15, (0.02, 0.10, 0.45)),
        (-0.45, -0.45, (0.03, 0.03, 0.03))))]
    animate(balls[1], "location", {0: Vector((-0.18, -0.24, 0.0)), 2: Vector((0.18, 0.24, 0.0))})
    animate(balls[1], "rotation_euler", {0: Vector((-1.0, 0.7, 0.0)), 2: Vector((1.0, -0.7, 0.0))})
    animate(balls[3], "location", {0: Vector((0.0, 0.0, 0.0)), 1: Vector((0.0, 0.0, 0.0)),
                                   2: Vector((0.3, -0.12, 0.0))})
    add_camera((-0.4, -3.4, 1.5), (-0.05, 0.15, 0.2), 50.0, fstop=0.35, focus=(-0.45, -0.45, 0.4))


def prepare_appleseed(source, _folder):
    """A scene of another renderer: its materials, aperture and light sizes are made here, all else
    is as it was. The keys run from frame 1 to 2 where the shutter opens at the frame."""
    open_blend(source)
    scene = bpy.context.scene
    gray = bpy.data.materials.new("Comparison")
    for material in bpy.data.materials:
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
        shader.inputs["Base Color"].default_value = (0.6, 0.45, 0.3, 1.0)
        shader.inputs["Roughness"].default_value = 0.25
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
    for data in bpy.data.meshes:
        if not data.materials:
            data.materials.append(gray)
    for data in bpy.data.lights:
        if data.type in {"POINT", "SPOT"}:
            data.shadow_soft_size, data.energy = 0.5, 1500.0
        elif data.type == "SUN":
            data.angle = 0.1
        else:
            data.energy = 800.0
    if not bpy.data.lights:
        add_area_light("Lamp", (4.0, -4.0, 5.0), (0, 0, 0), 1.5, 800.0)
    set_world((0.25, 0.3, 0.4))
    for layer in scene.view_layers:
        layer.use_sky = True
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop = True, 0.12
    if dof.focus_object is None:
        # In front of what the camera looks at, so that that is blurred too.
        dof.focus_distance = 0.7 * scene.camera.matrix_world.translation.length
    scene.cycles.motion_blur_position = "START"


def prepare_spin(_source, _folder):
    """Two propellers that make a third of a turn while the shutter is open, one of them growing, in
    front of a camera that rolls."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_world((0.5, 0.55, 0.6))
    add_area_light("Lamp", (3.0, -5.0, 5.0), (0, 0, 0), 2.0, 500.0)
    for x, growth in ((-1.3, 0.0), (1.3, 0.4)):
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(x, 0.0, 0.0), rotation=(0.3, 0.0, 0.0))
        blade = bpy.context.object
        blade.scale = (2.0, 0.3, 0.4)
        turn = math.radians(60.0)
        animate(blade, "rotation_euler", {0: (0.0, -turn, 0.0), 2: (0.0, turn, 0.0)})
        animate(blade, "scale", {0: (0.0, 0.0, 0.0), 2: (growth, growth, 0.0)})
    camera = add_camera((0.0, -6.0, 0.0), (0.0, 0.0, 0.0), 40.0)
    animate(camera, "rotation_euler", {0: (0.0, -0.1, 0.0), 2: (0.0, 0.1, 0.0)})


def prepare_example(source, _folder):
    """The project's own character, made by its script."""
    with tempfile.TemporaryDirectory() as made:
        output = str(pathlib.Path(made) / "example.blend")
        saved, sys.argv = sys.argv, [str(source), "--", output]
        try:
            runpy.run_path(str(source), run_name="__main__")
        finally:
            sys.argv = saved
        open_blend(output)


@dataclass(frozen=True)
class Scene:
    """Where a scene comes from, how it is prepared, and at what size it is compared by default.

    ``source`` is relative to the scene folder, or to the project when ``in_project``, or None for a
    scene made here; ``frame`` is the frame to render, ``stops`` the exposure of pictures to look at;
    with ``shutter``, in frames, there is motion blur. ``is_flat`` takes smooth shading away: the
    interpolated normals of deforming meshes are shorter than 1 in Cycles 3.4, which darkens them by
    some tenths of a percent.
    """

    source: Optional[str]
    prepare: Callable
    width: int
    height: int
    frame: int = 1
    in_project: bool = False
    stops: float = 0.0
    shutter: float = 0.0
    is_flat: bool = False

    def source_path(self, scenes_dir):
        """The file the scene is made from, None if it is made here."""
        if self.source is None:
            return None
        project = pathlib.Path(__file__).resolve().parents[2]
        return (project if self.in_project else pathlib.Path(scenes_dir)) / self.source


IGNIS = "07_ignis_cycles_refs/blender/"
APPLESEED = "08_appleseed_motion_dof_lamps/"

SCENES = {
    "example": Scene("examples/make_character.py", prepare_example, 192, 108, 20, in_project=True),
    "conference": Scene("01_conference/conference.blend", prepare_as_is, 160, 120),
    "robot": Scene("06_quaternius_robot/robot.blend", prepare_robot, 192, 108, 6),
    "knight": Scene("05_kaykit_knight/Knight.glb", prepare_knight, 192, 108, 9),
    "box": Scene(IGNIS + "box.blend", prepare_as_is, 128, 128),
    "sun": Scene(IGNIS + "sun.blend", prepare_as_is, 128, 128, stops=-6.0),
    "lights": Scene(IGNIS + "lights.blend", prepare_as_is, 128, 128),
    "tex": Scene(IGNIS + "tex.blend", prepare_as_is, 128, 128),
    "example_motion": Scene("examples/make_character.py", prepare_example, 160, 90, 12,
                            in_project=True, shutter=0.5),
    "robot_motion": Scene("06_quaternius_robot/robot.blend", prepare_robot, 160, 90, 6, shutter=0.7),
    "knight_motion": Scene("05_kaykit_knight/Knight.glb", prepare_knight, 160, 90, 9, shutter=0.6),
    "conference_motion": Scene("01_conference/conference.blend", prepare_conference, 160, 120,
                               shutter=0.8),
    "billiards": Scene(None, prepare_billiards, 160, 90, shutter=0.9),
    "spin": Scene(None, prepare_spin, 128, 80, shutter=1.0),
    "lens": Scene(APPLESEED + "cameras/01 - basic_dof.blend", prepare_appleseed, 96, 96),
    "lens_shift": Scene(APPLESEED + "cameras/02 - camera_shift.blend", prepare_appleseed, 96, 72),
    "area_lamp": Scene(APPLESEED + "lamps/01 - area.blend", prepare_appleseed, 96, 56),
    "spot_lamp": Scene(APPLESEED + "lamps/02 - textured_spot.blend", prepare_appleseed, 96, 96),
    "sun_lamp": Scene(APPLESEED + "lamps/03 - sun_lamp.blend", prepare_appleseed, 96, 96),
    "sun_sky": Scene(APPLESEED + "lamps/04 - sun_environ.blend", prepare_appleseed, 96, 96),
    "camera_motion": Scene(APPLESEED + "motion_blur/01 - camera.blend", prepare_appleseed, 96, 56,
                           shutter=0.8),
    "object_motion": Scene(APPLESEED + "motion_blur/02 - object.blend", prepare_appleseed, 96, 56,
                           shutter=0.8),
    "group_motion": Scene(APPLESEED + "motion_blur/03 - linked_group.blend", prepare_appleseed,
                          96, 56, shutter=0.8),
    "mesh_motion": Scene(APPLESEED + "motion_blur/04 - mesh.blend", prepare_appleseed, 96, 72,
                         frame=3, shutter=1.0),
    "mesh_motion_flat": Scene(APPLESEED + "motion_blur/04 - mesh.blend", prepare_appleseed, 96, 72,
                              frame=3, shutter=1.0, is_flat=True),
    "knight_motion_flat": Scene("05_kaykit_knight/Knight.glb", prepare_knight, 160, 90, 9,
                                shutter=0.6, is_flat=True),
    "example_motion_flat": Scene("examples/make_character.py", prepare_example, 160, 90, 12,
                                 in_project=True, shutter=0.5, is_flat=True),
    **{name: Scene(None, prepare, 128, 72, shutter=shutter)
       for name, (prepare, shutter) in effect_scenes.SCENES.items()},
    **{name: Scene(None, prepare, 320, 240, shutter=shutter)
       for name, (prepare, shutter) in hair_scenes.SCENES.items()},
    **{name: Scene(source, prepare, 160, 120, shutter=shutter)
       for name, (prepare, shutter, source) in large_scenes.SCENES.items()},
}


def source_key(name, scenes_dir):
    """A hash that changes when the prepared scene would."""
    scene = SCENES[name]
    module = inspect.getmodule(scene.prepare)
    # Scenes of a module of their own share its helpers.
    text = inspect.getsource(module if module in (effect_scenes, hair_scenes, large_scenes) else scene.prepare)
    text += str(SETUP_VERSION)
    if scene.shutter > 0.0:
        text += str(scene.shutter)
    if scene.is_flat:
        text += "flat"
    source = scene.source_path(scenes_dir)
    data = (source.read_bytes() if source else b"") + text.encode()
    return hashlib.sha256(data).hexdigest()[:16]


# Commands --------------------------------------------------------------------------------------

def command_prepare(name, scenes_dir, output):
    """Prepare a scene and save it."""
    scene = SCENES[name]
    source = scene.source_path(scenes_dir)
    scene.prepare(source and source.resolve(), pathlib.Path(scenes_dir).resolve())
    if scene.shutter > 0.0:
        render = bpy.context.scene.render
        render.use_motion_blur, render.motion_blur_shutter = True, scene.shutter
    if scene.is_flat:
        for data in bpy.data.meshes:
            data.use_auto_smooth = False
            data.polygons.foreach_set("use_smooth", [False] * len(data.polygons))
    bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(output).resolve()))


def command_settings(text):
    """Apply settings to the open file; Volley's and Cycles' engine ids come from ``-E``."""
    apply_settings(bpy.context.scene, json.loads(text))


def command_batch(jobs_path, seconds_path):
    """Render a list of jobs and save each picture; the seconds of each render, from synchronising to the picture
    in Blender, are kept, those of its file are left out."""
    scene, seconds = bpy.context.scene, []
    for job in json.loads(pathlib.Path(jobs_path).read_text()):
        apply_settings(scene, job["settings"])
        scene.render.engine = job["engine"]
        scene.frame_set(job["frame"])
        start = time.perf_counter()
        bpy.ops.render.render()
        seconds.append(time.perf_counter() - start)
        bpy.data.images["Render Result"].save_render(job["output"], scene=scene)
    pathlib.Path(seconds_path).write_text(json.dumps(seconds))


def main():
    """Run the command after ``--``."""
    command, *arguments = sys.argv[sys.argv.index("--") + 1:]
    {"prepare": command_prepare, "settings": command_settings,
     "batch": command_batch}[command](*arguments)


if __name__ == "__main__":
    main()

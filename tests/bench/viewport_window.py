# SPDX-License-Identifier: Apache-2.0
"""How long after a pose the rendered viewport shows it, in a window, beside Cycles' on the same file.

    mkdir -p build/screen
    BLENDER_USER_SCRIPTS=$PWD/build/blender LIBGL_ALWAYS_SOFTWARE=1 \\
        xvfb-run -a -s "-screen 0 960x540x24 -fbdir $PWD/build/screen" \\
        blender --factory-startup --addons volley --window-geometry 0 0 960 540 \\
        --python tests/bench/viewport_window.py -- \\
        --screen build/screen/Xvfb_screen0 [--poses N] [--rounds N] [--json FILE]

The skinned character of viewport_scenes.py, looked at through its camera in a view that fills the window,
without overlays. A bone is set to one of two poses in turn, the next as soon as the one before is seen: as
if somebody dragged it. A pose is seen when the pixels in which the two differ most, as learnt from
pictures at rest, are nearer to those of the new one; pictures of larger pixels count, as long as all of the
view shows the pose. Pixels are those of the virtual screen, which a thread looks at every millisecond.
Times run from the end of Blender's own evaluation until the pose is on the screen. What Blender itself
takes to draw, which without a graphics card is most of it, is measured by an engine that only shows a
colour for each pose, and taken away from the others' times for their ratio. Rounds of all engines take
turns.
"""

import argparse
import json
import pathlib
import statistics
import sys
import threading
import time

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import scenes  # noqa: E402  (found by the line above)
import viewport_scenes  # noqa: E402
from screen import Screen  # noqa: E402

POSES = (0.5, 3.5)        # of viewport_scenes.pose: bent to one side and to the other
REST_SECONDS = 3.0        # until a view has a picture at rest
LONGEST_SECONDS = 30.0    # after which a pose counts as never seen
TELLING_PIXELS = 400      # in which the two poses differ most
LOOK_SECONDS = 0.001      # between two looks at the screen
SAMPLES = 32


class ColorEngine(bpy.types.RenderEngine):
    """Draws one colour for each pose: the least that a pose can take."""

    bl_idname = 'COLOR'
    bl_label = "Color"

    def view_update(self, context, depsgraph):
        """Nothing to do."""

    def view_draw(self, context, depsgraph):
        turn = bpy.data.objects["Rig"].pose.bones[viewport_scenes.POSED_BONE].rotation_euler.z
        color = (1.0, 0.0, 0.0, 1.0) if turn > 0.0 else (0.0, 1.0, 0.0, 1.0)
        texture = gpu.types.GPUTexture((1, 1), format='RGBA16F',
                                       data=gpu.types.Buffer('FLOAT', 4, color))
        self.bind_display_space_shader(depsgraph.scene)
        draw_texture_2d(texture, (0, 0), context.region.width, context.region.height)
        self.unbind_display_space_shader()


class Watch(threading.Thread):
    """Looks at the screen all the time and tells which pose it shows."""

    def __init__(self, screen):
        super().__init__(daemon=True)
        self._screen = screen
        self._pictures = {}   # of each pose, at rest
        self._places = None   # rows and columns of the telling pixels
        self._awaited = None
        self._is_closed = False
        self.seen = 0.0       # when the awaited pose was first seen, 0.0 for not yet
        self.evaluated = 0.0  # when Blender had last evaluated a change
        bpy.app.handlers.depsgraph_update_post.append(self._note)
        self.start()

    def close(self):
        self._is_closed = True
        self.join()
        bpy.app.handlers.depsgraph_update_post.remove(self._note)

    def learn(self, pose):
        """Take what the screen shows for the picture of a pose at rest."""
        self._pictures[pose] = self._screen.pixels.astype(np.int16)
        if len(self._pictures) == len(POSES):
            first, second = self._pictures.values()
            apart = np.abs(first - second).sum(axis=2)
            telling = np.argsort(apart, axis=None)[-TELLING_PIXELS:]
            self._places = np.unravel_index(telling, apart.shape)

    def expect(self, pose):
        """Look for a pose from now on."""
        self.seen, self._awaited = 0.0, pose

    def run(self):
        while not self._is_closed:
            if self._awaited is not None and self._shown() == self._awaited:
                self.seen, self._awaited = time.perf_counter(), None
            time.sleep(LOOK_SECONDS)

    def _note(self, _scene, _depsgraph):
        self.evaluated = time.perf_counter()

    def _shown(self):
        """The pose whose picture is nearer to what the screen shows."""
        pixels = self._screen.pixels[self._places].astype(np.int16)
        apart = {pose: int(np.abs(picture[self._places] - pixels).sum())
                 for pose, picture in self._pictures.items()}
        return min(apart, key=apart.get)


def prepare(engine):
    """The view through the camera, rendered by an engine; Cycles is held to the same light transport."""
    scene = bpy.context.scene
    scene.render.engine = 'BLENDER_WORKBENCH'
    scenes.set_engine(engine, SAMPLES)
    scene.volley.preview_samples = SAMPLES
    scene.cycles.preview_samples = SAMPLES
    scene.cycles.use_preview_denoising = scene.cycles.use_preview_adaptive_sampling = False


def open_view():
    """Fill the window with one view and nothing else."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    region = next(region for region in area.regions if region.type == 'WINDOW')
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)


def set_view():
    """Look through the camera, which fills the view; only what is rendered shows."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    space = area.spaces.active
    space.overlay.show_overlays = space.show_gizmo = space.show_region_header = False
    space.shading.type = 'RENDERED'
    space.region_3d.view_perspective = 'PERSP'
    camera = bpy.context.scene.camera
    space.region_3d.view_matrix = camera.matrix_world.inverted()
    space.lens = 50.0
    return next(region for region in area.regions if region.type == 'WINDOW')


def follow(watch, engine, pose_count):
    """Generator of one engine's round; what it returns: seconds to see each pose, and between poses."""
    prepare(engine)
    for pose in POSES:
        viewport_scenes.pose(pose)
        yield REST_SECONDS
        watch.learn(pose)
    shown, between = [], []
    before = None
    for number in range(pose_count):
        pose = POSES[number % len(POSES)]
        watch.expect(pose)
        begin = time.perf_counter()
        viewport_scenes.pose(pose)
        bpy.context.view_layer.update()
        while not watch.seen:
            if time.perf_counter() - begin > LONGEST_SECONDS:
                raise RuntimeError(f"{engine} never showed pose {number}")
            yield 0.0
        shown.append(watch.seen - watch.evaluated)
        if before is not None:
            between.append(watch.seen - before)
        before = watch.seen
    return shown, between


def run(arguments):
    yield 0.5
    scenes.empty(size=(960, 540))
    bpy.utils.register_class(ColorEngine)
    yield 0.5
    bpy.context.preferences.view.show_splash = False
    bpy.context.scene.view_settings.view_transform = 'Standard'
    viewport_scenes.fill_character()
    open_view()
    yield 0.5
    region = set_view()
    watch = Watch(Screen(arguments.screen))
    found = {engine: ([], []) for engine in ('COLOR', 'VOLLEY', 'CYCLES')}
    for _ in range(arguments.rounds):
        for engine, lists in found.items():
            for kept, values in zip(lists, (yield from follow(watch, engine, arguments.poses))):
                kept += values
    watch.close()
    report(arguments, found, (region.width, region.height))


def report(arguments, found, size):
    rows = []
    for engine, (shown, between) in found.items():
        row = {"engine": engine, "size": size, "poses": len(shown),
               "shown_ms": [1e3 * value for value in shown],
               "median_ms": 1e3 * statistics.median(shown),
               "p90_ms": 1e3 * statistics.quantiles(shown, n=10)[-1],
               "pictures_per_second": 1.0 / statistics.median(between)}
        rows.append(row)
        print(f"{engine:8} {size[0]}x{size[1]}: a pose is seen after {row['median_ms']:.1f} ms (median of "
              f"{len(shown)}, 90 % within {row['p90_ms']:.1f} ms); {row['pictures_per_second']:.1f} poses "
              "a second", flush=True)
    color, volley, cycles = (row["median_ms"] for row in rows)
    print(f"beyond Blender's drawing: Volley {volley - color:.1f} ms, Cycles {cycles - color:.1f} ms, "
          f"{(cycles - color) / (volley - color):.1f} times as long", flush=True)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)


def parse_arguments():
    parser = argparse.ArgumentParser(prog="viewport_window.py")
    parser.add_argument("--screen", required=True, help="the file of the virtual screen")
    parser.add_argument("--poses", type=int, default=40, help="in each round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", help="write a row for each engine there")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def main():
    steps = run(parse_arguments())

    def step():
        try:
            return next(steps)
        except StopIteration:
            pass
        except BaseException:
            sys.excepthook(*sys.exc_info())
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(step, first_interval=0.5, persistent=True)


main()

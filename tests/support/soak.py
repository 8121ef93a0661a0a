# SPDX-License-Identifier: Apache-2.0
"""A long day in a window of Blender: renders started and cancelled beside a viewport, storms of undo; what
memory it took.

``inside_soak`` runs inside Blender (see blender.py). Each cycle edits the scene, lets the viewport begin to
render that, starts a final render, which sees Esc after a random time, in sync, build, render or after the
end; then the engine has freed all it had.
"""

import math
import os

WINDOW = 320, 240       # pixels: Blender's drawing without a graphics card is most of a cycle
CANCEL_SECONDS = 0.15   # the latest Esc, about twice what a render takes
UNDO_CYCLES = 25        # from one storm to the next
UNDO_STEPS = 12
DRAW_SECONDS = 0.02     # for the viewport, between two renders
LONGEST_SECONDS = 20.0  # for which Blender may forbid edits
WARM_SHARE = 0.3        # of the cycles after which memory must no longer grow
ALLOWED_GROWTH = 8.0    # MiB from there to the end


def inside_soak(cycle_count):
    """Generator for run_in_window: what it returns is one row for each cycle, (seconds, MiB), and how
    many renders were cancelled."""
    import random
    import time
    import bpy
    import edits
    import escape
    import scenes
    yield 0.1
    scene = scenes.empty(size=(160, 90), samples=64)
    yield 0.5
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    region = next(region for region in area.regions if region.type == 'WINDOW')
    view = {"window": window, "area": area, "region": region}
    with bpy.context.temp_override(**view):
        edits.fill(scene)
    bpy.ops.ed.undo_push(message="scene")
    bpy.context.preferences.view.render_display_type = 'NONE'
    scene.volley.preview_samples = 16
    with bpy.context.temp_override(**view):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 0.5
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    region = next(region for region in area.regions if region.type == 'WINDOW')
    view = {"window": window, "area": area, "region": region}
    area.spaces.active.shading.type = 'RENDERED'
    dice, deadline, pressed, cancelled, rows = random.Random(1), [0.0], [False], 0, []

    def is_pressed():
        pressed[0] |= time.monotonic() > deadline[0]
        return pressed[0]

    escape.watch(is_pressed)
    begin = time.monotonic()
    for cycle in range(cycle_count):
        yield from _edit(dice.choice((edits.pose, edits.transform, edits.material,
                                      edits.light_energy)), dice)
        pressed[0], deadline[0] = False, time.monotonic() + dice.uniform(0.0, CANCEL_SECONDS)
        bpy.ops.render.render()
        cancelled += pressed[0]
        yield DRAW_SECONDS
        if cycle % UNDO_CYCLES == UNDO_CYCLES - 1:
            yield from _undo_storm(bpy, edits, dice, view)
        rows.append((time.monotonic() - begin, _resident_mib()))
        print(f"cycle {cycle}: {rows[-1][0]:.1f} s, {rows[-1][1]:.1f} MiB", flush=True)
    return rows, cancelled


def _edit(edit, dice):
    """Edit when Blender allows it: while another thread is in an engine's Python, it forbids that to all."""
    import time
    started = time.monotonic()
    while True:
        try:
            edit(dice)
            return
        except AttributeError as error:
            if "not allowed" not in str(error) or time.monotonic() - started > LONGEST_SECONDS:
                raise
            yield 0.01


def _undo_storm(bpy, edits, dice, view):
    """Edits, each with its undo step, then all but the first undone and done again, drawing now and
    then."""
    for _ in range(UNDO_STEPS):
        yield from _edit(dice.choice((edits.pose, edits.transform, edits.material, edits.duplicate)),
                         dice)
        bpy.ops.ed.undo_push(message="edit")
        if dice.random() < 0.3:
            yield 0.01
    for operator in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        for _ in range(UNDO_STEPS - 1):
            with bpy.context.temp_override(**view):
                if operator.poll():
                    operator()
            if dice.random() < 0.3:
                yield 0.01


def _resident_mib():
    if not os.path.exists("/proc/self/statm"):
        return math.nan
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 2.0 ** 20


def growth(rows):
    """MiB that memory has grown by from the end of the warm-up to the end: medians of tenths, since
    single values go up and down with what renders just then."""
    import statistics
    memory = [mib for _, mib in rows]
    tenth = max(1, len(memory) // 10)
    first = int(len(memory) * WARM_SHARE)
    return statistics.median(memory[-tenth:]) - statistics.median(memory[first:first + tenth])

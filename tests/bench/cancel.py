#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How soon the library stops when it is told to: commits and renders of five million triangles, cancelled at
random moments.

    VOLLEY_BUILD=build python3 tests/bench/cancel.py [--triangles N] [--trials N]

Milliseconds from the call to the end of the work, for each of: the first build; a refit, where all
vertices have moved; a picture. The exit code is 1 where one trial of a hundred takes longer than 100 ms.
"""

import argparse
import os
import pathlib
import random
import sys
import threading
import time

import numpy as np

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(PROJECT / "tests" / "support"))
import addon_modules  # noqa: E402

LIMIT_MS = 100.0


def load_native():
    """The add-on's module that knows the library, without Blender."""
    build = pathlib.Path(os.environ.get("VOLLEY_BUILD", PROJECT / "build"))
    native = addon_modules.load("native", build / "blender" / "addons" / "volley")
    if not native.load():
        sys.exit(native.load_error())
    return native


def grid(triangle_count):
    """Positions and indices of a bumpy square."""
    side = int((triangle_count / 2) ** 0.5)
    line = np.linspace(-1.0, 1.0, side + 1, dtype=np.float32)
    x, y = np.meshgrid(line, line)
    z = 0.05 * np.sin(40.0 * x) * np.cos(30.0 * y)
    first = np.arange(side * (side + 1), dtype=np.uint32).reshape(side, side + 1)[:, :-1].ravel()
    triangles = [np.stack([first, first + 1, first + side + 2], axis=1),
                 np.stack([first, first + side + 2, first + side + 1], axis=1)]
    positions = np.stack([x, y, z], axis=-1).reshape(1, -1, 3).astype(np.float32)
    return positions, np.concatenate(triangles)


def smooth_scene(native, positions, indices):
    """A scene with the mesh, seen from above; its normals are the library's work."""
    scene = native.Scene(is_final=False)
    mesh = scene.create_mesh(positions, indices, smooth=np.ones(len(indices), np.uint8))
    identity = np.eye(3, 4, dtype=np.float32).reshape(1, 12)
    scene.create_instance(mesh=mesh, transforms=identity)
    camera = identity.copy()
    camera[0, 11] = 3.0
    scene.set_camera(camera, [(-0.4, 0.4, -0.3, 0.3)], clip_start=0.1,
                     clip_end=100.0, focus_distance=1.0, aperture_ratio=1.0)
    return scene, mesh


def cancel_commit(native, scene, delay):
    """Milliseconds from a cancel to the end of the commit, and whether it was cancelled."""
    ends, statuses = [], []

    def work():
        try:
            scene.commit()
            statuses.append(native.StatusCode.OK)
        except native.TracerError as error:
            statuses.append(error.status)
        ends.append(time.perf_counter())

    worker = threading.Thread(target=work)
    worker.start()
    worker.join(delay)
    begin = time.perf_counter()
    scene.cancel()
    worker.join()
    return 1e3 * max(0.0, ends[0] - begin), statuses[0] == native.StatusCode.ERROR_CANCELLED


def cancel_render(scene, delay):
    """Milliseconds from a cancel to the end of a render."""
    render = scene.start_render(width=960, height=540, sample_count=64, integrator=2, max_depth=4,
                                crop_width=960, crop_height=540, filter=2, filter_width=1.5,
                                film_exposure=1.0)
    render.wait(delay)
    begin = time.perf_counter()
    render.cancel()
    render.wait(-1.0)
    taken = 1e3 * (time.perf_counter() - begin)
    render.destroy()
    return taken


def report(what, taken):
    taken = np.sort(taken)
    p99 = float(np.quantile(taken, 0.99)) if len(taken) else 0.0
    print(f"{what:12} {len(taken):4} cancelled: median {np.median(taken):6.1f} ms, 99 % within {p99:6.1f} "
          f"ms, longest {taken[-1]:6.1f} ms", flush=True)
    return p99 > LIMIT_MS


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--triangles", type=int, default=5_000_000)
    parser.add_argument("--trials", type=int, default=100)
    options = parser.parse_args()
    native, dice = load_native(), random.Random(1)
    positions, indices = grid(options.triangles)
    scene, mesh = smooth_scene(native, positions, indices)
    begin = time.perf_counter()
    scene.commit()
    build_seconds = time.perf_counter() - begin
    scene.destroy()
    print(f"{len(indices):,} triangles build in {build_seconds:.2f} s")
    failed, taken = False, []
    scene, mesh = smooth_scene(native, positions, indices)
    for _ in range(options.trials):  # a cancelled commit leaves all as it was, so that the next begins anew
        delay = dice.uniform(0.0, build_seconds)
        milliseconds, was_cancelled = cancel_commit(native, scene, delay)
        if not was_cancelled:
            scene.destroy()
            scene, mesh = smooth_scene(native, positions, indices)
            continue
        taken.append(milliseconds)
    failed |= report("build", taken)
    scene.commit()
    begin, taken = time.perf_counter(), []
    scene.update_mesh(mesh, positions * np.float32(1.01))
    scene.commit()
    refit_seconds = time.perf_counter() - begin
    for number in range(options.trials):
        scene.update_mesh(mesh, positions * np.float32(1.0 + 0.01 * (number % 2)))
        milliseconds, was_cancelled = cancel_commit(native, scene, dice.uniform(0.0, refit_seconds))
        if was_cancelled:
            taken.append(milliseconds)
    failed |= report("refit", taken)
    scene.commit()
    failed |= report("render", [cancel_render(scene, dice.uniform(0.0, 2.0))
                                for _ in range(options.trials)])
    scene.destroy()
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

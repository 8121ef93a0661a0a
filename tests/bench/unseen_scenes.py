#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Scenes that nothing is tuned on: write them as OBJ files and race the ray queries on them.

    unseen_scenes.py --out DIR [--bench build/bin/tracer_bench] [--samples N] [tracer_bench's options]...

Four scenes of 80,000 to 420,000 triangles: a nave of fluted columns under ribbed vaults with pews, a wood of
leaves, a room full of machines of tubes, gears and bolts, and hills with boulders. Y is up, metres. Keep them
out of whatever chooses constants: they are there to say how fast rays are where nobody looked.
"""

import argparse
import json
import pathlib
import subprocess

import numpy as np


class Mesh:
    """Vertices and triangles that grow."""

    def __init__(self):
        self.vertices, self.triangles, self._count = [], [], 0

    def add(self, vertices, triangles):
        """Vertices (n, 3), triangles (m, 3) of numbers among them."""
        self.vertices.append(np.asarray(vertices, dtype=np.float64))
        self.triangles.append(np.asarray(triangles, dtype=np.int64) + self._count)
        self._count += len(vertices)

    def add_grid(self, points):
        """A sheet of points (rows, columns, 3)."""
        rows, columns = points.shape[:2]
        number = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = (number[:-1, :-1].ravel(), number[:-1, 1:].ravel(), number[1:, 1:].ravel(),
                      number[1:, :-1].ravel())
        self.add(points.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))

    def add_box(self, low, high):
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
        quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
        self.add(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])

    def write(self, path):
        vertices, triangles = np.concatenate(self.vertices), np.concatenate(self.triangles) + 1
        with open(path, "w", encoding="ascii") as file:
            np.savetxt(file, vertices, fmt="v %.6f %.6f %.6f")
            np.savetxt(file, triangles, fmt="f %d %d %d")
        return len(triangles)


def _lathe(profile, center, sides, flutes=0, depth=0.0):
    """A surface of revolution about y: profile (n, 2) of radius and height; grooves along it."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    groove = 1.0 - depth * (0.5 + 0.5 * np.cos(flutes * angle)) if flutes else np.ones_like(angle)
    radius = profile[:, :1] * groove
    return np.stack([center[0] + radius * np.cos(angle),
                     np.broadcast_to(center[1] + profile[:, 1:], radius.shape),
                     center[2] + radius * np.sin(angle)], axis=-1)


def _torus(center, axis, large, small, sides, rings):
    u = np.linspace(0.0, 2.0 * np.pi, sides + 1)[:, None]
    v = np.linspace(0.0, 2.0 * np.pi, rings + 1)[None]
    flat = np.stack([(large + small * np.cos(v)) * np.cos(u), (large + small * np.cos(v)) * np.sin(u),
                     small * np.sin(v) + 0.0 * u], axis=-1)
    return center + np.roll(flat, axis, axis=-1)


def nave(rng):
    """Two rows of columns, arches, ribs, a tiled floor, pews."""
    mesh = Mesh()
    profile = np.array([[0.7, 0.0], [0.7, 0.3], [0.5, 0.5], [0.45, 1.0], [0.42, 4.0], [0.4, 6.5], [0.5, 6.8],
                        [0.75, 7.2], [0.75, 7.5]])
    length = 40.0
    for z in np.arange(-length / 2, length / 2 + 0.1, 4.0):
        for x in (-4.0, 4.0):
            mesh.add_grid(_lathe(profile, (x, 0.0, z), 72, 18, 0.08))
        angle = np.linspace(0.0, np.pi, 49)[:, None]
        around = np.linspace(0.0, 2.0 * np.pi, 13)[None]
        ring = 4.0 + 0.25 * np.cos(around)
        mesh.add_grid(np.stack([ring * np.cos(angle), 7.5 + ring * np.sin(angle),
                                z + 0.25 * np.sin(around) + 0.0 * angle], axis=-1))
    angle, along = np.meshgrid(np.linspace(0.0, np.pi, 65), np.linspace(-22.0, 22.0, 89))
    vault = 4.4 + 0.3 * np.abs(np.sin(along * np.pi / 4.0)) * np.sin(angle)
    mesh.add_grid(np.stack([vault * np.cos(angle), 7.5 + vault * np.sin(angle), along], axis=-1))
    for side in (-9.0, 9.0):
        y, z = np.meshgrid(np.linspace(0.0, 12.0, 40), np.linspace(-22.0, 22.0, 120))
        mesh.add_grid(np.stack([side + 0.2 * np.sin(3.0 * z) * np.sin(2.0 * y), y, z], axis=-1))
        mesh.add_box((min(side, side * 0.45), 11.8, -22.0), (max(side, side * 0.45), 12.0, 22.0))
    for x in np.arange(-9.0, 9.0, 0.9):
        for z in np.arange(-22.0, 22.0, 0.9):
            mesh.add_box((x + 0.01, -0.1, z + 0.01), (x + 0.89, rng.uniform(0.0, 0.01), z + 0.89))
    for z in np.arange(-16.0, 16.0, 1.1):
        for x in (-2.6, 0.6):
            mesh.add_box((x, 0.42, z), (x + 2.0, 0.46, z + 0.4))
            mesh.add_box((x, 0.4, z + 0.4), (x + 2.0, 0.95, z + 0.45))
            for leg in (0.0, 1.95):
                mesh.add_box((x + leg, 0.0, z), (x + leg + 0.05, 0.42, z + 0.4))
    for z in (-22.0, 22.0):
        mesh.add_box((-9.0, 0.0, min(z, z * 1.01)), (9.0, 12.5, max(z, z * 1.01)))
    return mesh


def wood(rng):
    """Trunks on a floor of needles, and leaves of two triangles."""
    mesh = Mesh()
    x, z = np.meshgrid(np.linspace(-15.0, 15.0, 120), np.linspace(-15.0, 15.0, 120))
    mesh.add_grid(np.stack([x, 0.2 * np.sin(x) * np.cos(0.7 * z), z], axis=-1))
    for _ in range(60):
        place = rng.uniform(-14.0, 14.0, 2)
        height = rng.uniform(5.0, 9.0)
        levels = np.linspace(0.0, 1.0, 24)
        trunk = np.stack([0.25 * (1.0 - 0.8 * levels), height * levels], axis=-1)
        mesh.add_grid(_lathe(trunk, (place[0], 0.0, place[1]), 16, 5, 0.2))
        count = 2400
        reach = rng.uniform(0.3, 2.2, count) * rng.uniform(0.4, 1.0, count)
        turn, rise = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(0.35, 1.05, count)
        middle = np.stack([place[0] + reach * np.cos(turn), height * rise, place[1] + reach * np.sin(turn)], 1)
        one, two = rng.normal(size=(2, count, 3))
        one *= 0.09 / np.linalg.norm(one, axis=1, keepdims=True)
        two *= 0.05 / np.linalg.norm(two, axis=1, keepdims=True)
        corners = np.stack([middle - one, middle + two, middle + one, middle - two], axis=1).reshape(-1, 3)
        first = 4 * np.arange(count)[:, None]
        mesh.add(corners, np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]))
    return mesh


def machines(rng):
    """A hall of tubes, rings, gears and bolts."""
    mesh = Mesh()
    for low, high in (((-8, -0.2, -8), (8, 0, 8)), ((-8, 6, -8), (8, 6.2, 8)), ((-8.2, 0, -8), (-8, 6, 8)),
                      ((8, 0, -8), (8.2, 6, 8)), ((-8, 0, -8.2), (8, 6, -8)), ((-8, 0, 8), (8, 6, 8.2))):
        mesh.add_box(low, high)
    for _ in range(90):
        center = rng.uniform((-6.5, 0.4, -6.5), (6.5, 5.0, 6.5))
        large = rng.uniform(0.15, 0.8)
        mesh.add_grid(_torus(center, rng.integers(3), large, large * rng.uniform(0.1, 0.35), 64, 24))
    for _ in range(60):
        place = rng.uniform(-7.0, 7.0, 2)
        tube = np.array([[0.06, 0.0], [0.06, 5.9]])
        mesh.add_grid(_lathe(tube, (place[0], 0.0, place[1]), 40))
    for _ in range(40):
        center = rng.uniform((-6.0, 0.3, -6.0), (6.0, 4.5, 6.0))
        wheel = np.array([[0.05, 0.0], [0.6, 0.0], [0.6, 0.12], [0.05, 0.12], [0.05, 0.0]]) * rng.uniform(0.5, 1.3)
        mesh.add_grid(_lathe(wheel, center, 240, 30, 0.15))
    for _ in range(1800):
        center = rng.uniform((-7.9, 0.0, -7.9), (7.9, 5.8, 7.9))
        bolt = np.array([[0.0, 0.0], [0.04, 0.0], [0.04, 0.03], [0.02, 0.03], [0.02, 0.12], [0.0, 0.12]])
        mesh.add_grid(_lathe(bolt, center, 6))
    return mesh


def hills(rng):
    """A rough field of heights, boulders on it."""
    mesh = Mesh()
    side = 360
    x, z = np.meshgrid(np.linspace(-50.0, 50.0, side), np.linspace(-50.0, 50.0, side))
    height = np.zeros_like(x)
    for octave in range(7):
        a, b = rng.normal(size=(2, 2)) * 0.05 * 2.0 ** octave
        height += 6.0 * 0.55 ** octave * np.sin(a[0] * x + a[1] * z + octave) * np.cos(b[0] * x + b[1] * z)
    mesh.add_grid(np.stack([x, height, z], axis=-1))
    levels = np.linspace(-np.pi / 2, np.pi / 2, 17)
    for _ in range(300):
        row, column = rng.integers(0, side, 2)
        size = rng.uniform(0.3, 2.0)
        ball = np.stack([size * np.cos(levels), size * np.sin(levels)], axis=-1)
        points = _lathe(ball, (x[row, column], height[row, column], z[row, column]), 24, 5, 0.25)
        mesh.add_grid(points)
    return mesh


SCENES = {"nave": nave, "wood": wood, "machines": machines, "hills": hills}


def write_all(folder):
    """The paths of the files, which are the same each time."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, (name, make) in enumerate(SCENES.items()):
        paths.append(folder / f"{name}.obj")
        make(np.random.default_rng(number)).write(paths[-1])
    return paths


def _line(row):
    """One row of the race: public queries over the best of Embree's modes, single rays over its single ones."""
    peer = {name: rate["median"] for name, rate in row["embree_default"].items() if isinstance(rate, dict)}
    best = max(peer, key=peer.get)
    query, alone = row["query_mrays_s"]["median"], row["query_alone_mrays_s"]["median"]
    return (f"{row['scene']:10} {row['isa']:7} {row['kind']:17} {100.0 * row['miss_share']:5.1f} % miss"
            f"{query:8.2f} {query / peer[best]:6.2f} of {best:18}{alone:8.2f} {alone / peer['single']:6.2f} of single")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--bench", default="build/bin/tracer_bench")
    parser.add_argument("--samples", default="1")
    options, more = parser.parse_known_args()
    rows = options.out / "rows.json"
    scenes = [word for path in write_all(options.out) for word in ("--scene", str(path))]
    subprocess.run([options.bench, *scenes, "--queries", "--no-builds", "--motion", "still", "--threads", "1",
                    "--order", "pixel", "--samples", options.samples, "--json", str(rows), *more], check=True,
                   stdout=subprocess.DEVNULL)
    for text in rows.read_text().splitlines():
        row = json.loads(text)
        if row["row"] == "rays":
            print(_line(row))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Writes addon/volley/sync/sky_hosek_wilkie.py: coefficients of Hosek and Wilkie's sky, from pictures of it.

Source: L. Hosek, A. Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance" (2012). Its formula has nine
coefficients and a radiance for each of X, Y and Z. Each is a Bezier curve of degree five of the cube root of the
sun's elevation, given for whole turbidities from 1 to 10 over black and over white ground, and linear between.
The curves are found by least squares from what Cycles shows: those of X and Y first each by itself; then, as skies
between two curves say what part of each is radiance and tell curves apart that show nearly the same, all of a
channel at once. Those of Z begin at X's: each by itself they end at others that show nearly the same.

    blender -b --factory-startup --python generate_hosek_wilkie.py    # some minutes
    blender -b --factory-startup --python generate_hosek_wilkie.py -- --measure    # how far the file is off
"""

import itertools
import math
import os
import runpy
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

OUTPUT = Path(__file__).resolve().parents[2] / "addon" / "volley" / "sync" / "sky_hosek_wilkie.py"
CURVES = [(turbidity, albedo) for turbidity in range(1, 11) for albedo in (0, 1)]
BETWEEN = [(turbidity, 0.5) for turbidity in range(1, 11)]
BETWEEN += [(turbidity + 0.5, albedo) for turbidity in range(1, 10) for albedo in (0, 1)]
DEGREE = 5
COEFFICIENTS = 9
X, Y, Z = range(3)
LINEAR = [2, 3, 5, 6, 7]  # coefficients that the radiance multiplies
# Of the sun, as cube roots of parts of a right angle; just above 0 Cycles' angles are too coarse.
ELEVATIONS = 0.5 - 0.5 * np.cos(np.pi * np.array((0, *range(2, 12))) / 11)
ELEVATIONS_BETWEEN = np.array((0.0, 0.2, 0.4, 0.6, 0.8, 0.95))  # for skies between curves
WIDTH, HEIGHT = 24, 14    # directions: by azimuth from the sun, and by height
HIGHEST_THETA = 0.5 * math.pi - 0.001  # Cycles keeps the sky below that as it is there
NEAREST = 0.03            # radians to the sun below which Cycles' own angles are too coarse
XYZ_TO_RGB = np.array(((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560),
                       (0.0556434, -0.2040259, 1.0572252)))
GOOD_ENOUGH = 2e-5        # root mean square of relative errors with which a fit ends
STARTS, STEPS = 6, 300    # of the fit at one elevation
ATTEMPTS, CURVE_STEPS = 4, 2000
BAD, ROUNDS = 2e-4, 3      # error of curves that are fitted again, and how often
TOGETHER_STEPS = 200      # of the fit of all curves of a channel
FARTHEST, HALVINGS = 4.0, 40  # logarithm of a factor between radiances, and steps to find it
MEASURED = 12             # skies about each turbidity
NEARLY = 1e-4             # error with which a curve may be laid through an elevation


# Pictures ------------------------------------------------------------------------------------------

def directions():
    """Unit vectors, (HEIGHT, WIDTH, 3): denser at the horizon."""
    height = (np.arange(HEIGHT) / (HEIGHT - 1)) ** 1.7 * 0.995 + 0.0015
    azimuth = math.pi * (np.arange(WIDTH) + 0.5) / WIDTH
    height, azimuth = np.meshgrid(height, azimuth, indexing="ij")
    across = np.sqrt(1.0 - height * height)
    return np.stack([across * np.sin(azimuth), across * np.cos(azimuth), height], axis=-1).astype(np.float32)


def open_stage(looked_at):
    """A wall of one pixel for each direction that shines like the sky there: the node of the sky."""
    scene = bpy.context.scene
    for made in list(bpy.data.objects):
        bpy.data.objects.remove(made)
    render, cycles = scene.render, scene.cycles
    render.engine = 'CYCLES'
    cycles.samples, cycles.pixel_filter_type, cycles.filter_width = 1, 'BOX', 0.01
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.image_settings.file_format, render.image_settings.color_depth = 'OPEN_EXR', '32'
    scene.view_settings.view_transform = 'Raw'
    corners = [(0, 0), (WIDTH, 0), (WIDTH, HEIGHT), (0, HEIGHT)]
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata([(*corner, 0) for corner in corners], [], [(0, 1, 2, 3)])
    for loop, corner in zip(mesh.uv_layers.new().data, corners):
        loop.uv = corner[0] / WIDTH, corner[1] / HEIGHT
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = 'ORTHO', max(WIDTH, HEIGHT)
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.location = WIDTH / 2, HEIGHT / 2, 5
    for made in (scene.camera, bpy.data.objects.new("Wall", mesh)):
        scene.collection.objects.link(made)
    material = bpy.data.materials.new("Sky")
    mesh.materials.append(material)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    texture, sky, emission, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in
                                      ("TexImage", "TexSky", "Emission", "OutputMaterial"))
    image = bpy.data.images.new("Directions", WIDTH, HEIGHT, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.append(looked_at, np.ones((HEIGHT, WIDTH, 1), np.float32), axis=2).ravel())
    image.pack()
    texture.image, texture.interpolation = image, 'Closest'
    sky.sky_type = 'HOSEK_WILKIE'
    for start, end in ((texture, sky), (sky, emission), (emission, output)):
        tree.links.new(start.outputs[0], end.inputs[0])
    return sky


def picture(path):
    """What the stage shows, (HEIGHT, WIDTH, 3)."""
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(WIDTH * HEIGHT * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(HEIGHT, WIDTH, 4)[..., :3]


class Views:
    """What is known of each direction for a sun's elevation: x (see ELEVATIONS), and columns for the formula."""

    def __init__(self, looked_at, sun):
        looked_at, sun = looked_at.reshape(-1, 3).astype(np.float64), np.array(sun, np.float64)
        self.x = (math.asin(sun[2]) / (0.5 * math.pi)) ** (1.0 / 3.0)
        self.cos_theta = np.cos(np.minimum(np.arccos(looked_at[:, 2]), HIGHEST_THETA))
        self.cos_gamma = np.clip(looked_at @ sun, -1.0, 1.0)
        self.gamma = np.arccos(self.cos_gamma)

    def of(self, kept):
        """Those of some directions."""
        made = Views.__new__(Views)
        for name, value in vars(self).items():
            setattr(made, name, value if name == "x" else value[kept])
        return made


def photograph():
    """Skies {(turbidity, albedo): [(views, XYZ) of each elevation]}, of directions that are not clipped: those of
    the curves, and those in the middle between two."""
    looked_at = directions()
    sky = open_stage(looked_at)
    path = os.path.join(tempfile.mkdtemp(), "sky.exr")
    skies = {}
    for key in CURVES + BETWEEN:
        sky.turbidity, sky.ground_albedo = key
        shown = skies[key] = []
        for elevation in 0.5 * math.pi * (ELEVATIONS if key in CURVES else ELEVATIONS_BETWEEN) ** 3:
            sky.sun_direction = 0.0, math.cos(elevation), math.sin(elevation)
            rgb = picture(path).reshape(-1, 3).astype(np.float64)
            views = Views(looked_at, sky.sun_direction)
            kept = (rgb > 0.0).all(axis=1) & (views.gamma > NEAREST)
            shown.append((views.of(kept), rgb[kept] @ np.linalg.inv(XYZ_TO_RGB).T))
    return skies


# Fits ----------------------------------------------------------------------------------------------

def formula(values, views):
    """The model without its radiance, and the derivatives by its coefficients."""
    a, b, c, d, e, f, g, i, h = values
    inverse = 1.0 / (views.cos_theta + 0.01)
    falling = np.exp(b * inverse)
    by_height = 1.0 + a * falling
    by_angle = np.exp(e * views.gamma)
    square = views.cos_gamma ** 2
    base = 1.0 + h * h - 2.0 * h * views.cos_gamma
    glow = (1.0 + square) / base ** 1.5
    root = np.sqrt(views.cos_theta)
    by_sun = c + d * by_angle + f * square + g * glow + i * root
    slopes = [falling * by_sun, a * inverse * falling * by_sun, by_height, by_height * by_angle,
              by_height * d * views.gamma * by_angle, by_height * square, by_height * glow, by_height * root,
              by_height * g * glow * 3.0 * (views.cos_gamma - h) / base]
    return by_height * by_sun, np.stack(slopes, axis=-1)


class Errors:
    """Sums over relative errors: of their squares, of the products of their slopes by the parameters with each
    other and with them; and how many there are."""

    def __init__(self, errors, slopes):
        self.total, self.count = errors @ errors, len(errors)
        self.square, self.slope = slopes.T @ slopes, slopes.T @ errors

    def along(self, row):
        """The same by the points of curves, whose values, by these weights, the parameters are."""
        made = Errors.__new__(Errors)
        made.total, made.count = self.total, self.count
        made.square = np.kron(np.outer(row, row), self.square)
        made.slope = np.kron(row, self.slope)
        return made

    def __add__(self, other):
        made = Errors.__new__(Errors)
        for name, value in vars(self).items():
            setattr(made, name, value + getattr(other, name))
        return made


def least_squares(start, errors_of, steps):
    """Levenberg and Marquardt's method: the parameters and the root mean square of their errors."""
    found, damping = np.array(start, np.float64), 1e-3
    now = errors_of(found)
    for _ in range(steps):
        before = now.total
        while damping < 1e12:
            step = np.linalg.solve(now.square + damping * np.diag(np.diag(now.square) + 1e-30), -now.slope)
            after = errors_of(found + step)
            if after.total < before:
                break
            damping *= 4.0
        else:
            break
        found, now, damping = found + step, after, max(damping / 6.0, 1e-15)
        if before - now.total < 1e-9 * before:
            break
    return found, math.sqrt(now.total / now.count)


def fit_elevation(views, seen, random, near):
    """Coefficients for one elevation, the radiance among them, and their error; near: those of the next one."""
    def errors(values):
        shown, slopes = formula(values, views)
        return Errors(shown / seen - 1.0, slopes / seen[:, None])

    best = None
    for attempt in range(STARTS + 1):
        mean, spread = seen.mean(), random.uniform(0.3, 2.0, 2)
        start = near if attempt == 0 and near is not None else [
            -1.0, -0.3 * spread[0], mean, mean * random.normal(), -3.0 * spread[1], 0.3 * mean * random.normal(),
            0.1 * mean, 0.3 * mean * random.normal(), random.uniform(0.4, 0.85)]
        found = least_squares(start, errors, STEPS)
        if best is None or found[1] < best[1]:
            best = found
        if best[1] < GOOD_ENOUGH:
            break
    return best


def basis(x):
    """Bernstein's polynomials."""
    return np.array([math.comb(DEGREE, k) * x ** k * (1.0 - x) ** (DEGREE - k) for k in range(DEGREE + 1)])


def start_of_curves(shown, channel, random):
    """Points of curves through fits at single elevations."""
    rows = [basis(views.x) for views, _ in shown]
    near, found, good = None, [], []
    for views, xyz in reversed(shown):
        near, error = fit_elevation(views, xyz[:, channel], random, near)
        found.insert(0, near)
        good.insert(0, error < NEARLY)
    radiance = np.array([xyz[:, channel].mean() for _, xyz in shown])
    found = np.array(found)
    found[:, LINEAR] /= radiance[:, None]
    good = np.array(good) if sum(good) > DEGREE else np.ones(len(found), bool)
    found = np.append(found, radiance[:, None], axis=1)
    return np.linalg.lstsq(np.array(rows)[good], found[good], rcond=None)[0]


def fit_curves(shown, channel, starts):
    """The points (DEGREE + 1, COEFFICIENTS + 1) of the curves of a channel, the radiance last, and their error:
    the best found from any of the starts."""
    rows = [basis(views.x) for views, _ in shown]

    def errors(points):
        points = points.reshape(DEGREE + 1, COEFFICIENTS + 1)
        total = None
        for (views, xyz), row in zip(shown, rows):
            seen, at = xyz[:, channel], row @ points
            value, slopes = formula(at[:-1], views)
            slopes = np.append(slopes * at[-1], value[:, None], axis=1) / seen[:, None]
            own = Errors(value * at[-1] / seen - 1.0, slopes).along(row)
            total = own if total is None else total + own
        return total

    best = None
    for start in starts:
        points, error = least_squares(start.ravel(), errors, CURVE_STEPS)
        if best is None or error < best[1]:
            best = points.reshape(DEGREE + 1, -1), error
        if error < GOOD_ENOUGH:
            break
    return best


def fit_all(skies):
    """{(turbidity, albedo, channel): (points, error)}."""
    random, found = np.random.default_rng(1), {}
    for turbidity, albedo in sorted(CURVES, key=lambda key: (key[0] == 1, key)):  # the hardest last
        for channel in (X, Y):
            near = [found[key][0] for key in neighbors(turbidity, albedo, channel) if key in found]
            fresh = (start_of_curves(skies[turbidity, albedo], channel, random) for _ in range(ATTEMPTS))
            found[turbidity, albedo, channel] = fit_curves(skies[turbidity, albedo], channel,
                                                           itertools.chain(near[:1], fresh))
    return mend(skies, found)


def mend(skies, found):
    """Fit the worst once more, beginning at what their neighbours have come to."""
    for _ in range(ROUNDS):
        for key, (_, error) in sorted(found.items(), key=lambda item: item[1][1]):
            if not error < BAD:
                near = [found[other] for other in neighbors(*key) if other in found]
                starts = [points for points, error in near if error < BAD]
                again = fit_curves(skies[key[:2]], key[2], starts) if starts else None
                if again and not again[1] >= error:
                    found[key] = again
                print(*key, f"{found[key][1]:.1e}", flush=True)
    return found


def neighbors(turbidity, albedo, channel):
    """Where the curves are similar."""
    return ((turbidity - 1, albedo, channel), (turbidity + 1, albedo, channel), (turbidity, 1 - albedo, channel))


def ends(turbidity, albedo):
    """The two curves that a sky lies between."""
    if albedo == 0.5:
        return (turbidity, 0), (turbidity, 1)
    return (int(turbidity), albedo), (int(turbidity) + 1, albedo)


def brighter(points, factor):
    """The same sky, with another part of it in the radiance."""
    points = points.copy()
    points[:, LINEAR] /= factor
    points[:, COEFFICIENTS] *= factor
    return points


def value_at(points, views):
    """What curves show in views."""
    at = basis(views.x) @ points
    return formula(at[:-1], views)[0] * at[-1]


def factor_between(first, second, shown, channel):
    """The factor of brighter() on the second with which the middle of both is what was seen."""
    def error(logarithm):
        middle = 0.5 * (first + brighter(second, math.exp(logarithm)))
        parts = [value_at(middle, views) / xyz[:, channel] - 1.0 for views, xyz in shown]
        return sum(part @ part for part in parts)

    places = np.linspace(-FARTHEST, FARTHEST, 161)
    place = min(places, key=error)
    low, high = place - places[1] + places[0], place + places[1] - places[0]
    for _ in range(HALVINGS):
        inner = low + (high - low) / 3.0, high - (high - low) / 3.0
        low, high = (low, inner[1]) if error(inner[0]) < error(inner[1]) else (inner[0], high)
    return math.exp(0.5 * (low + high))


def align(points, skies, channel):
    """Give all curves of a channel the part of radiance that fits the first's."""
    for key in sorted(BETWEEN, key=lambda key: (key[1], key)):  # along black ground, then up from it
        if key[1] < 1:
            first, second = ends(*key)
            factor = factor_between(points[first], points[second], skies[key], channel)
            points[second] = brighter(points[second], factor)


def fit_together(points, skies, channel):
    """All curves of a channel at once, from points {(turbidity, albedo): points}: the same and their error."""
    size = (DEGREE + 1) * (COEFFICIENTS + 1)
    seen = [(views, xyz[:, channel], [CURVES.index(end) for end in ([key] if key in CURVES else ends(*key))])
            for key, shown in skies.items() for views, xyz in shown]

    def errors(parameters):
        curves = parameters.reshape(len(CURVES), DEGREE + 1, COEFFICIENTS + 1)
        total = Errors.__new__(Errors)
        total.total = total.count = 0
        square = np.zeros((len(CURVES), size, len(CURVES), size))
        slope = np.zeros((len(CURVES), size))
        for views, xyz, places in seen:
            row = basis(views.x) / len(places)
            at = row @ curves[places].sum(axis=0)
            value, slopes = formula(at[:-1], views)
            slopes = np.append(slopes * at[-1], value[:, None], axis=1) / xyz[:, None]
            own = Errors(value * at[-1] / xyz - 1.0, slopes).along(row)
            total.total, total.count = total.total + own.total, total.count + own.count
            for i in places:
                slope[i] += own.slope
                for j in places:
                    square[i, :, j] += own.square
        total.square, total.slope = square.reshape(slope.size, -1), slope.ravel()
        return total

    start = np.concatenate([points[key].ravel() for key in CURVES])
    found, error = least_squares(start, errors, TOGETHER_STEPS)
    return dict(zip(CURVES, found.reshape(len(CURVES), DEGREE + 1, -1))), error


# Errors --------------------------------------------------------------------------------------------

def measure():
    """Print how far the written curves are off, in random skies about each turbidity: the largest and the mean error
    of a channel's mean, and the largest of a direction, over its brightest channel and 1 % of the sky's."""
    curves, random = runpy.run_path(str(OUTPUT))["CURVES"], np.random.default_rng(11)
    looked_at = directions()
    sky = open_stage(looked_at)
    path = os.path.join(tempfile.mkdtemp(), "sky.exr")
    for turbidity in range(1, 11):
        means, worst = [], 0.0
        for _ in range(MEASURED):
            sky.turbidity = min(max(turbidity + random.uniform(-0.5, 0.5), 1.0), 10.0)
            sky.ground_albedo = random.uniform(0.0, 1.0)
            elevation = random.uniform(0.02, 1.0) ** 1.5 * 0.5 * math.pi
            sky.sun_direction = 0.0, math.cos(elevation), math.sin(elevation)
            rgb = picture(path).reshape(-1, 3).astype(np.float64)
            views = Views(looked_at, sky.sun_direction)
            low = min(int(sky.turbidity), len(curves) - 1)
            ground = curves[low - 1] + (sky.turbidity - low) * (curves[low] - curves[low - 1])
            points = ground[0] + sky.ground_albedo * (ground[1] - ground[0])
            xyz = np.stack([value_at(channel.T, views) for channel in points], axis=-1)
            shown, far = np.maximum(xyz @ XYZ_TO_RGB.T, 0.0), views.gamma > NEAREST
            means.append(np.abs(shown[far].mean(axis=0) / rgb[far].mean(axis=0) - 1.0).max())
            off = np.abs(shown - rgb).max(axis=1) / (rgb.max(axis=1) + 0.01 * rgb.max())
            worst = max(worst, off[far].max())
        print(f"turbidity {turbidity}: means {max(means):.2%}, on average {np.mean(means):.2%}, directions {worst:.2%}",
              flush=True)


def main():
    """Run the program."""
    if "--measure" in sys.argv:
        measure()
        return
    np.seterr(all="ignore")  # of steps that are not taken
    skies, curves = photograph(), {}
    found = fit_all(skies)
    brightness = np.mean([xyz.mean(axis=0) for shown in skies.values() for _, xyz in shown], axis=0)
    for channel in (X, Y, Z):
        points = {key: curves[(*key, X)].copy() if channel == Z else found[(*key, channel)][0] for key in CURVES}
        if channel == Z:
            for value in points.values():
                value[:, COEFFICIENTS] *= brightness[Z] / brightness[X]
        else:
            align(points, skies, channel)
        points, error = fit_together(points, skies, channel)
        curves.update({(*key, channel): value for key, value in points.items()})
        print(f"{'XYZ'[channel]}: root mean square of relative errors {error:.1e}", flush=True)
    lines = [" ".join(f"{value:.9g}" for value in row) for _, points in sorted(curves.items()) for row in points.T]
    OUTPUT.write_text(HEADER + "\n".join(lines) + "\n"
                      '""".split(), np.float64).reshape(10, 2, 3, 10, 6)\n', encoding="utf-8")


HEADER = '''# SPDX-License-Identifier: GPL-3.0-or-later
"""Coefficients of Hosek and Wilkie's sky: libtracer/tools/generate_hosek_wilkie.py, which wrote this file."""

import numpy as np

# [turbidity - 1][albedo][X, Y, Z][nine coefficients, radiance][points of a Bezier curve].
CURVES = np.array("""
'''

if __name__ == "__main__":
    main()

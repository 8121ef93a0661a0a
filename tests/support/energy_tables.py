#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of libtracer/src/model/ggx_energy_tables.c; takes some minutes.

    energy_tables.py            how far the tables are from what this computes
    energy_tables.py --write    writes them

An albedo is the mean, over the micro-normals visible from a direction, of what single scattering
lets get away: F times shadowing towards the reflected direction, 1 - F times that towards the refracted one.
Distribution, masking and Fresnel factor are those of kernels/lobe/microfacet.h: GGX, 1 / (1 + Lambda) per
direction where masking is separable, (1 + Lambda_o) / (1 + Lambda_o + Lambda_i) where it goes by height.
Visible normals are a cap of the sphere of stretched directions (Dupuy and Benyoub 2023) whose height is
integrated by Gauss and Legendre, whose azimuth by the midpoint rule. Points of the tables lie where
kernels/lobe/ggx_energy.h says.
"""

import argparse
import pathlib
import re
import sys

import numpy as np

MODEL = pathlib.Path(__file__).resolve().parents[2] / "libtracer/src/model"
HEADER, TABLES = MODEL / "ggx_energy_tables.h", MODEL / "ggx_energy_tables.c"
HEIGHTS, AZIMUTHS = 160, 80  # off by some 1e-4 at most, at a blurred critical angle
LEAST_COS, LEAST_ALPHA = 1e-6, 1e-4  # in place of 0, where the albedo only has a limit
BESIDE_ONE = 1e-5  # of the slice of ior 1: a surface yet
DEEPEST = 0.9995  # an index of 4000
BESIDE_SHARE = 1e-3  # the same where the limit is a step at grazing angles
WHOLE = 65535

X, W = np.polynomial.legendre.leggauss(HEIGHTS)
X, W = (X[:, None] + 1) / 2, W[:, None] / (2 * AZIMUTHS)
TURN = np.cos(np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS)[None, :]


def fresnel(cosine, eta):
    """Reflectance of a dielectric.

    >>> f = fresnel(np.array([1.0, 0.2]), 1.5), fresnel(np.array([0.2]), 1 / 1.5)
    >>> [round(float(x), 6) for x in (f[0][0], f[1][0])]
    [0.04, 1.0]
    """
    g2 = eta * eta - 1 + cosine * cosine
    g = np.sqrt(np.maximum(g2, 0))
    total, rest = g + cosine, g - cosine
    b = (cosine * total - 1) / (cosine * rest + 1)
    return np.where(g2 > 0, np.minimum(0.5 * (rest / total) ** 2 * (1 + b * b), 1), 1)


def blend(cosine, eta):
    """How far the reflectance of a dielectric is from that head-on to 1.

    >>> blend(np.array([1.0, 0.5]), 1.5).round(3).tolist(), blend(np.array([0.5]), 1000.0).tolist()
    ([0.0, 0.051], [0.0])
    """
    normal = ((eta - 1) / (eta + 1)) ** 2
    return np.clip((fresnel(cosine, eta) - normal) / (1 - normal), 0, 1)


def schlick(cosine, _eta):
    """How far Schlick's approximation is from the reflectance head-on to 1, whatever the index."""
    return (1 - cosine) ** 5


def shadow(alpha, height):
    """Lambda towards a direction."""
    tan2 = np.maximum(1 - height * height, 0) / (height * height)
    return 0.5 * (np.sqrt(1 + alpha * alpha * tan2) - 1)


def albedos(alpha, cosine, eta=None, factor=fresnel):
    """Of reflection alone, by height and without Fresnel factor; with eta also of both together, separable
    and by height, and of the part reflected, separable and by height. factor: by cosine and eta, what is reflected.

    >>> [round(float(x), 3) for x in albedos(0.3, 0.5, 1.5)]
    [0.822, 0.947, 0.949, 0.061, 0.061]
    """
    sine = np.sqrt(1 - cosine * cosine)
    size = np.hypot(alpha * sine, cosine)
    lean, rise = alpha * sine / size, cosine / size
    z = X * (1 + rise) - rise
    r = np.sqrt(np.maximum(1 - z * z, 0))
    x, y, z = alpha * (r * TURN + lean), alpha * r * np.sqrt(1 - TURN * TURN), z + rise
    inverse = 1 / np.sqrt(x * x + y * y + z * z)
    normal = z * inverse
    meets = sine * x * inverse + cosine * normal
    own = shadow(alpha, cosine)

    def mean(values):
        return (values * W).sum()

    def passes(height):
        away = height > 0
        towards = shadow(alpha, np.where(away, height, 1))
        return away / (1 + towards), away * (1 + own) / (1 + own + towards)

    separable, level = passes(2 * meets * normal - cosine)
    if eta is None:
        return [mean(level)]
    f = factor(meets, eta)
    found = [mean(level), mean(f * separable), mean(f * level)]
    k = 1 - (1 - meets * meets) / (eta * eta)
    below = cosine / eta - (meets / eta - np.sqrt(np.maximum(k, 0))) * normal
    through, through_level = passes(np.where(k > 0, below, -1))
    both = found[1] + mean((1 - f) * through), found[2] + mean((1 - f) * through_level)
    return [found[0], *both, found[1], found[2]]


def steps(count):
    return np.arange(count) / (count - 1)


def rows(count):
    return np.maximum(steps(count) ** 2, LEAST_ALPHA)


def columns(count, spread=None):
    """Cosines that go by squares, or so that cos / (cos + spread sin) does.

    >>> [round(float(x), 3) for x in columns(3)], [round(float(x), 3) for x in columns(3, 1.0)]
    ([0.0, 0.25, 1.0], [0.0, 0.316, 1.0])
    """
    part = steps(count)[1:-1] ** 2
    if spread is None:
        return np.concatenate(([LEAST_COS], part, [1.0]))
    cotangent = spread * part / (1 - part)
    return np.concatenate(([LEAST_COS], cotangent / np.hypot(1, cotangent), [1.0]))


def index_of(depth):
    """The index whose (ior - 1) / (ior + 1) is depth; a large one in place of an infinite one."""
    depth = min(depth, DEEPEST)
    return (1 + depth) / (1 - depth)


def fitted(table):
    """Points between which lines run along a curve instead of over its bends: an eighth of the second
    difference is what they are off midway, and between all of it and half of it fits best.

    >>> fitted(np.array([[0.0, 0.1, 0.4]] * 3)).round(3).tolist()[1]
    [0.0, 0.086, 0.4]
    """
    result = table.copy()
    result[..., 1:-1] -= np.diff(table, 2) / 14
    result[..., 1:-1, :] -= np.diff(table, 2, axis=-2) / 14
    return np.clip(result, 0, 1)


def mean_of_line(line, root=None):
    """Over the cosine-weighted hemisphere, what is looked up in a row of a table, so that the rest adds up to what is
    missing; root: of its alpha, None where columns go by the root of the cosine.

    >>> round(float(mean_of_line(np.array([1.0, 1.0]), 0.5)), 6)
    1.0
    """
    part = (np.arange(20000) + 0.5) / 20000
    cosines, weights = part**2, 4 * part**3 / 20000
    at = part if root is None else np.sqrt(cosines / (cosines + root * np.sqrt(1 - cosines * cosines)))
    return (np.interp(at, steps(len(line)), line) * weights).sum()


def reflection(sizes):
    size = sizes["TRC_GGX_ENERGY_SIZE"]
    table = np.array([[albedos(a, c)[0] for c in columns(size, np.sqrt(a))] for a in rows(size)])
    table = fitted(table)
    # Finer, for little is missing of a smooth surface, and most of that at grazing angles.
    mean = []
    for root in steps(sizes["TRC_GGX_ENERGY_MEANS"]):
        row = min(int(root * (size - 1)), size - 2)
        y = root * (size - 1) - row
        mean.append(mean_of_line(table[row] * (1 - y) + table[row + 1] * y, root))
    return table, np.array(mean)


def glass(sizes):
    """Both tables, from inside and then from outside, and the means of the second."""
    count = sizes["TRC_GLASS_ENERGY_COLUMNS"]
    found = []
    for inside in (True, False):
        for w in steps(sizes["TRC_GLASS_ENERGY_INSIDE" if inside else "TRC_GLASS_ENERGY_OUTSIDE"]):
            ior = max(index_of(w ** (8 / 3)), 1 + BESIDE_ONE)
            eta = 1 / ior if inside else ior
            found.append([[albedos(a, c, eta)[1:3] for c in columns(count, None if inside else np.sqrt(a))]
                          for a in rows(sizes["TRC_GLASS_ENERGY_ROWS"])])
    found = np.moveaxis(np.array(found), -1, 0)
    separable, level = fitted(found[0]), fitted(found[1])
    roots = steps(sizes["TRC_GLASS_ENERGY_ROWS"])
    means = [mean_of_line(line, None if slice_number < sizes["TRC_GLASS_ENERGY_INSIDE"] else root)
             for slice_number, lines in enumerate(level) for root, line in zip(roots, lines)]
    return separable, level, np.array(means)


def glass_share(sizes):
    reach, count = sizes["TRC_GLASS_SHARE_REACH"], sizes["TRC_GLASS_SHARE_COLUMNS"]
    found = []
    for inside in (True, False):
        for w in steps(sizes["TRC_GLASS_SHARE_SLICES"]):
            ior = index_of(reach * w * w)
            for a in rows(sizes["TRC_GLASS_SHARE_ROWS"]):
                for c in columns(count):
                    both = albedos(a, c, 1 / ior if inside else ior)
                    found.append(both[3] / both[1])
    return np.array(found)


def dielectric_share(sizes):
    found = []
    for w in steps(sizes["TRC_SHARE_SLICES"]):
        ior = max(index_of(w * w), 1 + BESIDE_SHARE)
        for a in rows(sizes["TRC_SHARE_ROWS"]):
            for c in columns(sizes["TRC_SHARE_COLUMNS"]):
                both = albedos(a, c, ior, blend)
                found.append(both[4] / both[0])
    return np.array(found)


def schlick_share(sizes):
    found = [[albedos(a, c, 1.5, schlick) for c in columns(sizes["TRC_SHARE_COLUMNS"])]
             for a in rows(sizes["TRC_SHARE_ROWS"])]
    found = np.array(found)
    return (found[..., 4] / found[..., 0]).ravel()


def compute(sizes):
    """Name and values of each table."""
    energy, mean = reflection(sizes)
    separable, level, level_mean = glass(sizes)
    return {
        "trc_ggx_energy": np.rint(energy * WHOLE).ravel(),
        "trc_ggx_energy_mean": mean,
        "trc_glass_energy": np.rint(separable * WHOLE).ravel(),
        "trc_correlated_glass_energy": np.rint(level * WHOLE).ravel(),
        "trc_correlated_glass_energy_mean": np.rint(level_mean * WHOLE),
        "trc_glass_share": glass_share(sizes),
        "trc_dielectric_share_table": dielectric_share(sizes),
        "trc_schlick_share_table": schlick_share(sizes),
    }


def is_whole(name):
    """Whether a table is of parts of WHOLE."""
    return "energy" in name and name != "trc_ggx_energy_mean"


def read_sizes():
    text = HEADER.read_text(encoding="utf-8")
    return {name: float(value) if "." in value else int(value)
            for name, value in re.findall(r"#define (\w+) ([\d.]+)f?\b", text)}


def read_tables():
    """As compute, from the file."""
    text = TABLES.read_text(encoding="utf-8") if TABLES.exists() else ""
    return {name: np.array([float(v.strip().rstrip("f")) for v in body.split(",") if v.strip()])
            for name, body in re.findall(r"(\w+)\[\w*\] = \{([^}]*)\}", text)}


def as_source(tables):
    lines = ["/* Written by tests/support/energy_tables.py, which says how: change that, not this. */",
             '#include "model/ggx_energy_tables.h"', "", "/* clang-format off */"]
    for name, values in tables.items():
        form, kind, line = ("%d", "uint16_t", 16) if is_whole(name) else ("%.4ff", "float", 12)
        if name == "trc_ggx_energy_mean":
            form, line = "%.7ff", 8
        lines.append(f"const {kind} {name}[] = {{")
        for start in range(0, len(values), line):
            lines.append("    " + ", ".join(form % v for v in values[start:start + line]) + ",")
        lines.append("};")
    return "\n".join([*lines, "/* clang-format on */", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the tables")
    arguments = parser.parse_args()
    tables, present = compute(read_sizes()), read_tables()
    worst = 0.0
    for name, values in tables.items():
        if name in present and len(present[name]) == len(values):
            scale = WHOLE if is_whole(name) else 1
            off = float(np.abs(values - present[name]).max()) / scale
            worst = max(worst, off)
            print(f"{name}: {len(values)} values, off by at most {off:.5f}")
    if arguments.write:
        TABLES.write_text(as_source(tables), encoding="utf-8")
        return 0
    return 0 if present and worst < 2e-4 else 1


if __name__ == "__main__":
    sys.exit(main())

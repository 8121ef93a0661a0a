#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compare renders: means, errors, a test for bias, and a picture of the difference.

As a library, pictures are float arrays of shape (height, width, channels), scene-linear, top row
first. As a program:

    compare.py --a A.exr [A2.exr ...] --b B.exr [B2.exr ...] [--reference R.exr] [--png OUT.png]

The first picture of each side is measured and drawn; with two or more on both sides, made with
different seeds, each 8x8 tile is also tested for a difference in mean. Only numpy is needed. EXR
files are read here when they are scanline files without compression or with ZIP, as Blender
writes them; others go through ``oiiotool`` if it is installed.

Sources: B. L. Welch, "The generalization of 'Student's' problem when several different population
variances are involved", Biometrika 34 (1947); the incomplete beta function's continued fraction as
in W. J. Lentz, "Generating Bessel functions in Mie scattering calculations", Applied Optics 15
(1976).
"""

import argparse
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

import numpy as np

TILE_PX = 8
DIFFERENCE_GAIN = 8.0
RELATIVE_FLOOR = 0.01
NOISE_ERRORS = 5.0  # of a difference that is noise: exceeded once in 1.7 million, for some thousand tiles
ROUNDING = 2e-5  # of a sum of a thousand floats, relative

EXR_MAGIC = 20000630
EXR_TILED_DEEP_MULTIPART = 0x200 | 0x800 | 0x1000
EXR_ROWS_PER_CHUNK = {0: 1, 2: 1, 3: 16}  # compression code: none, ZIPS, ZIP
EXR_SAMPLE_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


# Measures --------------------------------------------------------------------------------------

def channel_means(image):
    """Mean of each channel.

    >>> channel_means(np.array([[[0.0, 2.0], [1.0, 4.0]]]))
    array([0.5, 3. ])
    """
    return np.asarray(image, dtype=np.float64).mean(axis=(0, 1))


def mean_ratios(image, reference):
    """Mean of each channel over the reference's; 1 where both are zero.

    >>> mean_ratios(np.full((2, 2, 2), [3.0, 0.0]), np.full((2, 2, 2), [2.0, 0.0]))
    array([1.5, 1. ])
    """
    a, b = channel_means(image), channel_means(reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a == 0.0) & (b == 0.0), 1.0, a / b)


def mse(image, reference):
    """Mean squared error over all pixels and channels.

    >>> mse(np.zeros((2, 2, 3)), np.full((2, 2, 3), 2.0))
    4.0
    """
    return float(np.mean(squared_error(image, reference)))


def rel_mse(image, reference):
    """Mean of (x - r)^2 / (r + 0.01)^2; negative reference values count as zero below the line.

    >>> round(rel_mse(np.full((1, 1, 3), 1.51), np.full((1, 1, 3), 0.5)), 9)
    3.921953095
    """
    below = np.maximum(np.asarray(reference, dtype=np.float64), 0.0) + RELATIVE_FLOOR
    return float(np.mean(squared_error(image, reference) / below ** 2))


def squared_error(image, reference):
    """Squared difference in double precision."""
    return (np.asarray(image, dtype=np.float64) - np.asarray(reference, dtype=np.float64)) ** 2


def error_percentile(image, reference, percent=99.9):
    """Percentile, over pixels, of the largest absolute difference among the channels.

    >>> error_percentile(np.arange(3.0).reshape(1, 3, 1), np.zeros((1, 3, 1)), 50.0)
    1.0
    """
    worst = np.sqrt(squared_error(image, reference)).max(axis=2)
    return float(np.percentile(worst, percent))


def non_finite_pixels(image):
    """Number of pixels with a NaN or an infinity in any channel.

    >>> non_finite_pixels(np.array([[[1.0, np.nan], [np.inf, np.nan], [0.0, 1.0]]]))
    2
    """
    return int(np.count_nonzero(~np.isfinite(image).all(axis=2)))


def measure(image, reference):
    """All measures of one picture against another, as plain numbers for JSON."""
    require_same_shape([image, reference])
    return {
        "means": channel_means(image).tolist(),
        "reference_means": channel_means(reference).tolist(),
        "mean_ratios": mean_ratios(image, reference).tolist(),
        "mse": mse(image, reference),
        "rel_mse": rel_mse(image, reference),
        "error_p999": error_percentile(image, reference),
        "non_finite_pixels": non_finite_pixels(image),
    }


def require_same_shape(images):
    """Raise ValueError unless all pictures have one shape."""
    shapes = {np.shape(image) for image in images}
    if len(shapes) != 1:
        raise ValueError(f"pictures of different shapes: {sorted(shapes)}")


# Test for bias ---------------------------------------------------------------------------------

def tile_means(image, tile_px=TILE_PX):
    """Mean of each tile and channel, shape (rows, columns, channels); edge tiles may be smaller.

    >>> tile_means(np.arange(6.0).reshape(1, 6, 1), 4).ravel()
    array([1.5, 4.5])
    """
    image = np.asarray(image, dtype=np.float64)
    row_starts = np.arange(0, image.shape[0], tile_px)
    column_starts = np.arange(0, image.shape[1], tile_px)
    sums = np.add.reduceat(np.add.reduceat(image, row_starts, axis=0), column_starts, axis=1)
    return sums / tile_sizes(image, tile_px)


def tile_sizes(image, tile_px=TILE_PX):
    """Pixels in each tile, shape (rows, columns, 1).

    >>> tile_sizes(np.zeros((1, 6, 1)), 4).ravel()
    array([4, 2])
    """
    height, width = np.shape(image)[:2]
    heights, widths = (np.diff(np.append(np.arange(0, size, tile_px), size)) for size in (height, width))
    return heights[:, None, None] * widths[None, :, None]


def welch_p_values(samples_a, samples_b):
    """Two-sided p-values of equal means along axis 0, variances not assumed equal.

    Each side needs two samples or more. Where both variances vanish, p is 1 for equal means and 0
    for different ones; means within ROUNDING are equal, as sums of floats differ by that.

    >>> a, b = np.array([[1.0], [2.0], [3.0], [4.0]]), np.array([[3.0], [5.0], [7.0]])
    >>> round(float(welch_p_values(a, b)[0]), 6)
    0.148471
    """
    a, b = (np.asarray(side, dtype=np.float64) for side in (samples_a, samples_b))
    if min(len(a), len(b)) < 2:
        raise ValueError("a test for bias needs two seeds or more on each side")
    spread_a, spread_b = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    spread = spread_a + spread_b
    difference = np.abs(a.mean(axis=0) - b.mean(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = difference / np.sqrt(spread)
        freedom = spread ** 2 / (spread_a ** 2 / (len(a) - 1) + spread_b ** 2 / (len(b) - 1))
    mean = np.abs(a).mean(axis=0) + np.abs(b).mean(axis=0)
    difference = np.where(difference <= ROUNDING * mean, 0.0, difference)
    t = np.where(difference > 0.0, t, 0.0)
    flat = ~(spread > 0.0)
    p = student_two_sided(np.where(flat, 0.0, t), np.where(flat, 1.0, freedom))
    return np.where(flat, np.where(difference > 0.0, 0.0, 1.0), p)


def student_two_sided(t, freedom):
    """Probability that Student's variable of ``freedom`` degrees exceeds |t| in size.

    >>> student_two_sided(np.array([0.0, 2.0]), np.array([3.0, 5.0])).round(8)
    array([1.        , 0.10193948])
    """
    t, freedom = np.broadcast_arrays(np.asarray(t, np.float64), np.asarray(freedom, np.float64))
    return incomplete_beta(0.5 * freedom, np.full_like(t, 0.5), freedom / (freedom + t * t))


def incomplete_beta(a, b, x):
    """Regularised incomplete beta function I_x(a, b), element by element.

    >>> incomplete_beta(np.array([2.0]), np.array([3.0]), np.array([0.4])).round(8)
    array([0.5248])
    """
    x = np.clip(x, 0.0, 1.0)
    swap = x > (a + 1.0) / (a + b + 2.0)
    p, q, y = np.where(swap, b, a), np.where(swap, a, b), np.where(swap, 1.0 - x, x)
    safe = np.clip(y, 1e-300, 1.0 - 1e-16)
    log_front = (log_gamma(p + q) - log_gamma(p) - log_gamma(q)
                 + p * np.log(safe) + q * np.log1p(-safe))
    value = np.where(y <= 0.0, 0.0, np.exp(log_front) / (p * beta_fraction(p, q, safe)))
    return np.clip(np.where(swap, 1.0 - value, value), 0.0, 1.0)


def beta_fraction(a, b, x, steps=200, tiny=1e-300):
    """The continued fraction below the incomplete beta's front factor, by Lentz's method."""
    value, numerator, denominator = np.ones_like(x), np.ones_like(x), np.zeros_like(x)
    for i in range(1, steps + 1):
        m = i // 2
        if i % 2:
            term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        else:
            term = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        denominator = 1.0 / nonzero(1.0 + term * denominator, tiny)
        numerator = nonzero(1.0 + term / numerator, tiny)
        change = numerator * denominator
        value = value * change
        if np.all(np.abs(change - 1.0) < 1e-14):
            break
    return value


def nonzero(x, tiny):
    """``x`` with values too near zero to divide by replaced by ``tiny``."""
    return np.where(np.abs(x) < tiny, tiny, x)


def log_gamma(x):
    """Logarithm of the gamma function, element by element."""
    return np.vectorize(math.lgamma, otypes=[np.float64])(x)


def bias_test(images_a, images_b, tile_px=TILE_PX, significance=0.01):
    """Welch's t-test of each tile and channel between two sets of seeds, Bonferroni-corrected.

    A tile fails when its p-value is below ``significance`` over the number of tests, so an unbiased
    pair fails anywhere with probability ``significance`` at most (tile means of some hundred
    samples are near enough to normal). Returns counts, the smallest corrected p and its tile.
    """
    require_same_shape([*images_a, *images_b])
    p = welch_p_values([tile_means(i, tile_px) for i in images_a],
                       [tile_means(i, tile_px) for i in images_b])
    row, column, channel = np.unravel_index(np.argmin(p), p.shape)
    return {
        "tests": int(p.size),
        "failed": int(np.count_nonzero(p < significance / p.size)),
        "smallest_corrected_p": float(min(1.0, p.min() * p.size)),
        "worst_tile_px": [int(column * tile_px), int(row * tile_px)],
        "worst_channel": int(channel),
        "fraction_below_5_percent": float(np.mean(p < 0.05)),
    }


def agreed_errors(images_a, images_b, tile_px=TILE_PX):
    """How far two sets of seeds are apart: in the mean of all; in that mean, and in the worst tile, by more than
    noise explains (see unexplained), so that no machine's own noise decides; all over the second set's mean.

    >>> a = np.ones((3, 4, 4, 1)) + np.array([-0.01, 0.0, 0.01]).reshape(3, 1, 1, 1)
    >>> b = a.copy()
    >>> b[:, :2, :2] += 1.0
    >>> [round(error, 2) for error in agreed_errors(b, a, 2)]
    [0.25, 0.24, 0.98]
    >>> [round(error, 4) for error in agreed_errors(a + 0.001, a, 2)]
    [0.001, 0.0, 0.0]
    """
    require_same_shape([*images_a, *images_b])
    means = [np.mean([channel_means(image) for image in side], axis=0) for side in (images_a, images_b)]
    biased, tile = unexplained(images_a, images_b, tile_px)
    scale = means[1].mean()
    return float(np.abs(means[0] - means[1]).max() / scale), biased / scale, tile / scale


def errors_of_cases(pictures):
    """The agreed_errors in colour of {case: (seeds of one side, seeds of the other)}, and the lines of their
    table."""
    found = {name: agreed_errors(*(np.asarray(side)[..., :3] for side in pair))
             for name, pair in pictures.items()}
    width = max(map(len, found))
    lines = [f"{'case':{width}} {'mean error':>10} {'biased tile':>11}"]
    lines += [f"{name:{width}} {mean:10.3%} {tile:11.3%}" for name, (mean, _biased, tile) in found.items()]
    return found, lines


def largest_errors(found):
    """{case: the larger of its mean's error and its worst tile's} of agreed_errors by case.

    >>> largest_errors({"ball": (0.2, 0.1, 0.0)})
    {'ball': 0.2}
    """
    return {name: max(mean, tile) for name, (mean, _biased, tile) in found.items()}


# The passes of light by kind; each is divided by its kind's colour.
LIGHT_KINDS = ("Diff", "Gloss", "Trans")
LIGHT_PASSES = [f"{kind}{part}" for kind in LIGHT_KINDS for part in ("Dir", "Ind", "Col")] + ["Emit", "Env"]


def light_sum(pictures):
    """What must be Combined, of {pass name: array}: light of all kinds by its colour, emission and environment."""
    return pictures["Emit"] + pictures["Env"] + sum(
        (pictures[f"{kind}Dir"] + pictures[f"{kind}Ind"]) * pictures[f"{kind}Col"] for kind in LIGHT_KINDS)


def unexplained(seeds_a, seeds_b, tile_px=TILE_PX, errors=NOISE_ERRORS):
    """How far two sets of seeds are apart by more than noise explains: the largest excess in the mean of a
    channel, and in the mean of a tile and channel.

    What noise explains is so many standard errors of the difference. They come from the variance of each
    pixel between seeds, taken as independent of its neighbours', so that few seeds do: samplers
    that spread their errors over neighbours have less noise than that.

    >>> generator = np.random.default_rng(1)
    >>> a, b = generator.normal(1.0, 0.1, (2, 4, 16, 16, 3))
    >>> unexplained(a, b)
    (0.0, 0.0)
    >>> a[:, :8, :8] += 0.1
    >>> [round(value, 2) for value in unexplained(a, b)]
    [0.01, 0.06]
    """
    require_same_shape([*seeds_a, *seeds_b])
    a, b = (np.asarray(side, np.float64) for side in (seeds_a, seeds_b))
    variance = a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)
    difference = a.mean(axis=0) - b.mean(axis=0)

    def largest(size):
        noise = errors * np.sqrt(tile_means(variance, size) / tile_sizes(difference, size))
        return float((np.abs(tile_means(difference, size)) - noise).max().clip(0.0))

    return largest(max(difference.shape)), largest(tile_px)


# Pictures --------------------------------------------------------------------------------------

def to_srgb_bytes(linear):
    """Scene-linear values to 8-bit sRGB, clipped; NaN becomes zero.

    >>> to_srgb_bytes(np.array([0.0, 0.5, 1.0, 9.0])).tolist()
    [0, 188, 255, 255]
    """
    x = np.clip(np.nan_to_num(linear, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)


def side_by_side(image, other, gain=DIFFERENCE_GAIN, gap_px=4):
    """A | B | gain times |A - B|, scene-linear, with grey gaps."""
    require_same_shape([image, other])
    a, b = np.asarray(image)[..., :3], np.asarray(other)[..., :3]
    gap = np.full((a.shape[0], gap_px, 3), 0.2)
    return np.concatenate([a, gap, b, gap, gain * np.abs(a - b)], axis=1)


def write_png(path, linear):
    """Write scene-linear RGB as an 8-bit sRGB PNG."""
    pixels = to_srgb_bytes(np.asarray(linear)[..., :3])
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pathlib.Path(path).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b""))


# EXR -------------------------------------------------------------------------------------------

class UnsupportedExr(ValueError):
    """An EXR file of a kind that is not read here."""


def read_exr(path):
    """All channels as float32 (height, width, channels), and their names, in file order."""
    data = pathlib.Path(path).read_bytes()
    try:
        return decode_exr(data)
    except UnsupportedExr:
        with tempfile.TemporaryDirectory() as folder:
            plain = pathlib.Path(folder) / "plain.exr"
            subprocess.run(["oiiotool", str(path), "--ch", "R,G,B", "-d", "float",
                            "--scanline", "--compression", "none", "-o", str(plain)], check=True)
            return decode_exr(plain.read_bytes())


def read_rgb(path):
    """The red, green and blue of an EXR's combined picture, float32 (height, width, 3)."""
    pixels, names = read_exr(path)
    return pixels[..., [rgb_index(names, channel) for channel in "RGB"]]


def rgb_index(names, channel):
    """Index of R, G or B: plain, else in a layer's Combined pass.

    >>> rgb_index(["A", "B", "G", "R"], "R"), rgb_index(["View.Combined.R", "View.Depth.Z"], "R")
    (3, 0)
    """
    for index, name in enumerate(names):
        if name == channel or name.endswith(".Combined." + channel):
            return index
    raise ValueError(f"no channel {channel} among {names}")


def decode_exr(data):
    """Decode a single-part scanline EXR: no compression, ZIPS or ZIP."""
    attributes, offset = exr_header(data)
    compression = attributes["compression"][0]
    if compression not in EXR_ROWS_PER_CHUNK:
        raise UnsupportedExr(f"compression {compression}")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels = exr_channels(attributes["channels"])
    pixels = np.zeros((height, width, len(channels)), np.float32)
    rows_per_chunk = EXR_ROWS_PER_CHUNK[compression]
    chunk_count = -(-height // rows_per_chunk)
    for start in struct.unpack_from(f"<{chunk_count}Q", data, offset):
        y, size = struct.unpack_from("<ii", data, start)
        rows = min(rows_per_chunk, y1 + 1 - y)
        raw_size = rows * width * sum(dtype.itemsize for _name, dtype in channels)
        packed = data[start + 8:start + 8 + size]
        # A chunk that would not shrink is stored as it is.
        raw = packed if size == raw_size else unzip_exr_chunk(packed)
        fill_exr_rows(pixels[y - y0:y - y0 + rows], raw, channels)
    return pixels, [name for name, _dtype in channels]


def exr_header(data):
    """Attributes by name, as bytes, and the offset of the chunk table."""
    magic, version = struct.unpack_from("<ii", data, 0)
    if magic != EXR_MAGIC:
        raise ValueError("not an EXR file")
    if version & EXR_TILED_DEEP_MULTIPART:
        raise UnsupportedExr("tiled, deep or multi-part")
    attributes, offset = {}, 8
    while data[offset]:
        name, offset = exr_string(data, offset)
        _kind, offset = exr_string(data, offset)
        (size,) = struct.unpack_from("<i", data, offset)
        attributes[name] = data[offset + 4:offset + 4 + size]
        offset += 4 + size
    return attributes, offset + 1


def exr_string(data, offset):
    """A zero-terminated string and the offset after it."""
    end = data.index(0, offset)
    return data[offset:end].decode("utf-8"), end + 1


def exr_channels(data):
    """Channels as (name, dtype), in file order."""
    channels, offset = [], 0
    while data[offset]:
        name, offset = exr_string(data, offset)
        (sample_type,) = struct.unpack_from("<i", data, offset)
        if struct.unpack_from("<ii", data, offset + 8) != (1, 1):
            raise UnsupportedExr("subsampled channel")
        channels.append((name, EXR_SAMPLE_TYPES[sample_type]))
        offset += 16
    return channels


def unzip_exr_chunk(packed):
    """Inflate, undo the difference from byte to byte, and weave the two halves together."""
    coded = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
    coded[1:] -= 128
    summed = np.cumsum(coded).astype(np.uint8)
    half = (len(summed) + 1) // 2
    raw = np.empty_like(summed)
    raw[0::2], raw[1::2] = summed[:half], summed[half:]
    return raw.tobytes()


def fill_exr_rows(target, raw, channels):
    """Copy a chunk's rows, each of them channel after channel, to ``target``."""
    width, offset = target.shape[1], 0
    for row in target:
        for index, (_name, dtype) in enumerate(channels):
            row[:, index] = np.frombuffer(raw, dtype, width, offset)
            offset += width * dtype.itemsize


def write_exr(path, pixels, names=("R", "G", "B")):
    """Write float32 channels as an uncompressed scanline EXR."""
    pixels = np.asarray(pixels, np.float32)
    height, width = pixels.shape[:2]
    order = sorted(range(len(names)), key=lambda i: names[i])
    channel_list = b"".join(names[i].encode() + b"\0" + struct.pack("<iiii", 2, 0, 1, 1)
                            for i in order) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", EXR_MAGIC, 2)
    for name, kind, value in (
            ("channels", "chlist", channel_list), ("compression", "compression", b"\0"),
            ("dataWindow", "box2i", window), ("displayWindow", "box2i", window),
            ("lineOrder", "lineOrder", b"\0"), ("pixelAspectRatio", "float", struct.pack("<f", 1)),
            ("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0)),
            ("screenWindowWidth", "float", struct.pack("<f", 1))):
        header += name.encode() + b"\0" + kind.encode() + b"\0"
        header += struct.pack("<i", len(value)) + value
    header += b"\0"
    row_bytes = width * len(names) * 4
    first = len(header) + 8 * height
    table = struct.pack(f"<{height}Q", *(first + y * (8 + row_bytes) for y in range(height)))
    rows = b"".join(struct.pack("<ii", y, row_bytes)
                    + np.ascontiguousarray(pixels[y][:, order].T).astype("<f4").tobytes()
                    for y in range(height))
    pathlib.Path(path).write_bytes(header + table + rows)


# Program ---------------------------------------------------------------------------------------

def format_measures(title, measures):
    """Some lines of text for a reader."""
    def row(values):
        return " ".join(f"{value:10.6f}" for value in values)

    return "\n".join([
        title,
        f"  means       {row(measures['means'])}",
        f"  against     {row(measures['reference_means'])}",
        f"  ratios      {row(measures['mean_ratios'])}",
        f"  MSE {measures['mse']:.6g}  relMSE {measures['rel_mse']:.6g}  "
        f"99.9th percentile {measures['error_p999']:.6g}  "
        f"non-finite pixels {measures['non_finite_pixels']}"])


def parse_arguments(arguments):
    """Command line to options."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--a", nargs="+", required=True, metavar="EXR", help="seeds of one side")
    parser.add_argument("--b", nargs="+", required=True, metavar="EXR", help="seeds of the other")
    parser.add_argument("--reference", metavar="EXR", help="measure both sides against this one")
    parser.add_argument("--png", help="write A | B | 8x difference here")
    parser.add_argument("--exposure", type=float, default=0.0, help="stops added to the PNG")
    parser.add_argument("--significance", type=float, default=0.01, help="of the test for bias")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return parser.parse_args(arguments)


def main(arguments=None):
    """Run the program; returns 1 if the test for bias fails, else 0."""
    options = parse_arguments(arguments)
    side_a, side_b = ([read_rgb(path) for path in paths] for paths in (options.a, options.b))
    if options.reference:
        reference = read_rgb(options.reference)
        report = {"a": measure(side_a[0], reference), "b": measure(side_b[0], reference)}
    else:
        report = {"a": measure(side_a[0], side_b[0])}
    if min(len(side_a), len(side_b)) >= 2:
        report["bias"] = bias_test(side_a, side_b, significance=options.significance)
    if options.png:
        write_png(options.png, side_by_side(side_a[0], side_b[0]) * 2.0 ** options.exposure)
    if options.json:
        print(json.dumps(report))
    else:
        for side in ("a", "b"):
            if side in report:
                print(format_measures(side.upper(), report[side]))
        if "bias" in report:
            print("bias test:", json.dumps(report["bias"]))
    return 1 if report.get("bias", {}).get("failed") else 0


if __name__ == "__main__":
    sys.exit(main())

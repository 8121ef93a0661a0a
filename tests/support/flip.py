# SPDX-License-Identifier: Apache-2.0
"""FLIP: how different two pictures look when one is flipped to the other; pure numpy.

Source: P. Andersson, J. Nilsson, T. Akenine-Moeller, M. Oskarsson, K. Astroem, M. D. Fairchild, "FLIP: A
Difference Evaluator for Alternating Images", Proceedings of the ACM on Computer Graphics and Interactive
Techniques 3 (2020): the low-dynamic-range form, with its constants and its viewing conditions. Pictures
here are scene-linear and are cut to [0, 1], as a screen without tone mapping does.
"""

import math

import numpy as np

# A screen 0.7 m wide with 3840 pixels, 0.7 m away.
PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * math.pi / 180.0

# Contrast sensitivity of achromatic, red-green, blue-yellow: (a1, b1, a2, b2) of two Gaussians.
SENSITIVITY = ((1.0, 0.0047, 0.0, 1e-5), (1.0, 0.0053, 0.0, 1e-5), (34.1, 0.04, 13.5, 0.025))
WIDEST_SENSITIVITY = 0.04
COLOR_EXPONENT = 0.7
COLOR_KNEE, COLOR_KNEE_ERROR = 0.4, 0.95  # of the largest colour difference; the error there
FEATURE_WIDTH_DEGREES = 0.082
FEATURE_EXPONENT = 0.5

RGB_TO_XYZ = np.array([
    [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
    [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
    [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382]])
WHITE = RGB_TO_XYZ.sum(axis=1)


def mean_flip(image, reference):
    """The mean of the FLIP map, 0 for equal pictures, at most 1.

    >>> black, white = np.zeros((8, 8, 3)), np.ones((8, 8, 3))
    >>> mean_flip(white, white), round(mean_flip(black, white), 3)
    (0.0, 0.967)
    """
    return float(np.mean(flip_map(image, reference)))


def flip_map(image, reference):
    """FLIP of each pixel of two scene-linear pictures (height, width, 3)."""
    sides = [opponents(np.clip(np.asarray(side, np.float64), 0.0, 1.0)) for side in (image, reference)]
    color = color_error(*(hunt_lab(seen(side)) for side in sides))
    feature = feature_error(*((side[..., 0] + 16.0) / 116.0 for side in sides))
    return color ** (1.0 - feature)


# Colour spaces -----------------------------------------------------------------------------------

def opponents(linear):
    """Linear RGB to the opponent space YCxCz."""
    x, y, z = np.moveaxis(linear @ RGB_TO_XYZ.T / WHITE, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def from_opponents(opponent):
    """YCxCz to linear RGB, cut to what a screen shows."""
    y = (opponent[..., 0] + 16.0) / 116.0
    x, z = y + opponent[..., 1] / 500.0, y - opponent[..., 2] / 200.0
    return np.clip((np.stack([x, y, z], axis=-1) * WHITE) @ np.linalg.inv(RGB_TO_XYZ).T, 0.0, 1.0)


def hunt_lab(linear):
    """CIELAB with chroma in proportion to lightness (Hunt's effect)."""
    share = linear @ RGB_TO_XYZ.T / WHITE
    low = 6.0 / 29.0
    root = np.where(share > low ** 3, np.cbrt(share), share / (3.0 * low ** 2) + 4.0 / 29.0)
    x, y, z = np.moveaxis(root, -1, 0)
    lightness = 116.0 * y - 16.0
    return np.stack([lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)],
                    axis=-1)


def hyab(a, b):
    """City-block distance in lightness plus Euclidean distance in chroma."""
    difference = a - b
    return np.abs(difference[..., 0]) + np.hypot(difference[..., 1], difference[..., 2])


# Filters -----------------------------------------------------------------------------------------

def filtered(plane, along_x, along_y):
    """A plane filtered by two odd kernels, borders repeated."""
    for axis, kernel in ((1, along_x), (0, along_y)):
        radius = len(kernel) // 2
        padding = [(0, 0), (0, 0)]
        padding[axis] = (radius, radius)
        padded = np.pad(plane, padding, mode="edge")
        size = plane.shape[axis]
        plane = sum(weight * np.take(padded, range(i, i + size), axis=axis)
                    for i, weight in enumerate(kernel[::-1]))
    return plane


def seen(opponent):
    """What the eye's contrast sensitivity leaves of a picture, as linear RGB."""
    radius = math.ceil(3.0 * math.sqrt(WIDEST_SENSITIVITY / (2.0 * math.pi ** 2)) * PIXELS_PER_DEGREE)
    degrees = np.arange(-radius, radius + 1) / PIXELS_PER_DEGREE
    planes = []
    for channel, (a1, b1, a2, b2) in enumerate(SENSITIVITY):
        total, plane = 0.0, 0.0
        for a, b in ((a1, b1), (a2, b2)):
            if a == 0.0:
                continue
            kernel = np.exp(-(math.pi * degrees) ** 2 / b)
            weight = a * math.sqrt(math.pi / b)
            plane = plane + weight * filtered(opponent[..., channel], kernel, kernel)
            total += weight * kernel.sum() ** 2
        planes.append(plane / total)
    return from_opponents(np.stack(planes, axis=-1))


def split_normalised(kernel):
    """Positive and negative weights scaled to sums of 1 and -1."""
    return np.where(kernel > 0.0, kernel / kernel[kernel > 0.0].sum(),
                    kernel / -kernel[kernel < 0.0].sum())


# Errors ------------------------------------------------------------------------------------------

def color_error(lab, other):
    """The HyAB difference, compressed and spread over [0, 1]."""
    green, blue = hunt_lab(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    largest = hyab(green, blue) ** COLOR_EXPONENT
    difference = hyab(lab, other) ** COLOR_EXPONENT
    knee = COLOR_KNEE * largest
    above = (difference - knee) / (largest - knee) * (1.0 - COLOR_KNEE_ERROR)
    return np.where(difference < knee, COLOR_KNEE_ERROR / knee * difference, COLOR_KNEE_ERROR + above)


def feature_error(lightness, other):
    """The larger difference of edges and of points."""
    deviation = 0.5 * FEATURE_WIDTH_DEGREES * PIXELS_PER_DEGREE
    radius = math.ceil(3.0 * deviation)
    x = np.arange(-radius, radius + 1)
    bell = np.exp(-x ** 2 / (2.0 * deviation ** 2))
    across = bell / bell.sum()
    differences = []
    for kernel in (-x * bell, (x ** 2 / deviation ** 2 - 1.0) * bell):
        kernel = split_normalised(kernel)
        lengths = [np.hypot(filtered(side, kernel, across), filtered(side, across, kernel))
                   for side in (lightness, other)]
        differences.append(np.abs(lengths[0] - lengths[1]))
    return (np.maximum(*differences) / math.sqrt(2.0)) ** FEATURE_EXPONENT

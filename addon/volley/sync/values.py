# SPDX-License-Identifier: GPL-3.0-or-later
"""Values in a flat node list."""

from collections import namedtuple

from ..abi import InputSource

# kind: 'f' number, 'c' colour, 'v' vector, 's' shader. node: the index of a node, whose output it is,
# or CONSTANT (three floats; a number is the first) or DEFAULT (the library's default for the input).
# is_loose: it comes through links, but from no node: inputs that have a default keep that.
Value = namedtuple("Value", "kind node output constant is_loose", defaults=((0.0, 0.0, 0.0), False))

CONSTANT, DEFAULT = InputSource.CONSTANT, InputSource.DEFAULT
NO_SHADER = Value('s', CONSTANT, 0)

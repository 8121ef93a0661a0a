# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte's metadata: which names the ids in a render result's mattes stand for.

Keys and values are those of the Cryptomatte specification (J. Friedman, A. Jones, 1.2.0). Blender's
Cryptomatte node reads them from the result, and its OpenEXR writer puts them into files.
"""

import json
import struct

from . import native
from .passes import CRYPTOMATTES

_KEY_DIGITS = 7  # of the hash of a matte's name, which tells the mattes of a file apart


def write_manifests(engine, view_layer, names):
    """Add the manifests of a view layer's mattes to the render result; names: sets of them by
    CryptomatteKind."""
    result = engine.get_result()
    for key, value in manifests(view_layer, names).items():
        result.stamp_data_add_field(key, value)


def manifests(view_layer, names):
    """{key: value} of them."""
    found = {}
    for (kind, setting), members in zip(CRYPTOMATTES.values(), names):
        if not getattr(view_layer, setting):
            continue
        name = f"{view_layer.name}.{kind}"
        fields = {"name": name, "hash": "MurmurHash3_32", "conversion": "uint32_to_float32",
                  "manifest": manifest(members)}
        for field, value in fields.items():
            found[f"cryptomatte/{_digits(name)[:_KEY_DIGITS]}/{field}"] = value
    return found


def manifest(names):
    """Names and ids as the JSON that the specification asks for."""
    return json.dumps({name: _digits(name) for name in sorted(names)}, ensure_ascii=False,
                      separators=(",", ":"))


def _digits(name):
    """The bits of a name's id."""
    return struct.pack(">f", native.cryptomatte_id(name)).hex()

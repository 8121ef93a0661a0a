# SPDX-License-Identifier: Apache-2.0
"""Which tests a version of Blender cannot run, and why. The run holds to it: a test that skips without
being listed fails, and so does a listed one that does not skip (see conftest.py).

Patterns are those of fnmatch with brackets as they are, on "file::test"; since (included) and before are
versions of Blender, None without an end.
"""

import fnmatch
from collections import namedtuple

Skip = namedtuple("Skip", "pattern since before why")

_LIGHT = "test_against_cycles.py::test_light"
_SHADER = "test_shaders.py::test_against_cycles"
_TILTED = "test_tilted_normals.py::test_tilted"
_EVEN_WORLD = "test_tilted_normals.py::test_in_even_world"
_TEXTURE = "test_textures.py::test_against_cycles"
_MERGED = "Musgrave became a part of Noise, whose own cases have its types"
_OCTAVES = "Voronoi has octaves since 4.0"
_VELVET = "the Velvet shader gave way to Sheen"
_SHEEN = "the Sheen shader came with 4.0"
_HUANG = "Principled Hair has Huang's model since 4.0"
_FILM = "Principled has a thin film since 4.2"
_LATER_FILM = "Glass and metals have thin films since 5.0"
_METALLIC = "the Metallic shader came with 4.3"
_PRINCIPLED = "Principled has other inputs since 4.0; those of each have cases of their own"

SKIPS = (
    Skip("test_packages.py::test_legacy_package", (4, 2), None, "extensions took the place of add-ons"),
    Skip("test_packages.py::test_extension", None, (4, 2), "extensions came with 4.2"),
    Skip("test_packages.py::test_extension_by_operators", None, (4, 2), "extensions came with 4.2"),
    Skip("test_packages.py::test_repository", None, (4, 2), "extensions came with 4.2"),
    Skip("test_balls.py::test_balls_like_cycles", None, (5, 0), "Cycles lit balls otherwise"),
    # Blender 3
    *(Skip(f"{_TEXTURE}[voronoi {kind}]", None, (4, 0), _OCTAVES) for kind in (
        "*, octaves", "* to 1", "* varies", "F1, no lacunarity")),
    Skip(f"{_TEXTURE}[math FLOORED_MODULO]", None, (4, 0), "the operation came with 4.0"),
    Skip(f"{_TEXTURE}[mix EXCLUSION*]", None, (4, 0), "the blend mode came with 4.0"),
    Skip(f"{_TEXTURE}[noise * type *]", None, (4, 1), "the types were the Musgrave texture's"),
    Skip(f"{_SHADER}[sheen *]", None, (4, 0), _SHEEN),
    Skip(f"{_LIGHT}[sheen]", None, (4, 0), _SHEEN),
    *(Skip(f"{_SHADER}[{what}huang hair *]", None, (4, 0), _HUANG) for what in ("", "strands of ")),
    Skip(f"{_SHADER}[metallic *]", None, (4, 3), _METALLIC),
    Skip(f"{_SHADER}[conductor *]", None, (4, 3), _METALLIC),
    Skip("test_thin_film.py::test_film[*]", None, (4, 2), _FILM),
    *(Skip(f"test_thin_film.py::test_film[{name}]", (4, 2), (5, 0), _LATER_FILM)
      for name in ("glass node", "metal*")),
    Skip(f"{_LIGHT}[metallic]", None, (4, 3), _METALLIC),
    Skip(f"{_LIGHT}[conductor]", None, (4, 3), _METALLIC),
    *(Skip(f"{_SHADER}[principled {kind} *]", None, (4, 0), _PRINCIPLED) for kind in (
        "specular ior level", "sheen roughness", "coat roughness", "transmission weight")),
    Skip(f"{_SHADER}[principled emission strength 0.25]", None, (4, 0), _PRINCIPLED),
    *(Skip(f"{_LIGHT}[{kind}]", None, (4, 0), _PRINCIPLED) for kind in (
        "layers", "specular tint", "large ior", "rough metal", "brushed metal", "coat", "rough coat",
        "velvety", "coated emission")),
    Skip(f"{_SHADER}[principled diffuse roughness *]", None, (4, 3), "the input came with 4.3"),
    Skip(f"{_LIGHT}[rough base]", None, (4, 3), "the input came with 4.3"),
    *(Skip(f"{_TILTED}[{kind}-*]", None, (4, 0), _SHEEN) for kind in ("sheen", "velvet")),
    Skip(f"{_EVEN_WORLD}[velvet-*]", None, (4, 0), _SHEEN),
    *(Skip(f"{_TILTED}[Principled {kind}-*]", None, (4, 0), _PRINCIPLED) for kind in ("diffuse", "coat", "glass")),
    Skip(f"{_TILTED}[velvet node-*]", (4, 0), None, _VELVET),
    Skip(f"{_EVEN_WORLD}[velvet node-*]", (4, 0), None, _VELVET),
    Skip("test_linking.py::*", None, (4, 0), "light linking came with 4.0"),
    Skip("test_warnings.py::test_worlds_of_view_layers", None, (4, 3), "the setting came with 4.3"),
    Skip("test_sky.py::test_against_cycles[multiple*]", None, (5, 0), "the model came with 5.0"),
    *(Skip(f"{_TEXTURE}[vector math {operation}]", None, (5, 0), "the operation came with 5.0") for operation in (
        "ROUND", "SIGN", "POWER")),
    Skip("test_warnings.py::test_what_came_with_the_fifth_is_named", None, (5, 0), "nothing of it is there"),
    # Blender 4
    Skip(f"{_TEXTURE}[musgrave *]", (4, 1), None, _MERGED),
    Skip(f"{_SHADER}[velvet *]", (4, 0), None, _VELVET),
    Skip(f"{_LIGHT}[velvet]", (4, 0), None, _VELVET),
    Skip(f"{_SHADER}[mirror]", (4, 0), None, "Sharp went; a roughness of 0 is the same and has a case"),
    *(Skip(f"{_SHADER}[principled {kind} *]", (4, 0), None, _PRINCIPLED) for kind in (
        "specular 0.0", "specular 1.0", "sheen tint", "clearcoat roughness", "transmission 0.5",
        "transmission 1.0")),
    Skip(f"{_SHADER}[principled emission strength 0.5]", (4, 0), None, _PRINCIPLED),
)


def reason(name, version):
    """Why a version, as (major, minor), skips the test of that name, None if it must run."""
    for skip in SKIPS:
        if is_of(skip, version) and matches(skip, name):
            return skip.why
    return None


def is_of(skip, version):
    """Whether an entry is about a version."""
    return (skip.since is None or version >= skip.since) and (skip.before is None or version < skip.before)


def matches(skip, name):
    """Whether an entry is about the test of that name."""
    return fnmatch.fnmatchcase(name, skip.pattern.replace("[", "[[]"))

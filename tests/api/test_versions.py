# SPDX-License-Identifier: Apache-2.0
"""What differs between Blenders is asked by looking for it; compat.py alone knows numbers of versions
(tests/blender_versions.md)."""

import ast
import pathlib

ADDON = pathlib.Path(__file__).resolve().parents[2] / "addon" / "volley"


def _asks_version(source):
    """Whether a source reads bpy.app.version; its text, which is for messages, does not count.

    >>> _asks_version("bpy.app.version >= (4, 0)"), _asks_version("bpy.app.version_string")
    (True, False)
    """
    return any(isinstance(node, ast.Attribute) and node.attr == "version"
               and isinstance(node.value, ast.Attribute) and node.value.attr == "app"
               for node in ast.walk(ast.parse(source)))


def test_compat_alone_asks_for_versions():
    asking = {str(path.relative_to(ADDON)) for path in ADDON.rglob("*.py")
              if _asks_version(path.read_text(encoding="utf-8"))}
    assert asking == {"compat.py"}


def test_constants_of_versions_are_used():
    """None is left over in compat.py when what it was for goes."""
    tree = ast.parse((ADDON / "compat.py").read_text(encoding="utf-8"))
    constants = {target.id for node in tree.body if isinstance(node, ast.Assign) for target in node.targets}
    rest = "\n".join(path.read_text(encoding="utf-8") for path in ADDON.rglob("*.py") if path.name != "compat.py")
    own = (ADDON / "compat.py").read_text(encoding="utf-8")
    assert {name for name in constants if name not in rest and own.count(name) < 2} == set()

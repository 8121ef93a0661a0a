# SPDX-License-Identifier: Apache-2.0
"""Nothing of Cycles' is silently different: each setting, node and mode of the Blender that is tested has a row
in cycles_settings.toml, each row has something to be about, and what the rows say of nodes is so."""

import ast
import glob
import os
import re

import blender as blender_support
import cycles_settings
import pytest

HERE = os.path.dirname(os.path.abspath(__file__))
ADDON = os.path.join(blender_support.REPOSITORY, "addon", "volley")
TABLE = os.path.join(os.path.dirname(HERE), "settings.md")
SHARE_OFF = 0.08  # of a ball's pixels, which edges take: 5 of 76
# Measured by others, as their edges, or their noise, are all over a ball.
ELSEWHERE = {("ShaderNodeTexWhiteNoise", ""), ("ShaderNodeNewGeometry", "<Parametric"),
             ("ShaderNodeAmbientOcclusion", ""), ("ShaderNodeBevel", "")}


def inside_walk():
    import rna_walk
    return rna_walk.walk()


def test_every_setting_has_a_row(blender):
    walked = blender.run(inside_walk)
    rows = cycles_settings.of_version(blender_support.version())
    missing = [f"{kind}: {name}" for kind, names in walked.items() for name in names
               if cycles_settings.row_of(rows.get(kind, {}), name) is None]
    assert not missing, "without a row: " + ", ".join(missing)
    plain = {kind: {name.partition("=")[0] if name[0] not in "<>" else name for name in names}
             for kind, names in walked.items()}
    gone = [f"{kind}: {name}" for kind, names in rows.items() for name in names
            if name not in walked.get(kind, ()) and name not in plain.get(kind, ())]
    assert not gone, "rows of nothing: " + ", ".join(gone)


def _words_of_the_addon():
    """The texts in the add-on's code, what is filled in left out."""
    for path in glob.glob(os.path.join(ADDON, "**", "*.py"), recursive=True):
        with open(path, encoding="utf-8") as file:
            tree = ast.parse(file.read())
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                yield "".join(part.value for part in node.values if isinstance(part, ast.Constant))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def _test_exists(name):
    file, _, function = name.partition("::")
    path = os.path.join(HERE, file)
    if not os.path.exists(path):
        return False
    with open(path, encoding="utf-8") as source:
        return re.search(rf"^def {function}\(", source.read(), re.MULTILINE) is not None


def test_rows_say_what_they_must():
    words = list(_words_of_the_addon())
    for row in cycles_settings.rows():
        name = f"{row.of}: {row.names}"
        assert row.verdict in cycles_settings.VERDICTS, name
        if row.verdict in ("same", "approximated"):
            assert row.error and row.test, name
        elif row.verdict == "warned":
            assert row.test and any(row.warning in text for text in words), name
        elif row.verdict == "by design":
            assert row.note, name
        assert not row.test or _test_exists(row.test), f"{name}: no {row.test}"


def test_the_table_is_that_of_the_rows():
    with open(TABLE, encoding="utf-8") as file:
        assert file.read().split("\n") == cycles_settings.table(), "write it again: python3 tests/settings.py"


def inside_sweep():
    import node_sweep
    return node_sweep.sweep()


def test_nodes(blender):
    """Nodes that are the same show what they show in Cycles, the others say what they do not."""
    rows = cycles_settings.of_version(blender_support.version())
    wrong, silent = [], {}
    for kind, name, is_surface, told, error, off in blender.run(inside_sweep, timeout=300):
        row = cycles_settings.row_of(rows[kind], name)
        if row.verdict == "warned":
            if row.test == "test_settings.py::test_nodes":
                silent[row.of, row.warning] = silent.get((row.of, row.warning), True) and not told
            is_right = any(row.warning in message for message in told) or (
                not told and (is_surface or off <= SHARE_OFF))
        else:
            is_right = is_surface or told or off <= SHARE_OFF or {(kind, ""), (kind, name)} & ELSEWHERE
        if not is_right:
            wrong.append(f"{kind} {name} ({row.verdict}): {told or f'{error:.3g}, {off:.1%} off'}")
    assert not wrong, "; ".join(wrong)
    assert not any(silent.values()), f"not warned of: {[key for key, value in silent.items() if value]}"

# SPDX-License-Identifier: Apache-2.0
"""The table of what is measured in each Blender."""

import doctest
import json
import pathlib
import sys

import pytest

# Behind the support folder, which has modules of the same names.
sys.path.append(str(pathlib.Path(__file__).parent.parent))
import versions_table  # noqa: E402  (the folder is on the path only now)


def test_doctests():
    assert doctest.testmod(versions_table).failed == 0


def _results(folder, blender, errors):
    folder.mkdir()
    (folder / "lights.json").write_text(json.dumps({"blender": blender, "errors": errors}))
    return folder


def test_cases(tmp_path):
    old = _results(tmp_path / "old", "3.4.1", {"sun": 0.002, "spot": 0.03})
    new = _results(tmp_path / "new", "5.2.2", {"sun": 0.004, "area": 0.001})
    lines = versions_table.lines_of(dict(map(versions_table.read, (old, new))))
    assert [line for line in lines if "settings of lights" in line][0].endswith("| 2: 3 % | 2: 0.4 % |")
    assert [line for line in lines if "lights: " in line] == ["| lights: spot | 3 % | – |"]


def test_mixed_results(tmp_path):
    folder = _results(tmp_path / "mixed", "3.4.1", {"sun": 0.002})
    (folder / "passes.json").write_text(json.dumps({"blender": "4.3.2", "errors": {"Depth": 0.0}}))
    with pytest.raises(SystemExit, match="2 Blenders"):
        versions_table.read(folder)

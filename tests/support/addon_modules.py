# SPDX-License-Identifier: Apache-2.0
"""The add-on's modules that need no Blender, in a Python without it."""

import importlib
import sys
import types
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def load(name, folder=ROOT / "addon" / "volley"):
    """The module volley.NAME of an add-on folder, whose own __init__ needs Blender and is left out."""
    package = types.ModuleType("volley")
    package.__path__ = [str(folder)]
    sys.modules.setdefault("volley", package)
    return importlib.import_module(f"volley.{name}")

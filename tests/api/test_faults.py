# SPDX-License-Identifier: Apache-2.0
"""The deliberate faults of tests/faults fit the sources: whoever rewrites a place moves its fault along."""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "faults"))

import tree  # noqa: E402


def test_faults_fit_the_sources():
    texts, stale = tree.texts_of(tree.files()), []
    for fault in tree.faults():
        try:
            tree.place_of(fault, texts)
        except tree.FaultError as error:
            stale.append(str(error))
    assert not stale, stale


def test_faults_can_all_be_planted_at_once(tmp_path):
    """None overlaps another, and what is planted is Python or C: else no fault can be run at all."""
    tree.make(tmp_path)  # parses what is planted in Python
    header = tmp_path / tree.LIBRARY / "core/fault.h"
    flags = ["-std=c17", "-w", f"-I{tmp_path / 'libtracer/include'}", f"-I{tmp_path / tree.LIBRARY}",
             "-include", header, "-DTRC_ISA=scalar", "-DTRC_TARGET_SCALAR=1", "-DTRC_WIDTH=1"]
    # Headers with faults are read by these.
    sources = [path for path in sorted((tmp_path / tree.LIBRARY).rglob("*.c"))
               if not path.name.endswith("_windows.c")]
    subprocess.run(["cc", "-fsyntax-only", *flags, *sources], check=True)

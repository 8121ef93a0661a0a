# SPDX-License-Identifier: Apache-2.0
"""The deliberate faults of tests/faults fit the sources: whoever rewrites a place moves its fault along."""

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

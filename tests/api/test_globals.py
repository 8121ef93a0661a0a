# SPDX-License-Identifier: Apache-2.0
"""The library has no mutable globals but those that libtracer/docs/globals.md names and justifies."""

import os
import re
import subprocess
from pathlib import Path

LIBRARY = Path(os.environ["VOLLEY_BUILD"]) / "lib" / "libtracer.so"
TABLE = Path(__file__).resolve().parents[2] / "libtracer" / "docs" / "globals.md"
_SECTIONS = {".data", ".bss", ".tdata", ".tbss"}  # .data.rel.ro is read-only when the library is loaded
_COMPILERS = re.compile(r"__dso_handle|__TMC_END__|completed\.\d+|_edata|_end|__bss_start")


def mutable_symbols(library):
    """The names of the variables in sections that stay writable."""
    text = subprocess.run(["objdump", "-t", str(library)], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in text.splitlines()]
    return {row[-1] for row in rows if _SECTIONS & set(row[1:-1]) and row[-1] not in _SECTIONS
            and not _COMPILERS.fullmatch(row[-1])}


def test_mutable_globals_are_those_of_the_table():
    table = re.findall(r"^\| `(\w+)` \| (\S+) \|", TABLE.read_text(), flags=re.MULTILINE)
    assert mutable_symbols(LIBRARY) == {name for name, _ in table}
    for name, file in table:
        assert re.search(rf"^static .*\b{name}\b", (TABLE.parents[1] / "src" / file).read_text(), flags=re.MULTILINE)

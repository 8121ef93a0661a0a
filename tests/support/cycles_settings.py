# SPDX-License-Identifier: Apache-2.0
"""The rows of cycles_settings.toml: what Volley makes of each of Cycles' settings, and the table of them."""

import os
import re
import tomllib
from collections import namedtuple

VERDICTS = ("same", "approximated", "warned", "by design", "unread")
TESTED = ((3, 4), (4, 3), (5, 2))

_PATH = os.path.join(os.path.dirname(os.path.abspath(__file__)), "cycles_settings.toml")
_VERSIONS = re.compile(r" @(\d+)\.(\d+)([+-]?)$")

# of: a type of Blender's; names: as in the file; covers: {setting or setting=ITEM: versions that have it}.
Row = namedtuple("Row", "of names verdict note error test warning covers")


def _read_name(name):
    """[(setting or setting=ITEM, versions)] of one name of the file."""
    found = _VERSIONS.search(name)
    versions = TESTED
    if found:
        name = name[:found.start()]
        bound, way = (int(found[1]), int(found[2])), found[3]
        versions = tuple(version for version in TESTED if version == bound
                         or way == "+" and version > bound or way == "-" and version < bound)
    is_socket = name[0] in "<>"
    setting, equals, items = (name, "", "") if is_socket else name.partition("=")
    return [(setting + equals + item, versions) for item in items.split("|")]


def rows():
    """All rows in the file's order."""
    with open(_PATH, "rb") as file:
        entries = tomllib.load(file)["row"]
    made = []
    for entry in entries:
        names = " ".join(entry["names"].split()).split(", ")
        covers = {name: versions for part in names for name, versions in _read_name(part)}
        texts = (entry.get(key, "") for key in ("note", "error", "test", "warning"))
        made.append(Row(entry["of"], names, entry["verdict"], *texts, covers))
    return made


def of_version(version):
    """{type: {setting or setting=ITEM: Row}} of one Blender, as (major, minor)."""
    found = {}
    for row in rows():
        for name, versions in row.covers.items():
            if version in versions:
                found.setdefault(row.of, {})[name] = row
    return found


def row_of(found, setting):
    """The row of a walked setting among one type's of of_version, None without one. What Cycles does not read
    is listed without its items."""
    row = found.get(setting)
    if row is None and "=" in setting and setting[0] not in "<>":
        row = found.get(setting.partition("=")[0])
        row = row if row is not None and row.verdict == "unread" else None
    return row


def table():
    """The lines of the table, in Markdown."""
    lines = ["# Cycles' settings, nodes and modes in Volley", "",
             "Made by `tests/settings.py` of `tests/support/cycles_settings.toml`, which `test_settings.py` holds to what",
             "Blender 3.4, 4.3 and 5.2 have. *Same*: within the error that the test allows. *Approximated*: so far from",
             "Cycles' picture. *Warned*: not followed, and these are the warning's words. *By design*: why not.",
             "@4.3+ and @4.3-: from and till that Blender. What Cycles does not read has no line.", ""]
    shown = [row for row in rows() if row.verdict != "unread"]
    for title, is_of in (("Settings", lambda name: "Node" not in name), ("Nodes", lambda name: "Node" in name)):
        lines += [f"## {title}", "", "| of | settings | verdict | how |", "|---|---|---|---|"]
        lines += [_line(row) for row in shown if is_of(row.of)] + [""]
    return lines


def _line(row):
    name = row.of.removeprefix("ShaderNode").removeprefix("Cycles")
    names = ", ".join(row.names).replace("|", "/")
    how = f"*{row.warning}*" if row.warning else row.error
    how = "; ".join(filter(None, (how, row.note))) + (f" (`{row.test}`)" if row.test else "")
    return f"| {name} | {names} | {row.verdict} | {how} |".replace("<", "&lt;").replace(">", "&gt;")

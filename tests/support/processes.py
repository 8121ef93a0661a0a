# SPDX-License-Identifier: Apache-2.0
"""Processes as /proc has them; plain Python, inside Blender as well."""

import os


def living():
    """The numbers of all."""
    return {int(name) for name in os.listdir("/proc") if name.isdigit()}


def text_of(process, file):
    """A file of a process' folder, "" where there is none (any more)."""
    try:
        with open(f"/proc/{process}/{file}", encoding="utf-8", errors="replace") as opened:
            return opened.read()
    except OSError:
        return ""


def parent_and_name(process):
    """(the number of its parent, its name), None where it has ended."""
    text = text_of(process, "stat")
    name_end = text.rfind(")")
    return (int(text[name_end + 1:].split()[1]), text[text.index("(") + 1:name_end]) if text else None


def child_count(process):
    """How many it has."""
    return sum((parent_and_name(each) or (None,))[0] == process for each in living())

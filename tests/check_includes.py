#!/usr/bin/env python3
"""The library's include graph: prints what breaks its rules, exit code 1 if anything does.

The folders of libtracer/src and the rooms of kernels/ include each other without cycles, no folder but
kernels/ includes kernels/, and kernels/ includes model/ and core/ alone."""
import re
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[1] / "libtracer/src"
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
OF_KERNELS = {"kernels", "model", "core", "tracer"}


def room(path):
    """The folder of a file; in kernels/ the room."""
    parts = Path(path).parts
    return "/".join(parts[:2]) if parts[0] == "kernels" and len(parts) > 2 else parts[0]


def cycle(graph):
    """The folders of a cycle, or None."""
    done, way = set(), []

    def visit(folder):
        if folder in way:
            return way[way.index(folder):] + [folder]
        if folder in done:
            return None
        way.append(folder)
        found = next(filter(None, map(visit, sorted(graph.get(folder, ())))), None)
        way.pop()
        done.add(folder)
        return found

    return next(filter(None, map(visit, sorted(graph))), None)


def main():
    graph, errors = {}, []
    for path in sorted(SOURCES.rglob("*.[ch]")):
        name = path.relative_to(SOURCES).as_posix()
        for included in INCLUDE.findall(path.read_text()):
            top, other = name.split("/")[0], included.split("/")[0]
            if top == "kernels" and other not in OF_KERNELS:
                errors.append(f"{name}: kernels include {included}")
            if top != "kernels" and other == "kernels":
                errors.append(f"{name}: the host includes {included}")
            if not (SOURCES / included).is_file() and other != "tracer":
                errors.append(f"{name}: there is no {included}")
            if room(name) != room(included):
                graph.setdefault(room(name), set()).add(room(included))
    found = cycle(graph)
    if found:
        errors.append("a cycle: " + " -> ".join(found))
    print("\n".join(errors) or f"{len(graph)} folders, no cycle")
    return bool(errors)


if __name__ == "__main__":
    sys.exit(main())

"""A copy of the sources that holds every fault of faults.toml, chosen at run time by VOLLEY_FAULT.

Product sources stay as they are. In the copy each fragment stands as a choice between itself and the
fault, by a function that C sources have from a forced header and Python modules from a module beside them.
Without the variable the copy behaves as the product. With VOLLEY_FAULT_NOTES, a file, it appends to that
the number of each fault whose place is reached, once for each process: a test that does not reach a place
cannot notice what is wrong there.
"""

import ast
import re
import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_name("faults.toml")
COPIED = ("addon", "examples", "libtracer", "tests", ".cmake", "CMakeLists.txt", "LICENSE", "README.md")
LIBRARY, ADDON = "libtracer/src", "addon/volley"

HEADER = """/* Forced into every source. */
#ifndef VOLLEY_FAULT_H
#define VOLLEY_FAULT_H
#ifdef __cplusplus
extern "C" {
#endif
/* By number: 0 off, 1 on, 2 off and to be noted when reached. */
extern __attribute__((visibility("hidden"))) unsigned char trc_fault_state[];
__attribute__((visibility("hidden"))) int trc_fault_look(int number);
#ifdef __cplusplus
}
#endif
static inline __attribute__((always_inline)) int trc_fault(int number) {
    return __builtin_expect(trc_fault_state[number], 0) ? trc_fault_look(number) : 0;
}
#endif
"""
SOURCE = """#define _POSIX_C_SOURCE 200809L
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MOST_FAULTS 4096
unsigned char trc_fault_state[MOST_FAULTS];

__attribute__((constructor)) static void choose(void) {
    const char *number = getenv("VOLLEY_FAULT");
    if (getenv("VOLLEY_FAULT_NOTES"))
        memset(trc_fault_state, 2, MOST_FAULTS);
    if (number && atoi(number) > 0 && atoi(number) < MOST_FAULTS)
        trc_fault_state[atoi(number)] = 1;
}

int trc_fault_look(int number) {
    if (trc_fault_state[number] != 2)
        return trc_fault_state[number];
    trc_fault_state[number] = 0;
    char line[16];
    const char *path = getenv("VOLLEY_FAULT_NOTES");
    const int size = snprintf(line, sizeof line, "%d\\n", number);
    const int file = path ? open(path, O_WRONLY | O_APPEND | O_CREAT, 0666) : -1;
    if (file >= 0) {
        if (write(file, line, (size_t)size) != size)
            abort();
        close(file);
    }
    return 0;
}
"""
MODULE = '''"""Which fault is on; notes which are reached."""
import os

_ON = int(os.environ.get("VOLLEY_FAULT") or 0)
_NOTES = os.environ.get("VOLLEY_FAULT_NOTES")
_noted = set()


def fault(number):
    if _NOTES and number not in _noted:
        _noted.add(number)
        with open(_NOTES, "a") as file:
            file.write(f"{number}\\n")
    return number == _ON
'''


class FaultError(Exception):
    """A fault that does not fit the sources any more."""


def faults():
    """The list, each a dictionary as faults.toml describes it; tests are filled in from its area."""
    with open(LIST, "rb") as file:
        table = tomllib.load(file)
    for fault in table["fault"]:
        fault.setdefault("tests", table["areas"][fault["area"]])
    return table["fault"]


_SPACE = r"(?:\s|\\\n)*"  # a continued line of Python is white space, too


def _pattern(fragment):
    """A regular expression for a fragment, whatever the white space between its words and signs."""
    tokens = re.findall(r"\w+|[^\w\s]", fragment)
    return _SPACE.join(map(re.escape, tokens))


def place_of(fault, texts):
    """(path, begin, end) of the part that a fault replaces; texts: {path: text} of all sources."""
    before, rest = fault["at"].split("«")
    part, after = rest.split("»")
    pieces = [_pattern(piece) for piece in (before, part, after)]
    # A name in the fragment is a whole one in the source.
    start = r"(?<!\w)" if re.match(r"\w", fault["at"].replace("«", "").strip()) else ""
    expression = re.compile(start + _SPACE.join(filter(None, (
        pieces[0], f"(?P<part>{pieces[1]})", pieces[2]))))
    found = [(path, *match.span("part")) for path, text in texts.items()
             if path.name == fault["file"] for match in expression.finditer(text)]
    if len(found) != 1:
        raise FaultError(f"fault {fault['number']}: its fragment is {len(found)} times in {fault['file']}")
    return found[0]


def _switched(fault, part, is_python):
    number, to = fault["number"], fault["to"]
    if is_python:
        return f"(({to}) if _fault({number}) else ({part}))"
    if part.rstrip().endswith((";", "}")):
        return f"if (trc_fault({number})) {{ {to} }} else {{ {part} }}"
    return f"(trc_fault({number}) ? ({to}) : ({part}))"


def _with_import(text, path):
    """A Python module that can choose: the import stands behind its docstring."""
    first = ast.parse(text).body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    lines = text.splitlines(keepends=True)
    end = first.end_lineno if is_docstring else 0
    depth = len(path.relative_to(ROOT / ADDON).parts)
    return "".join(lines[:end]) + f"\nfrom {'.' * depth}fault import fault as _fault\n" + "".join(lines[end:])


def planted(texts):
    """{path: text} of the sources that hold a fault, from {path: text} of all."""
    places = {}
    for fault in faults():
        path, begin, end = place_of(fault, texts)
        places.setdefault(path, []).append((begin, end, fault))
    result = {}
    for path, inside in places.items():
        text, former = texts[path], None
        is_python = path.suffix == ".py"
        for begin, end, fault in sorted(inside, key=lambda place: -place[0]):
            if former is not None and end > former:
                raise FaultError(f"fault {fault['number']} overlaps another")
            former = begin
            text = text[:begin] + _switched(fault, text[begin:end], is_python) + text[end:]
        result[path] = _with_import(text, path) if is_python else text
    return result


def _write(path, text):
    """Only where it differs, so that a build does no more than it has to."""
    if not path.is_file() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def files():
    """All files that the copy has, too."""
    names = [ROOT / name for name in COPIED]
    return [path for name in names for path in ([name] if name.is_file() else name.rglob("*"))
            if path.is_file() and "__pycache__" not in path.parts]


def texts_of(paths):
    """{path: text} of those in which faults may be."""
    return {path: path.read_text() for path in paths if path.suffix in {".c", ".h", ".cpp", ".py"}
            and any(path.is_relative_to(ROOT / folder) for folder in (LIBRARY, ADDON))}


def make(target):
    """Make or bring up to date the copy in the folder target."""
    sources = files()
    changed = planted(texts_of(sources))
    header = target / LIBRARY / "core/fault.h"
    made = {header: HEADER, target / LIBRARY / "core/fault.c": SOURCE, target / ADDON / "fault.py": MODULE}
    options = "add_library(tracer_options INTERFACE)"
    changed[ROOT / "CMakeLists.txt"] = (ROOT / "CMakeLists.txt").read_text().replace(
        options, f'{options}\ntarget_compile_options(tracer_options INTERFACE "SHELL:-include {header}")', 1)
    wanted = {target / path.relative_to(ROOT) for path in sources}
    for path in sources:
        copy = target / path.relative_to(ROOT)
        if path in changed:
            _write(copy, changed[path])
        elif not copy.is_file() or copy.read_bytes() != path.read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
            shutil.copymode(path, copy)
    for path, text in made.items():
        _write(path, text)
    for path in target.rglob("*"):
        if path.is_file() and path not in wanted and path not in made and "__pycache__" not in path.parts:
            path.unlink()

"""A copy of the sources that holds every fault of faults.toml, chosen at run time by VOLLEY_FAULT.

Product sources stay as they are. In the copy each fragment stands as a choice between itself and the
fault, made by one global number: C sources see it as trc_fault_on, which a forced header declares in
every source, Python modules as _VOLLEY_FAULT. Without the variable the copy behaves as the product.
"""

import ast
import re
import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_name("faults.toml")
COPIED = ("addon", "examples", "libtracer", "tests", ".cmake", "CMakeLists.txt", "LICENSE", "README.md")
PRODUCT = ("libtracer/src", "addon/volley")

HEADER = """/* Forced into every source: the fault that is on, 0 for none. */
#ifdef __cplusplus
extern "C"
#else
extern
#endif
__attribute__((visibility("hidden"))) int trc_fault_on;
"""
SOURCE = """#include <stdlib.h>
int trc_fault_on;
__attribute__((constructor)) static void choose(void) {
    const char *number = getenv("VOLLEY_FAULT");
    trc_fault_on = number ? atoi(number) : 0;
}
"""
PYTHON = 'import os as _os\n_VOLLEY_FAULT = int(_os.environ.get("VOLLEY_FAULT") or 0)\n'


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
        return f"(({to}) if _VOLLEY_FAULT == {number} else ({part}))"
    if part.rstrip().endswith((";", "}")):
        return f"if (trc_fault_on == {number}) {{ {to} }} else {{ {part} }}"
    return f"(trc_fault_on == {number} ? ({to}) : ({part}))"


def _with_number(text):
    """A Python module that knows the number: behind its docstring."""
    first = ast.parse(text).body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    lines = text.splitlines(keepends=True)
    end = first.end_lineno if is_docstring else 0
    return "".join(lines[:end]) + "\n" + PYTHON + "".join(lines[end:])


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
        result[path] = _with_number(text) if is_python else text
    return result


def _write(path, text):
    """Only where it differs, so that a build does no more than it has to."""
    if not path.is_file() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def make(target):
    """Make or bring up to date the copy in the folder target."""
    names = [ROOT / name for name in COPIED]
    sources = [path for name in names for path in ([name] if name.is_file() else name.rglob("*"))
               if path.is_file() and "__pycache__" not in path.parts]
    texts = {path: path.read_text() for path in sources if path.suffix in {".c", ".h", ".cpp", ".py"}
             and any(path.is_relative_to(ROOT / folder) for folder in PRODUCT)}
    changed = planted(texts)
    wanted = {target / path.relative_to(ROOT) for path in sources}
    for path in sources:
        copy = target / path.relative_to(ROOT)
        if path in changed:
            _write(copy, changed[path])
        elif not copy.is_file() or copy.read_bytes() != path.read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
            shutil.copymode(path, copy)
    header, source = target / "libtracer/src/core/fault.h", target / "libtracer/src/core/fault.c"
    _write(header, HEADER)
    _write(source, SOURCE)
    build = (ROOT / "CMakeLists.txt").read_text()
    _write(target / "CMakeLists.txt", build.replace(
        "add_library(tracer_options INTERFACE)",
        f'add_library(tracer_options INTERFACE)\ntarget_compile_options(tracer_options INTERFACE "SHELL:-include {header}")', 1))
    for path in target.rglob("*"):
        if path.is_file() and path not in wanted | {header, source} and "__pycache__" not in path.parts:
            path.unlink()

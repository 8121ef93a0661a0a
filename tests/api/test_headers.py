# SPDX-License-Identifier: Apache-2.0
"""The public headers say what everything is: each function, and nine tenths of the fields."""

import re
from pathlib import Path

import pytest

INCLUDE = Path(__file__).resolve().parents[2] / "libtracer" / "include" / "tracer"
HEADERS = sorted(INCLUDE.glob("*.h"))
ENOUGH = 0.9  # part of the fields


def functions(text):
    """{name: whether a comment ends right above it}."""
    found = {}
    for match in re.finditer(r"^TRC_API [^;]*?(trc_\w+)\(", text, flags=re.M):
        found[match[1]] = text[:match.start()].rstrip(" \n").endswith("*/") \
            and not re.search(r"\n\s*\n\s*$", text[:match.start()])
    return found


def fields(text):
    """{structure.field: whether the comment above its line or behind it is about it}."""
    found = {}
    for body, name in re.findall(r"^typedef struct \w+ {\n(.*?)^} (\w+);", text, flags=re.M | re.S):
        above = False
        for line in re.findall(r"\s*(/\*.*?\*/|[^;/]+;(?:[ \t]*/\*.*?\*/)?)", body, flags=re.S):
            if line.startswith("/*"):
                above = True
                continue
            declaration = re.sub(r"/\*.*?\*/", "", line, flags=re.S)
            for field in re.findall(r"(\w+)\s*(?:\[\w+\])?\s*[,;]", declaration):
                found[f"{name}.{field}"] = above or "/*" in line
            above = False
    return found


def test_the_count_sees_what_is_missing():
    """A comment about something else does not count."""
    text = ("/* About a. */\nTRC_API int trc_a(int x);\n\nTRC_API int trc_b(\n    int x);\n/* C. */\n\n"
            "TRC_API void trc_c(void);\n"
            "typedef struct trc_s {\n    int a; /* of a */\n    int b, *c;\n    /* of d\n     * and e */\n"
            "    int d, e[3];\n    int f;\n    float\n        *g; /* of g */\n} trc_s;\n")
    assert functions(text) == {"trc_a": True, "trc_b": False, "trc_c": False}
    assert fields(text) == {"trc_s.a": True, "trc_s.b": False, "trc_s.c": False, "trc_s.d": True,
                            "trc_s.e": True, "trc_s.f": False, "trc_s.g": True}


@pytest.mark.parametrize("header", HEADERS, ids=lambda header: header.name)
def test_every_function_is_documented(header):
    missing = [name for name, is_documented in functions(header.read_text()).items() if not is_documented]
    assert not missing


def test_nine_tenths_of_the_fields_are_documented():
    found = {}
    for header in HEADERS:
        found.update(fields(header.read_text()))
    assert len(found) > 200
    missing = [name for name, is_documented in found.items() if not is_documented]
    assert len(missing) <= (1.0 - ENOUGH) * len(found), missing

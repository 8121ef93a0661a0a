#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The table of stability: figures that tests print (figures.h), from CTest's report and from logs.

    stability.py REPORT.xml [TEST.log ...] --out TABLE.md

A log is what one test printed, its name the test's. One row for each thing that was measured. What all
instruction sets give alike stands once; rays and their misses are added up.
"""

import argparse
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

MARK = "figure | "
COUNTED = re.compile(r"(\d+) (misses|self-hits|wrong) of (\d+) rays")
FURNACE = re.compile(r"39: .* \| off by at most ([\d.e-]+)")
ULPS = re.compile(r"([\d.]+) ulp")


def outputs(report):
    """(name of a test, what it printed) of a JUnit file or of a log."""
    if report.suffix != ".xml":
        yield report.stem, report.read_text(encoding="utf-8")
        return
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        yield case.get("name"), case.findtext("system-out") or ""


def figures(reports):
    """(what, value, name of the test) of each figure."""
    for report in reports:
        for name, output in outputs(report):
            for line in output.splitlines():
                if line.startswith(MARK):
                    what, _, value = line[len(MARK):].partition(" | ")
                    yield what.strip(), value.strip(), name


def rows(found):
    """(what, value, tests) with each thing once, numbered cases first.

    >>> rows([("a", "0 misses of 10 rays", "t.sse42"), ("a", "1 misses of 5 rays", "t.avx2"),
    ...       ("b", "2.5 ulp", "u.sse42"), ("b", "2.5 ulp", "u.avx2"), ("b", "3 ulp", "u.scalar")])
    [('a', '1 misses of 15 rays', 't: avx2, sse42'), ('b', '2.5 ulp (avx2, sse42); 3 ulp (scalar)', 'u')]
    >>> [row[0] for row in rows([("x", "1", "t.a"), ("10: y", "1", "t.a"), ("8, 9: z", "1", "t.a")])]
    ['8, 9: z', '10: y', 'x']
    """
    by_what = {}
    for what, value, test in found:
        by_what.setdefault(what, []).append((value, test))
    ordered = sorted(by_what.items(), key=lambda item: _case(item[0]))
    return [(what, *_joined(entries)) for what, entries in ordered]


def _case(what):
    """The number a name begins with; infinity: none."""
    number = re.match(r"\d+(?=[,:])", what)
    return int(number[0]) if number else float("inf")


def _joined(entries):
    stem = entries[0][1].rpartition(".")[0] or entries[0][1]
    variants = {}
    for value, test in entries:
        variants.setdefault(value, set()).add(test.rpartition(".")[2])
    matches = [COUNTED.fullmatch(value) for value, _ in entries]
    if all(matches):
        found, count = (sum(int(match[i]) for match in matches) for i in (1, 3))
        names = ", ".join(sorted(set().union(*variants.values())))
        return f"{found} {matches[0][2]} of {count} rays", f"{stem}: {names}"
    if len(variants) == 1:
        return entries[0][0], stem
    return "; ".join(f"{value} ({', '.join(sorted(tests))})" for value, tests in variants.items()), stem


def _counted(table, word):
    """How many of how many rays, in how many rows."""
    matches = [COUNTED.fullmatch(value) for _what, value, _tests in table]
    chosen = [match for match in matches if match and match[2] == word]
    return sum(int(match[1]) for match in chosen), sum(int(match[3]) for match in chosen), len(chosen)


def summary(table):
    """What README quotes.

    >>> summary([("1: a", "0 misses of 2000 rays", "t"), ("27: b", "0 self-hits of 1000 rays", "u"),
    ...          ("39: c", "off by at most 0.0005", "v"), ("39: d", "off by at most 3e-08", "v")])[-100:]
    'self-hits of 1,000 rays that leave surfaces. White furnaces are within 0.0005 for lobes of any kind.'
    """
    missed, count, cases = _counted(table, "misses")
    parts = [f"{missed} misses of {count:,} rays that must hit, in {cases} cases: closed surfaces met at "
             "their vertices and edges, strands at their joints and along their axes, at rest and in motion, "
             "needles, sizes from 1e-38 to 1e18, far from the origin"]
    left, leaving, _ = _counted(table, "self-hits")
    if leaving:
        parts.append(f"{left} self-hits of {leaving:,} rays that leave surfaces")
    furnaces = [match[1] for what, value, _tests in table if (match := FURNACE.match(f"{what} | {value}"))]
    if furnaces:
        parts.append(f"white furnaces are within {max(furnaces, key=float)} for lobes of any kind")
    ulps = [float(number) for _what, value, _tests in table for number in ULPS.findall(value)]
    if ulps:
        parts.append(f"functions of the kernels are at most {max(ulps):.1f} ulp off long arithmetic")
    return ". ".join(part[0].upper() + part[1:] for part in parts) + "."


def document(table):
    """The table with its summary, Markdown."""
    lines = [summary(table), "", "| measured | result | tests |", "|---|---|---|"]
    return "\n".join(lines + [f"| {what} | {value} | {tests} |" for what, value, tests in table]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("reports", nargs="+", type=pathlib.Path)
    parser.add_argument("--out", required=True)
    options = parser.parse_args()
    table = rows(figures(options.reports))
    if not table:
        sys.exit("no test printed a figure")
    with open(options.out, "w", encoding="utf-8") as file:
        file.write(document(table))


if __name__ == "__main__":
    main()

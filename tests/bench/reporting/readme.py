#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps what README.md quotes the committed report's and the committed table of stability's.

    readme.py           say whether they agree; the exit code is 1 if not
    readme.py --write   write it anew
"""

import pathlib
import sys
import textwrap

BENCH = pathlib.Path(__file__).resolve().parents[1]
for folder in (BENCH, BENCH.parent / "support"):
    sys.path.insert(0, str(folder))
from reporting import document, error_sections  # noqa: E402  (the folders are on the path only now)
from reporting.machine import names  # noqa: E402

PROJECT = BENCH.parents[1]
COMMITTED = BENCH / "report"
STABILITY = PROJECT / "tests" / "stability.md"  # of a run of the tests, from build/results
BEGIN, END = "<!-- {}: begin -->", "<!-- {}: end -->"
PLOTS = {"time-to-equal-error": "Time of Cycles over Volley's at equal error",
         "kernels": "Rays per second over Embree's"}


def headline(report=COMMITTED):
    """What stands between the markers, without them."""
    results = document.load(report)
    if "machine" not in results:
        return "No full report has been committed yet."
    machine = results["machine"]
    lines = [f"- {line}" for line in error_sections.headline_lines(results)]
    lines += ["", f"Measured on {' and '.join(names(machine))}, "
                  f"{machine['date'][:10]}, by `bash tests/bench/report.sh`; all of "
                  "it, losing cases first: [the report](tests/bench/report/report.md)."]
    for name, title in PLOTS.items():
        if (report / "plots" / f"{name}.svg").exists():
            lines += ["", f"![{title}](tests/bench/report/plots/{name}.svg)"]
    return "\n".join(lines)


def stability(table=STABILITY):
    """What the table of stability begins with."""
    return table.read_text(encoding="utf-8").split("\n\n")[0]


def replace_between(text, name, middle):
    """The text with another middle between the markers of that name.

    >>> replace_between("a\\n<!-- x: begin -->\\nold\\n<!-- x: end -->\\nb", "x", "new").split("\\n")
    ['a', '<!-- x: begin -->', 'new', '<!-- x: end -->', 'b']
    """
    begin, end = BEGIN.format(name), END.format(name)
    before, rest = text.split(begin)
    _old, after = rest.split(end)
    return f"{before}{begin}\n{middle}\n{end}{after}"


def _written(readme, report):
    """README as it should be."""
    text = replace_between(readme.read_text(encoding="utf-8"), "report", headline(report))
    return replace_between(text, "stability", textwrap.fill(stability(), 100))


def agrees(readme=PROJECT / "README.md", report=COMMITTED):
    """Whether README holds the report's headline and the table's summary."""
    return readme.read_text(encoding="utf-8") == _written(readme, report)


def write(readme=PROJECT / "README.md", report=COMMITTED):
    """Bring README up to the report and the table."""
    readme.write_text(_written(readme, report), encoding="utf-8")


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        write()
    sys.exit(0 if agrees() else "README.md and tests/bench/report or tests/stability.md disagree: readme.py --write")

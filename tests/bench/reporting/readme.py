#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps the headline in README.md the committed report's.

    readme.py           say whether they agree; the exit code is 1 if not
    readme.py --write   write it anew
"""

import pathlib
import sys

BENCH = pathlib.Path(__file__).resolve().parents[1]
for folder in (BENCH, BENCH.parent / "support"):
    sys.path.insert(0, str(folder))
from reporting import document, error_sections  # noqa: E402  (the folders are on the path only now)

PROJECT = BENCH.parents[1]
COMMITTED = BENCH / "report"
BEGIN, END = "<!-- report: begin -->", "<!-- report: end -->"
PLOTS = {"time-to-equal-error": "Time of Cycles over Volley's at equal error",
         "kernels": "Rays per second over Embree's"}


def headline(report=COMMITTED):
    """What stands between the markers, without them."""
    results = document.load(report)
    if "machine" not in results:
        return "No full report has been committed yet."
    machine = results["machine"]
    lines = [f"- {line}" for line in error_sections.headline_lines(results)]
    lines += ["", f"Measured on {machine['cpu']}, {machine['processors']} logical processors, "
                  f"{machine['isa']}, {machine['date'][:10]}, by `bash tests/bench/report.sh`; all of "
                  "it, losing cases first: [the report](tests/bench/report/report.md)."]
    for name, title in PLOTS.items():
        if (report / "plots" / f"{name}.svg").exists():
            lines += ["", f"![{title}](tests/bench/report/plots/{name}.svg)"]
    return "\n".join(lines)


def replace_between(text, middle):
    """The text with another middle between the markers.

    >>> replace_between(f"a\\n{BEGIN}\\nold\\n{END}\\nb", "new").split("\\n")
    ['a', '<!-- report: begin -->', 'new', '<!-- report: end -->', 'b']
    """
    before, rest = text.split(BEGIN)
    _old, after = rest.split(END)
    return f"{before}{BEGIN}\n{middle}\n{END}{after}"


def agrees(readme=PROJECT / "README.md", report=COMMITTED):
    """Whether README holds the report's headline."""
    text = readme.read_text(encoding="utf-8")
    return text == replace_between(text, headline(report))


def write(readme=PROJECT / "README.md", report=COMMITTED):
    """Bring README up to the report."""
    text = replace_between(readme.read_text(encoding="utf-8"), headline(report))
    readme.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        write()
    sys.exit(0 if agrees() else "README.md and tests/bench/report disagree: readme.py --write")

"""Counts the results of CTest and pytest and prints them as one line.

The reports are JUnit XML files. A runner that ended with an error but reported no failure (it crashed,
or the report is missing) counts as one failure, so that nothing is lost silently. Exit code 0 only if
something passed and nothing failed.
"""
import argparse
import os
import sys
import xml.etree.ElementTree as ElementTree


class Count:
    def __init__(self):
        self.passed = 0
        self.failed = []
        self.skipped = []


def read_report(path):
    """The test cases of a report as (name, element); None if it is missing or damaged."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):
        return None
    cases = []
    for case in root.iter("testcase"):
        group, name = case.get("classname") or "", case.get("name") or "?"
        cases.append((name if group in ("", name) else f"{group}.{name}", case))
    return cases


def ctest_result(case):
    """CTest also calls "skipped" what it could not start: that is a failure."""
    if case.get("status") == "run":
        return "passed", ""
    skipped = case.find("skipped")
    if skipped is not None:
        message = skipped.get("message") or ""
        if message.startswith("SKIP_"):
            return "skipped", "not on this machine"
        return "failed", message or "not run"
    failure = case.find("failure")
    return "failed", (failure.get("message") if failure is not None else "") or "failed"


def pytest_result(case):
    for kind in ("failure", "error"):
        element = case.find(kind)
        if element is not None:
            return "failed", (element.get("message") or kind).splitlines()[0]
    skipped = case.find("skipped")
    if skipped is not None:
        return "skipped", skipped.get("message") or ""
    return "passed", ""


def add(count, name, result, why):
    if result == "passed":
        count.passed += 1
    else:
        getattr(count, result).append((name, why))


def add_report(count, runner, path, status, result_of):
    """Adds one runner's report; status is the exit code of the runner."""
    failed_before = len(count.failed)
    cases = read_report(path)
    if cases is None:
        if status or os.path.exists(path):
            count.failed.append((runner, f"exit code {status} and no readable report"))
        return
    for name, case in cases:
        add(count, name, *result_of(case))
    if status and len(count.failed) == failed_before:
        count.failed.append((runner, f"exit code {status} without a failed test"))


def add_checks(count, path):
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            result, _, name = line.strip().partition(" ")
            if result:
                add(count, name, result if result in ("passed", "skipped") else "failed", "check")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for runner in ("--ctest", "--pytest"):
        parser.add_argument(runner, nargs=2, metavar=("XML", "STATUS"), action="append", default=[])
    parser.add_argument("--checks", metavar="FILE", action="append", default=[])
    options = parser.parse_args()

    count = Count()
    for path, status in options.ctest:
        add_report(count, "ctest", path, int(status), ctest_result)
    for path, status in options.pytest:
        add_report(count, "pytest", path, int(status), pytest_result)
    for path in options.checks:
        add_checks(count, path)
    if not count.passed and not count.failed:
        print("No test ran.")

    for heading, entries in (("Skipped", count.skipped), ("Failed", count.failed)):
        if entries:
            print(f"{heading}:")
            for name, why in entries:
                print(f"  {name}" + (f"  ({why})" if why else ""))
    line = f"{count.passed} passed, {len(count.failed)} failed"
    if count.skipped:
        line += f", {len(count.skipped)} skipped"
    print(line)
    return 0 if count.passed and not count.failed else 1


if __name__ == "__main__":
    sys.exit(main())

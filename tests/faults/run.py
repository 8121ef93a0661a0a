#!/usr/bin/env python3
"""A mutation run, by hand: which faults of faults.toml does no test notice?

    /usr/bin/python3 tests/faults/run.py [-j 2] [--only 17,18] [--survivors] [--widest] [--check]
                                         [--out build-faults]

Makes a copy of the sources that holds all faults (tree.py) in OUT/tree, builds it once in OUT/build, and
runs the tests of that copy with one fault on at a time, those that cover its place first, until one fails.
That one has to pass without the fault, else it does not count; one in Python has to fail twice, as a busy
machine can make Blender late. First all tests run with no fault on, which
says what each reaches (OUT/reach.json; --check does it again, after changes): a test that does not reach the
place of a fault cannot notice it and is left out. A fault that nothing notices has seen every test in C that
reaches it, on every instruction set (--widest: on the widest alone), and the Python files of its area; of
faults in the add-on those files alone. A crash or a time-out counts as noticed and is said as such.

Results are in OUT/results.json and, as a table, OUT/results.md. Faults that have one are left out unless
named by --only or, if nothing noticed them, by --survivors. All of it takes some two hours of two quiet
cores."""

import argparse
import concurrent.futures
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import tree

CTEST_SECONDS = 400    # of one test in C; the slowest takes 70 alone
PYTEST_SECONDS = 2400  # of one file in Python; the slowest takes 120 alone
WIDTHS = ("avx512", "avx2", "sse42", "neon", "scalar")  # instruction sets, the widest first


class Tests:
    """The tests of the build of the copy, run with one fault on or none (0)."""

    def __init__(self, out):
        self.tree, self.build = out / "tree", out / "build"
        listed = subprocess.run(["ctest", "--test-dir", self.build, "--show-only=json-v1"], check=True,
                                capture_output=True, text=True).stdout
        self.c_names = [test["name"] for test in json.loads(listed)["tests"]]
        self.python_files = sorted(path.name for folder in ("blender", "statistics")
                                   for path in (self.tree / "tests" / folder).glob("test_*.py"))
        self.isas = [isa for isa in WIDTHS if any(name.endswith("." + isa) for name in self.c_names)
                     and self._runs(isa)]

    def _runs(self, isa):
        probe = next(name for name in self.c_names if name.endswith("." + isa))
        return "Skipped" not in self._ctest(0, probe)[1]

    def in_c(self, base=None, isa=None):
        """Names of the tests in C of a name without instruction set, or all; of one set and those of none."""
        def fits(name):
            own = name.rpartition(".")[2] if name.rpartition(".")[2] in WIDTHS else None
            plain = name.removesuffix("." + own) if own else name
            is_named = base is None or plain == base or plain.startswith(base + ".")
            return is_named and (own is None or own == isa)
        return [name for name in self.c_names if fits(name)]

    def _environment(self, fault):
        """Of a fault's number, or of the file that is to hold what is reached."""
        chosen = {"VOLLEY_FAULT": str(fault)} if isinstance(fault, int) else {"VOLLEY_FAULT_NOTES": str(fault)}
        return {**os.environ, **chosen, "VOLLEY_BUILD": str(self.build),
                "BLENDER_USER_SCRIPTS": str(self.build / "blender"),
                "PYTHONPATH": str(self.tree / "tests/support")}

    def _ctest(self, fault, name):
        done = subprocess.run(
            ["nice", "ctest", "--test-dir", self.build, "-R", f"^{re.escape(name)}$", "--timeout",
             str(CTEST_SECONDS)], env=self._environment(fault), capture_output=True, text=True)
        return done.returncode == 0, done.stdout

    def _c_failure(self, fault, name):
        """(test, how it failed), None if it passes."""
        passed, output = self._ctest(fault, name)
        if passed:
            return None
        how = re.search(r"\*\*\*(\w+)", output)
        return name, how[1].lower() if how else "failed"

    def failure(self, fault, test, without=()):
        """(test, how it failed) of a test or the first of a file, None if all pass; fault: see _environment;
        without: tests to leave out of the file."""
        if ".py" not in test:
            return self._c_failure(fault, test)
        file, _, name = test.partition("::")
        return self._python_failure(fault, file, name, without)

    def _python_failure(self, fault, file, test, without):
        path = next((self.tree / "tests").glob(f"*/{file}"))
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.xml"
            command = ["nice", sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", "tests",
                       "--junit-xml", report, f"{path}::{test}" if test else path]
            if isinstance(fault, int):
                command.append("-x")
            for each in without:
                command += ["--deselect", f"{path.relative_to(self.tree / 'tests')}::{each.partition('::')[2]}"]
            try:
                subprocess.run(command, cwd=self.tree, env=self._environment(fault), capture_output=True,
                               timeout=PYTEST_SECONDS)
            except subprocess.TimeoutExpired:
                return file, "time-out"
            if not report.is_file():
                raise RuntimeError(f"pytest could not run {path}")
            for case in xml.parse(report).iter("testcase"):
                trouble = case.find("failure")
                if trouble is None:
                    trouble = case.find("error")
                if trouble is not None:
                    return f"{file}::{case.get('name')}", _how(trouble)
        return None


def _how(trouble):
    """How a test in Python failed, in a word."""
    text = (trouble.get("message") or "") + (trouble.text or "")
    if "TimeoutExpired" in text or "timed out" in text:
        return "time-out"
    return "crash" if re.search(r"ended with -\d+|Segmentation fault", text) else "failed"


def build(out):
    """Make the copy and build it."""
    tree.make(out / "tree")
    with open(out / "build.log", "w") as log:
        for command in (["cmake", "-G", "Ninja", "-C", out / "tree/.cmake/ci.cmake",
                         "-DTRACER_WERROR=OFF", "-S", out / "tree", "-B", out / "build"],
                        ["nice", "cmake", "--build", out / "build"]):
            if subprocess.run(command, stdout=log, stderr=subprocess.STDOUT).returncode:
                sys.exit(f"the copy cannot be built: see {out / 'build.log'}")


class Run:
    """What is run for each fault. reach: {test: {"seconds", "reaches": numbers, ...}}"""

    def __init__(self, tests, reach, widest):
        self._tests, self._reach = tests, reach
        self._isas = tests.isas[:1] if widest else tests.isas

    def _steps(self, fault):
        """The tests of a fault, likeliest first."""
        tests, steps = self._tests, []

        def add(names):
            steps.extend(name for name in sorted(names, key=lambda name: self._reach[name]["seconds"])
                         if name not in steps and fault["number"] in self._reach[name]["reaches"])

        for name in fault["tests"]:
            if not name.endswith(".py"):
                add(tests.in_c(name, tests.isas[0]))
        if not fault["file"].endswith(".py"):
            add(tests.in_c(isa=tests.isas[0]))
        for name in fault["tests"]:
            if name.endswith(".py"):
                add([name])
        for isa in self._isas[1:] if not fault["file"].endswith(".py") else ():
            add(tests.in_c(isa=isa))
        return steps

    def _failure(self, number, test, doubtful):
        """(test, how) of the first of a test or file that fails with a fault, passes without it, and fails with
        it again; others that failed go to doubtful."""
        while (failure := self._tests.failure(number, test, doubtful)) is not None:
            is_sure = self._tests.failure(0, failure[0]) is None
            if is_sure and (".py" not in test or self._tests.failure(number, failure[0]) is not None):
                return failure
            doubtful.append(failure[0])
            if "::" not in failure[0]:  # not one of several
                break
        return None

    def of(self, fault):
        """The result of one fault."""
        start = time.monotonic()
        steps = self._steps(fault)
        result = {"number": fault["number"], "what": fault["what"], "area": fault["area"], "file": fault["file"],
                  "by": None, "how": f"passes {len(steps)} tests" if steps else "reached by no test", "doubtful": []}
        for step in steps:
            failure = self._failure(fault["number"], step, result["doubtful"])
            if failure is not None:
                result["by"], result["how"] = failure
                break
        result["seconds"] = round(time.monotonic() - start)
        return result


def look(tests, name):
    """What one test reaches with no fault on."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        notes = Path(folder) / "notes"
        failure = tests.failure(notes, name)
        reached = sorted(set(map(int, notes.read_text().split()))) if notes.is_file() else []
    return {"seconds": round(time.monotonic() - start, 1), "reaches": reached,
            "fails": failure and ": ".join(failure)}


def find_reach(tests, store, again, workers):
    """What all tests reach; those that are known are left out unless again."""
    names = tests.python_files + tests.c_names
    known = json.loads(store.read_text()) if store.is_file() and not again else {}
    reach = {name: known[name] for name in names if name in known}
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        looks = {pool.submit(look, tests, name): name for name in names if name not in reach}
        for done in concurrent.futures.as_completed(looks):
            reach[looks[done]] = done.result()
            store.write_text(json.dumps(reach))
            if done.result()["fails"]:
                print(f"without a fault: {done.result()['fails']}", flush=True)
    return reach


def _why_struck(fault):
    """Why a fault is not run, None if it is."""
    return fault.get("equivalent") or ("since" in fault and f"shows in Blender {fault['since']} and later") or None


def write_table(path, results, struck):
    """Counts by area, survivors, and the whole list."""
    areas = {}
    for result in results:
        areas.setdefault(result["area"], []).append(result["by"] is not None)
    caught = sum(map(sum, areas.values()))
    lines = [f"{caught} of {len(results)} faults caught ({100.0 * caught / max(len(results), 1):.1f} %), "
             f"{len(struck)} struck out.", "", "| area | faults | caught |", "|---|---|---|"]
    lines += [f"| {area} | {len(each)} | {sum(each)} |" for area, each in areas.items()]
    lines += ["", "| | fault | caught by | how | seconds |", "|---|---|---|---|---|"]
    lines += [f"| {r['number']} | {r['what']} ({r['file']}) | {r['by'] or 'SURVIVED'} | {r['how']} | {r['seconds']} |"
              for r in sorted(results, key=lambda r: (r["by"] is not None, r["number"]))]
    lines += [f"| {f['number']} | {f['what']} ({f['file']}) | struck out | {_why_struck(f)} | |" for f in struck]
    path.write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-j", type=int, default=2, metavar="N", help="faults at once")
    parser.add_argument("--only", default="", metavar="N,N", help="these faults alone")
    parser.add_argument("--survivors", action="store_true", help="those that nothing noticed yet, again")
    parser.add_argument("--widest", action="store_true", help="tests in C on the widest instruction set alone")
    parser.add_argument("--check", action="store_true", help="run all tests with no fault on")
    parser.add_argument("--out", type=Path, default=tree.ROOT / "build-faults", metavar="DIR")
    arguments = parser.parse_args()
    if not all(map(importlib.util.find_spec, ("pytest", "numpy"))):
        parser.error("start it with a Python that has pytest and numpy, such as /usr/bin/python3")
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    build(out)
    tests = Tests(out)
    reach = find_reach(tests, out / "reach.json", arguments.check, max(arguments.j, 1))
    if arguments.check:
        failures = [each["fails"] for each in reach.values() if each["fails"]]
        print("\n".join(failures) or "all tests pass without a fault")
        sys.exit(bool(failures))

    run = Run(tests, reach, arguments.widest)
    store = out / "results.json"
    results = {r["number"]: r for r in json.loads(store.read_text())} if store.is_file() else {}
    listed = tree.faults()
    struck = [fault for fault in listed if _why_struck(fault)]
    live = [fault for fault in listed if not _why_struck(fault)]
    results = {number: r for number, r in results.items() if number in {f["number"] for f in live}}
    named = {int(number) for number in arguments.only.split(",") if number}
    survivors = {number for number, r in results.items() if r["by"] is None} if arguments.survivors else set()
    todo = [f for f in live if f["number"] in named | survivors
            or not named and not arguments.survivors and f["number"] not in results]
    lock = threading.Lock()

    def one(fault):
        result = run.of(fault)
        with lock:
            results[fault["number"]] = result
            ordered = [results[number] for number in sorted(results)]
            store.write_text(json.dumps(ordered, indent=1))
            write_table(out / "results.md", ordered, struck)
            print(f"{fault['number']:4} {result['seconds']:5} s  {result['by'] or 'SURVIVED'} "
                  f"({result['how']}): {fault['what']}", flush=True)

    with concurrent.futures.ThreadPoolExecutor(max(arguments.j, 1)) as pool:
        for done in [pool.submit(one, fault) for fault in todo]:
            done.result()
    print((out / "results.md").read_text().splitlines()[0])


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""What a report was measured with: machine, compiler, versions, date."""

import datetime
import json
import os
import pathlib
import platform
import re
import subprocess

PROJECT = pathlib.Path(__file__).resolve().parents[3]


def describe(options, scope):
    """The head of the report, plain strings and numbers."""
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "scope": scope.name,
        "cpu": cpu_name(),
        "processors": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2 ** 30, 1),
        "system": system_name(),
        "load_before": round(os.getloadavg()[0], 2),
        "isa": library_isa(options),
        "compiler": compiler(options),
        "blender": first_line([options.blender, "--version"]),
        "embree": package_version("libembree3-3"),
        "povray": package_version("povray"),
        "commit": first_line(["git", "-C", str(PROJECT), "rev-parse", "--short=12", "HEAD"]),
    }


def read_parts(path):
    """{part: {"date", "commit"}} of a report that is there: what its other parts were measured with."""
    return json.loads(path.read_text(encoding="utf-8")).get("parts", {}) if path.exists() else {}


def first_line(command):
    """The first line that a program prints, "" if there is none."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return (done.stdout.splitlines() or [""])[0]


def package_version(package):
    """The version of an installed Debian package, "" if it is not there."""
    return first_line(["dpkg-query", "-W", "-f", "${Version}\n", package])


def cpu_name():
    """The processor as the kernel names it."""
    try:
        text = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found.group(1).strip() if found else platform.machine()


def system_name():
    """Distribution and kernel."""
    try:
        name = platform.freedesktop_os_release().get("PRETTY_NAME", "")
    except OSError:
        name = platform.system()
    return f"{name}, {platform.system()} {platform.release()}"


def library_isa(options):
    """The instruction set that the library chooses."""
    spec = "scene=tiny,width=8,height=8,eyes=1"
    try:
        done = subprocess.run([str(options.build / "bin" / "frame_bench"), "--repeats", "1", "--json",
                               "/dev/stderr", spec], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    found = re.search(r'"isa": "(\w+)"', done.stderr)
    return found.group(1) if found else ""


def compiler(options):
    """Compiler and its options for a release build."""
    cache = options.build / "CMakeCache.txt"
    text = cache.read_text(encoding="utf-8") if cache.exists() else ""
    path = re.search(r"^CMAKE_C_COMPILER:\w+=(.+)$", text, re.MULTILINE)
    kind = re.search(r"^CMAKE_BUILD_TYPE:\w+=(.+)$", text, re.MULTILINE)
    name = first_line([path.group(1), "--version"]) if path else ""
    return f"{name}, {kind.group(1) if kind else 'unknown'} build"

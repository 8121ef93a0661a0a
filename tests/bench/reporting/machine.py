# SPDX-License-Identifier: Apache-2.0
"""What a report was measured with: machine, compiler, versions, date."""

import ctypes
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
        "embree": package_version("libembree4-4") or package_version("libembree3-3"),
        "povray": package_version("povray"),
        "commit": first_line(["git", "-C", str(PROJECT), "rev-parse", "--short=12", "HEAD"]),
    }


def of_part(described):
    """What is kept of a part's head: parts may be measured at different times and places."""
    return {**{key: described[key] for key in ("date", "commit")}, "machine": name_of(described)}


def name_of(described):
    """A machine in a few words, with the instruction set that the library chooses there."""
    return f"{described['cpu']}, {described['processors']} logical processors, {described['isa']}"


def names(described):
    """The machines that the parts of a report were measured on, each once, the latest first."""
    parts = sorted(described["parts"].values(), key=lambda part: part["date"], reverse=True)
    return list(dict.fromkeys(part["machine"] for part in parts))


def read_parts(path):
    """{part: of_part()} of a report that is there: what its other parts were measured with."""
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
    """The processor as the kernel names it; a name without a number says its family and model."""
    try:
        text = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    fields = dict(re.findall(r"^(model name|cpu family|model)\s*:\s*(.+?)\s*$", text, re.MULTILINE))
    name = fields.get("model name", platform.machine())
    if re.search(r"\d", name) or "cpu family" not in fields:
        return name
    return f"{name} (family {fields['cpu family']}, model {fields['model']})"


def system_name():
    """Distribution and kernel."""
    try:
        name = platform.freedesktop_os_release().get("PRETTY_NAME", "")
    except OSError:
        name = platform.system()
    return f"{name}, {platform.system()} {platform.release()}"


def library_isa(options):
    """The instruction set that the library chooses, "" if it is not built."""
    try:
        library = ctypes.CDLL(str(options.build / "lib" / "libtracer.so"))
    except OSError:
        return ""
    library.trc_isa_name.restype = ctypes.c_char_p
    return library.trc_isa_name(library.trc_isa()).decode()

def compiler(options):
    """Compiler and its options for a release build."""
    cache = options.build / "CMakeCache.txt"
    text = cache.read_text(encoding="utf-8") if cache.exists() else ""
    path = re.search(r"^CMAKE_C_COMPILER:\w+=(.+)$", text, re.MULTILINE)
    kind = re.search(r"^CMAKE_BUILD_TYPE:\w+=(.+)$", text, re.MULTILINE)
    name = first_line([path.group(1), "--version"]) if path else ""
    return f"{name}, {kind.group(1) if kind else 'unknown'} build"

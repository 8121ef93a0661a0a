# SPDX-License-Identifier: Apache-2.0
"""Runs functions of a test module inside Blender.

``Blender().run(function, *arguments)`` starts ``blender -b`` with the staged add-on, imports the module
the function stands in, calls it there and returns its result (anything that can be pickled; numpy arrays
too). An exception inside, a crash or a time-out fails the test with Blender's output.

    VOLLEY_BLENDER        the Blender to run, else ``blender``
    BLENDER_USER_SCRIPTS  the user-scripts folder of the build, else build/blender
"""

import functools
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile

SUPPORT = os.path.dirname(os.path.abspath(__file__))
REPOSITORY = os.path.dirname(os.path.dirname(SUPPORT))
_ANSWER = "answer.pickle"


class BlenderError(AssertionError):
    """Blender crashed, hung, or the function raised."""


def executable():
    """The Blender to test with, None if there is none."""
    return shutil.which(os.environ.get("VOLLEY_BLENDER", "blender"))


@functools.lru_cache(maxsize=None)
def full_version():
    """The Blender to test with, like "4.3.2"."""
    output = subprocess.run([executable(), "--version"], stdin=subprocess.DEVNULL, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True).stdout
    return re.search(r"Blender (\d+\.\d+(\.\d+)?)", output).group(1)


def version():
    """Its major and minor number."""
    return tuple(int(number) for number in full_version().split(".")[:2])


def has_display():
    """Whether windows can be opened on a virtual display."""
    return shutil.which("xvfb-run") is not None


def user_scripts():
    """The user-scripts folder with the add-on."""
    return os.environ.get("BLENDER_USER_SCRIPTS") or os.path.join(REPOSITORY, "build", "blender")


def write_result(name, lines, errors):
    """Keep a table among the results of the build that is tested, where there is one: its lines for people in
    NAME.txt, {case: relative error} in NAME.json for tests/versions_table.py."""
    path = os.path.join(os.environ.get("VOLLEY_BUILD", ""), "results", name)
    if not os.path.isdir(os.path.dirname(path)):
        return
    with open(path + ".txt", "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    with open(path + ".json", "w", encoding="utf-8") as file:
        json.dump({"blender": full_version(), "errors": {case: float(error) for case, error in errors.items()}}, file)


def command_line(options, *arguments):
    """That of a Blender that runs inside_blender.py with these arguments."""
    return [executable(), "-b", "--factory-startup", "--addons", "volley", *options,
            "--python-exit-code", "3", "--python", os.path.join(SUPPORT, "inside_blender.py"), "--", *arguments]


class Blender:
    """Starts Blender in a folder of its own; ``output`` is what the last run wrote."""

    def __init__(self, folder=None):
        self.folder = folder or tempfile.mkdtemp(prefix="volley_")
        self.output = ""
        self.options = []  # of the command line, for run()

    def complaints(self):
        """The lines of ``output`` that tell of an exception or an error. What Blender itself has not freed at
        its end is none: with Cycles in the window it is the same. Nor is what a display's wrapper says of its own
        folder, which it may be late to clear on a busy machine."""
        return [line for line in self.output.splitlines()
                if ("Traceback" in line or "rror" in line) and "Not freed memory" not in line
                and not line.startswith("xvfb-run:")]

    def command(self, *arguments):
        """Run Blender with these arguments; the finished process, whatever its exit code."""
        line = [executable(), "-b", "--factory-startup", "--addons", "volley"]
        return self._start(line + list(arguments), timeout=120)

    def run(self, function, *arguments, timeout=120):
        """Call a module-level function inside Blender and return what it returns."""
        request, answer = self._request(function, arguments)
        return self._answer(answer, self._start(command_line(self.options, request), timeout))

    def _request(self, function, arguments):
        """Write down what to call; the paths of the request and of its answer."""
        answer = os.path.join(self.folder, _ANSWER)
        if os.path.exists(answer):
            os.remove(answer)
        request = os.path.join(self.folder, "request.pickle")
        module = os.path.abspath(sys.modules[function.__module__].__file__)
        with open(request, "wb") as file:
            pickle.dump((module, function.__name__, arguments, answer), file)
        return request, answer

    def _answer(self, path, process):
        if not os.path.exists(path):
            raise BlenderError(f"Blender ended with {process.returncode} and no answer:\n{self.output}")
        with open(path, "rb") as file:
            result, error = pickle.load(file)
        if error:
            raise BlenderError(f"{error}\nBlender's output:\n{self.output}")
        return result

    def run_in_window(self, function, *arguments, timeout=120, size=(640, 480)):
        """The same with a window of that size on a virtual display. The function returns a generator:
        what it yields is the seconds to let Blender draw, what it returns is the result."""
        request, answer = self._request(function, arguments)
        display = ["xvfb-run", "-a", "-s", f"-screen 0 {size[0]}x{size[1]}x24 -fbdir {self.folder}"]
        line = display + [part for part in command_line(self.options, request) if part != "-b"]
        position = line.index("--factory-startup")
        line[position:position] = ["--window-geometry", "0", "0", *map(str, size)]
        process = self._start(line, timeout, {"LIBGL_ALWAYS_SOFTWARE": "1",
                                              "VOLLEY_SCREEN": os.path.join(self.folder, "Xvfb_screen0")})
        return self._answer(answer, process)

    def _start(self, line, timeout, environment=None):
        variables = dict(os.environ, BLENDER_USER_SCRIPTS=user_scripts(), **(environment or {}))
        try:
            process = subprocess.run(line, cwd=self.folder, env=variables, timeout=timeout, text=True,
                                     errors="replace", stdin=subprocess.DEVNULL,
                                     stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        except subprocess.TimeoutExpired as error:
            raise BlenderError(f"Blender did not end within {timeout} s:\n{error.output}") from error
        self.output = process.stdout
        return process

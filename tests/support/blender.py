# SPDX-License-Identifier: Apache-2.0
"""Runs functions of a test module inside Blender.

``Blender().run(function, *arguments)`` starts ``blender -b`` with the staged add-on, imports the module
the function stands in, calls it there and returns its result (anything that can be pickled; numpy arrays
too). An exception inside, a crash or a time-out fails the test with Blender's output. Where it may be
shared, one Blender answers all, each from the startup file: to start one takes longer than most tests.

    VOLLEY_BLENDER        the Blender to run, else ``blender``
    BLENDER_USER_SCRIPTS  the user-scripts folder of the build, else build/blender
"""

import ctypes
import enum
import functools
import json
import os
import pickle
import re
import select
import shutil
import subprocess
import sys
import tempfile

SUPPORT = os.path.dirname(os.path.abspath(__file__))
REPOSITORY = os.path.dirname(os.path.dirname(SUPPORT))
_ANSWER = "answer.pickle"
_SERVE = "serve"
_LEAVING_SECONDS = 10.0


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


class Blender:
    """Starts Blender in a folder of its own; ``output`` is what the last run wrote. Those that are shared let
    one Blender answer what they run."""

    def __init__(self, folder=None, is_shared=False):
        self.folder = folder or tempfile.mkdtemp(prefix="volley_")
        self.output = ""
        self._is_shared = is_shared
        self.options = []  # of the command line, for run()

    def command(self, *arguments):
        """Run Blender with these arguments; the finished process, whatever its exit code."""
        line = [executable(), "-b", "--factory-startup", "--addons", "volley"]
        return self._start(line + list(arguments), timeout=120)

    def run(self, function, *arguments, timeout=120):
        """Call a module-level function inside Blender and return what it returns."""
        answer, line = self._request(function, arguments)
        if self._is_shared and not self.options:
            return self._answer(answer, self._ask(line[-1], timeout))
        return self._answer(answer, self._start(line, timeout))

    def _request(self, function, arguments):
        """Write down what to call; the answer's path and the command line."""
        answer = os.path.join(self.folder, _ANSWER)
        if os.path.exists(answer):
            os.remove(answer)
        request = os.path.join(self.folder, "request.pickle")
        module = os.path.abspath(sys.modules[function.__module__].__file__)
        with open(request, "wb") as file:
            pickle.dump((module, function.__name__, arguments, answer), file)
        return answer, _command_line(self.options, request)

    def _answer(self, path, process):
        if not os.path.exists(path):
            raise BlenderError(f"Blender ended with {process.returncode} and no answer:\n{self.output}")
        with open(path, "rb") as file:
            result, error = pickle.load(file)
        if error:
            close_shared()  # whose state nobody knows
            raise BlenderError(f"{error}\nBlender's output:\n{self.output}")
        return result

    def _ask(self, request, timeout):
        """Let the shared Blender answer; its process."""
        global _shared
        if _shared is not None and _shared.process.poll() is not None:
            close_shared()
        if _shared is None:
            _shared = _Server()
        try:
            self.output = _shared.answer(request, self.folder, timeout)
        except subprocess.TimeoutExpired as error:
            close_shared()
            raise BlenderError(f"Blender did not end within {timeout} s:\n{error.output}") from error
        return _shared.process

    def run_in_window(self, function, *arguments, timeout=120, size=(640, 480)):
        """The same with a window of that size on a virtual display. The function returns a generator:
        what it yields is the seconds to let Blender draw, what it returns is the result."""
        answer, line = self._request(function, arguments)
        display = ["xvfb-run", "-a", "-s", f"-screen 0 {size[0]}x{size[1]}x24 -fbdir {self.folder}"]
        line = display + [argument for argument in line if argument != "-b"]
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


def _command_line(options, *arguments):
    return [executable(), "-b", "--factory-startup", "--addons", "volley", *options,
            "--python-exit-code", "3", "--python", os.path.abspath(__file__), "--", *arguments]


# The shared Blender --------------------------------------------------------------------------------

_shared = None


def close_shared():
    """End the shared Blender, if there is one; the next request starts another."""
    global _shared
    if _shared is not None:
        _shared.close()
        _shared = None


class _Server:
    """A Blender that answers one request after the other."""

    def __init__(self):
        self._log = tempfile.TemporaryFile()
        self._ready, ready = os.pipe()
        self.process = subprocess.Popen(_command_line([], _SERVE, str(ready)), pass_fds=[ready],
                                        env=dict(os.environ, BLENDER_USER_SCRIPTS=user_scripts()),
                                        stdin=subprocess.PIPE, stdout=self._log, stderr=subprocess.STDOUT)
        os.close(ready)

    def answer(self, request, folder, timeout):
        """Wait for it to call what a request asks for, in a folder; what it wrote meanwhile."""
        log, begin = self._log.fileno(), os.fstat(self._log.fileno()).st_size
        environment = dict(os.environ, BLENDER_USER_SCRIPTS=user_scripts())
        line = json.dumps({"request": request, "folder": folder, "environment": environment})
        try:
            self.process.stdin.write(line.encode() + b"\n")
            self.process.stdin.flush()
            is_ready = select.select([self._ready], [], [], timeout)[0]
        except BrokenPipeError:
            is_ready = True
        if is_ready and not os.read(self._ready, 1):
            self.process.wait()
        output = os.pread(log, os.fstat(log).st_size - begin, begin).decode(errors="replace")
        if not is_ready:
            raise subprocess.TimeoutExpired(self.process.args, timeout, output)
        return output

    def close(self):
        self.process.stdin.close()  # at which it ends, and writes what coverage.sh counts
        try:
            self.process.wait(_LEAVING_SECONDS)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._log.close()
        os.close(self._ready)


def _serve(ready):
    """Inside Blender: answer the requests of _Server.answer, each as if it were the first."""
    import addon_utils
    import bpy
    os.set_inheritable(ready, False)
    path = list(sys.path)
    for line in sys.stdin:
        order = json.loads(line)
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        os.environ.clear()
        os.environ.update(order["environment"])
        os.chdir(order["folder"])
        _answer_request(order["request"])
        sys.path[:] = path
        addon_utils.disable("volley")  # of which tests may have replaced parts
        for name in _modules_below(os.path.dirname(SUPPORT), user_scripts()):
            del sys.modules[name]
        addon_utils.enable("volley")
        sys.stdout.flush()
        ctypes.CDLL(None).fflush(None)
        os.write(ready, b".")


def _modules_below(*folders):
    """Names of imported modules whose files are there, but for the one that runs."""
    files = {name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}
    return [name for name, file in files.items() if file.startswith(folders) and name != "__main__"]


# Inside Blender ------------------------------------------------------------------------------------

class _Answers(pickle.Pickler):
    """Without the add-on's classes, which only Blender can import: its enumerators become numbers."""

    def reducer_override(self, value):
        return (int, (int(value),)) if isinstance(value, (enum.IntEnum, enum.IntFlag)) else NotImplemented


def _answer_request(path):
    """Inside Blender: import the test's module and call its function."""
    import importlib.util
    import traceback
    with open(path, "rb") as file:
        module_path, name, arguments, answer = pickle.load(file)

    def finish(result, error=""):
        with open(answer, "wb") as file:
            _Answers(file).dump((result, error))

    sys.path[:0] = [SUPPORT, os.path.dirname(module_path)]
    try:
        spec = importlib.util.spec_from_file_location("volley_inside", module_path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        result = getattr(module, name)(*arguments)
    except BaseException:
        finish(None, traceback.format_exc())
        _follow(iter(()), lambda _result: None)  # a window would stay
        return
    if hasattr(result, "send"):
        _follow(result, finish)
    else:
        finish(result)


def _follow(steps, finish):
    """Run a generator from one of Blender's timers, so that windows are drawn between its steps."""
    import traceback
    import bpy

    def step():
        try:
            return next(steps)
        except StopIteration as end:
            finish(end.value)
        except BaseException:
            finish(None, traceback.format_exc())
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(step, first_interval=0.5, persistent=True)


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1:]
    if arguments[0] == _SERVE:
        _serve(int(arguments[1]))
    else:
        _answer_request(arguments[0])

# SPDX-License-Identifier: Apache-2.0
"""What blender.py and shared_blender.py start inside Blender: calls the functions that requests name.

    blender ... --python inside_blender.py -- REQUEST
    blender ... --python inside_blender.py -- serve DESCRIPTOR

REQUEST is a pickle of (path of a module, name of a function in it, its arguments, path for the answer); the
answer is one of (result, traceback or ""). With "serve", requests come as lines of JSON at the standard
input, and a byte at the descriptor says that one is answered.
"""

import ctypes
import enum
import importlib.util
import json
import os
import pickle
import sys
import traceback

import addon_utils
import bpy

SUPPORT = os.path.dirname(os.path.abspath(__file__))
SERVE = "serve"


class _Answers(pickle.Pickler):
    """Without the add-on's classes, which only Blender can import: its enumerators become numbers."""

    def reducer_override(self, value):
        return (int, (int(value),)) if isinstance(value, (enum.IntEnum, enum.IntFlag)) else NotImplemented


def _answer_request(path):
    """Import the test's module and call its function."""
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


def _serve(ready):
    """Answer the requests of shared_blender.Server.answer, each as if it were the first."""
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
        for name in _modules_below(os.path.dirname(SUPPORT), order["environment"]["BLENDER_USER_SCRIPTS"]):
            del sys.modules[name]
        addon_utils.enable("volley")
        sys.stdout.flush()
        ctypes.CDLL(None).fflush(None)
        os.write(ready, b".")


def _modules_below(*folders):
    """Names of imported modules whose files are there, but for the one that runs."""
    files = {name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}
    return [name for name, file in files.items() if file.startswith(folders) and name != "__main__"]


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1:]
    if arguments[0] == SERVE:
        _serve(int(arguments[1]))
    else:
        _answer_request(arguments[0])

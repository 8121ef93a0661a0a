# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of Blender's render jobs use this engine, so that the add-on can leave while they run.

When a script unregisters the class of an engine, Blender frees the engines of all classes, those of a
running job, too, and the job goes on with freed memory. So the jobs end first: their renders stop as if
Esc were pressed and report an error, by which Blender ends a job after the frame it is at. Then it has to
let go of the engines: to free those of previews, and to say of a final render that it has ended, as each
frame may have another engine and persistent data keeps one.

All this happens before this engine is unregistered and before any add-on that has another is disabled:
"Reload Scripts" disables Cycles first. What is kept here is guarded by Python's own lock.
"""

import contextlib
import functools
import threading
import time

import addon_utils
import bpy
from bpy.app.handlers import persistent

from . import writes

LONGEST_SECONDS = 20.0  # that unregistering waits
_NAP_SECONDS = 0.002
_DISABLED = "stopped, as the add-on was disabled"
_OTHER_DISABLED = "stopped, as a render engine was disabled"


class _Jobs:
    """What Blender does with engines of this class."""

    refusal = ""          # why nothing is rendered now
    previews = set()      # ids of the engines made for one
    threads = []          # of the calls in progress
    render_thread = None  # of the final render under way, from its first engine to its end
    said = set()          # warnings of that render


@contextlib.contextmanager
def call(engine, is_query=False):
    """Around a call that Blender makes of an engine; is_query: only to ask for its passes, which a job does
    before it renders."""
    if is_query:
        if threading.current_thread() is not threading.main_thread() and _is_job_running():
            _note_render()
    elif engine.is_preview:
        _Jobs.previews.add(id(engine))
    else:
        _note_render()
    _Jobs.threads.append(threading.get_ident())
    try:
        yield
    finally:
        _Jobs.threads.remove(threading.get_ident())


def _note_render():
    if _Jobs.render_thread is not None:
        return
    _Jobs.said.clear()
    _Jobs.render_thread = threading.get_ident()
    for handlers in _end_handlers():
        if _render_ended not in handlers:
            handlers.append(_render_ended)


def forget(engine):
    """Blender frees an engine."""
    _Jobs.previews.discard(id(engine))


def is_cancelled(engine):
    """Whether a render is to stop: the user pressed Esc or the add-on is to leave."""
    return bool(_Jobs.refusal) or engine.test_break()


def is_new(engine, message):
    """Whether a warning was not yet given in this render job, which may have many frames."""
    if engine.is_preview:
        return True
    is_known = message in _Jobs.said
    _Jobs.said.add(message)
    return not is_known


def stop(reason):
    """Have what renders end, and nothing begin until :func:`allow`."""
    _Jobs.refusal = reason


def refusal():
    """Why nothing can be rendered now, "" where it can."""
    return _Jobs.refusal


def allow():
    """Let Blender render."""
    _Jobs.refusal = ""
    if addon_utils.disable is _disable_by_blender:
        addon_utils.disable = _disable


def end(seconds):
    """Have all jobs end within the time and none begin; whether they did end."""
    if not _have_ended(_DISABLED, seconds):
        return False
    if addon_utils.disable is _disable:
        addon_utils.disable = _disable_by_blender
    for handlers in _end_handlers():
        if _render_ended in handlers:
            handlers.remove(_render_ended)
    return True


_disable_by_blender = addon_utils.disable


@functools.wraps(_disable_by_blender)
def _disable(module_name, **options):
    """Blender's own function, after the jobs have ended where the add-on has an engine."""
    engines = [cls.__module__ for cls in bpy.types.RenderEngine.__subclasses__()]
    if any(name == module_name or name.startswith(f"{module_name}.") for name in engines):
        _have_ended(_OTHER_DISABLED, LONGEST_SECONDS)
        _Jobs.refusal = ""
    return _disable_by_blender(module_name, **options)


def _have_ended(reason, seconds):
    """Have all jobs end within the time; whether they did. They cannot where one of them calls this, from
    a handler."""
    _Jobs.refusal = reason
    if not _is_busy() or _is_own() or seconds <= 0.0:
        return not _is_busy()
    if threading.current_thread() is threading.main_thread():
        return writes.run_in_operator(lambda: _wait_for_jobs(seconds))
    return _wait_for_jobs(seconds)


def _wait_for_jobs(seconds):
    """Whether all jobs have ended after at most this time."""
    deadline = time.monotonic() + seconds
    while _is_busy() and time.monotonic() < deadline:
        time.sleep(_NAP_SECONDS)
    return not _is_busy()


def _is_busy():
    return bool(_Jobs.threads or _Jobs.previews or _renders())


def _renders():
    """Whether a final render is under way: until Blender says that it ended, where it runs a job."""
    return _Jobs.render_thread is not None and (
        _Jobs.render_thread == threading.main_thread().ident or _is_job_running())


def _is_job_running():
    return bpy.app.is_job_running('RENDER')


def _is_own():
    """Whether this thread is in a call of Blender's job."""
    return threading.get_ident() in (*_Jobs.threads, _Jobs.render_thread)


def _end_handlers():
    return bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel


@persistent
def _render_ended(*_):
    """Blender's word that a job has ended, on the job's thread."""
    _Jobs.render_thread = None

# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps Blender from forbidding scripts to write for good.

While an engine draws, Blender forbids Python to write to its data: by one switch for all threads, which a
draw sets and a render or an operator clears, and which each puts back as it found it. Calls of two threads
that do not end in the reverse order of their begin can leave it set: a render that begins within a draw of
the viewport and ends after it; from then on timers and handlers of all add-ons fail. So a render that found
the switch set ends within a call of Blender's own thread that did not: a draw that is made for it, or an
operator where that thread waits for renders to end. What is kept here is guarded by Python's own lock.

Of the calls of a viewport in a window the switch is set from the start. What has to be written there all the
same, settings of temporary data, is written by a property's update function: those Blender lets write always
(getters only before 5.0), and properties of the window manager may always be set.
"""

import contextlib
import threading
import time

import bpy

_LONGEST_SECONDS = 1.0  # that a call waits for others; then the switch may stay set
_NAP_SECONDS = 0.001
_WATCH_SECONDS = 0.05   # between two looks for renders that wait for a draw


class _Call:
    """One of Blender's calls, in progress."""

    def __init__(self, found_set, is_render):
        self.found_set = found_set
        self.is_render = is_render
        self.waits_for_draw = False


class _Switch:
    """Blender's switch, as far as the calls of this engine go."""

    is_set = False
    calls = []
    redraw = None  # the viewport's


@contextlib.contextmanager
def render_call():
    """Around a final render or a preview, on the thread that Blender renders on."""
    call = _begin(sets=False, is_render=True)
    try:
        yield
    finally:
        if call.found_set:
            call.waits_for_draw = True
            _wait_until(lambda: any(not other.found_set and not other.is_render for other in _Switch.calls))
        _end(call)


@contextlib.contextmanager
def draw_call(redraw):
    """Around a call of the viewport, on Blender's own thread. redraw() has it drawn once more."""
    with _main_call(sets=True):
        try:
            yield
        finally:
            if any(other.found_set for other in _Switch.calls):
                _watch(redraw)


def run_in_operator(function):
    """function() and its result, on Blender's own thread; renders can end meanwhile as they can within a
    draw. For what waits for them."""
    operator = getattr(bpy.types, "VOLLEY_OT_run", None)
    if operator is None:  # this module is not registered
        return function()
    operator.function = staticmethod(function)
    bpy.ops.volley.run()
    (result, error), operator.result = operator.result, None
    if error is not None:
        raise error
    return result


class VOLLEY_OT_run(bpy.types.Operator):
    """Run what the add-on wants to run in an operator"""

    bl_idname = "volley.run"
    bl_label = "Run"
    bl_options = {'INTERNAL'}

    function = result = None

    def execute(self, _context):
        cls = type(self)
        with _main_call(sets=False):
            cls.result = _result_of(cls.function)
        return {'FINISHED'}


def run(function):
    """function() and its result where Blender may forbid writing; for temporary data alone. It is called again
    where it was forbidden to write."""
    ends = time.monotonic() + _LONGEST_SECONDS
    while True:
        try:
            return function()
        except AttributeError:  # which is what Blender raises
            if threading.current_thread() is threading.main_thread():
                return _run_in_update(function)
            if time.monotonic() > ends:
                raise
        time.sleep(_NAP_SECONDS)  # a draw has set the switch; setting a property redraws, which is no thread's to do


def _run_in_update(function):
    _Update.function = function
    bpy.context.window_manager.volley_write = True
    (result, error), _Update.function, _Update.result = _Update.result, None, None
    if error is not None:
        raise error
    return result


class _Update:
    """What the update function runs, and its (result, exception); of Blender's own thread."""

    function = result = None


def _update(_window_manager, _context):
    _Update.result = _result_of(_Update.function)


def _result_of(function):
    """(result, exception): Blender prints exceptions of what it calls, and goes on."""
    try:
        return function(), None
    except Exception as error:
        return None, error


def register():
    bpy.utils.register_class(VOLLEY_OT_run)
    bpy.types.WindowManager.volley_write = bpy.props.BoolProperty(update=_update, options={'HIDDEN', 'SKIP_SAVE'})


def unregister():
    del bpy.types.WindowManager.volley_write
    bpy.utils.unregister_class(VOLLEY_OT_run)


def is_rendering():
    """Whether F12 or a preview is under way, which may have to wait for a draw."""
    return any(bpy.app.is_job_running(kind) for kind in ('RENDER', 'RENDER_PREVIEW'))


@contextlib.contextmanager
def _main_call(sets):
    """A call on Blender's own thread; renders that wait for it end before it does."""
    call = _begin(sets, is_render=False)
    try:
        yield
    finally:
        if not call.found_set:
            _wait_until(lambda: not _draw_is_awaited())
        _end(call)


def _begin(sets, is_render):
    call = _Call(_Switch.is_set, is_render)
    _Switch.calls.append(call)
    _Switch.is_set = sets
    return call


def _end(call):
    _Switch.calls.remove(call)
    _Switch.is_set = call.found_set


def _draw_is_awaited():
    return any(call.waits_for_draw for call in _Switch.calls)


def _wait_until(is_true):
    end = time.monotonic() + _LONGEST_SECONDS
    while not is_true() and time.monotonic() < end:
        time.sleep(_NAP_SECONDS)


def _watch(redraw):
    """Have a draw made for any render that began within this one and comes to wait for it."""
    _Switch.redraw = redraw
    if not bpy.app.timers.is_registered(_redraw_awaited):
        bpy.app.timers.register(_redraw_awaited, first_interval=_WATCH_SECONDS)


def _redraw_awaited():
    if _draw_is_awaited():
        _Switch.redraw()
    return _WATCH_SECONDS if is_rendering() else None

# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as Blender sees it: a gateway that hands every call on and lets no exception out."""

import traceback

import bpy
from bpy.app.handlers import persistent

from . import jobs, native, passes, viewport, writes
from .farm import job
from .farm.parts import PartError
from .log import logger
from .session import Session
from .sync import image

_RETRY_SECONDS = 0.5  # between two attempts to unregister during a render that cannot be waited for


class VolleyRenderEngine(bpy.types.RenderEngine):
    """Blender makes one for each render, each rendered viewport, and now and then one to ask for its
    passes; native state is made when first needed and freed when the work is done."""

    bl_idname = 'VOLLEY'
    bl_label = "Volley"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_exclude_layers = True
    bl_use_save_buffers = False
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True  # the Material Preview mode is EEVEE's
    bl_use_spherical_stereo = True
    bl_use_custom_freestyle = True

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._session = None
        self._viewport = None
        image.start_reader()  # before Blender evaluates the scene

    def __del__(self):
        jobs.forget(self)
        _free(self)
        parent_del = getattr(super(), "__del__", None)
        if parent_del is not None:
            parent_del()

    # Final renders and previews

    def update(self, data, depsgraph):
        """Everything is read in render(), under one roof; but a job has begun."""
        with jobs.call(self):
            pass

    def render(self, depsgraph):
        """Render one view layer of the depsgraph's scene."""
        if self._session is None:
            self._session = Session()
        with jobs.call(self), writes.render_call():
            if not jobs.refusal():
                self._guard(self._session.render, self, depsgraph)
            if jobs.refusal():
                self._fail(jobs.refusal())

    def update_render_passes(self, scene=None, renderlayer=None):
        """Name the passes of a view layer, for the compositor."""
        with jobs.call(self, is_query=True):
            passes.register_passes(self, scene, renderlayer)

    # Viewport

    def view_update(self, context, depsgraph):
        """The scene changed."""
        if jobs.refusal():
            return
        with writes.draw_call(viewport.redraw):
            self._guard(self._get_viewport().update, self, context, depsgraph)

    def view_draw(self, context, depsgraph):
        """Draw what there is."""
        if jobs.refusal():
            return
        with writes.draw_call(viewport.redraw):
            self._guard(self._get_viewport().draw, self, context, depsgraph)

    def _get_viewport(self):
        if self._viewport is None:
            self._viewport = viewport.Viewport()
        return self._viewport

    # Errors

    def _guard(self, function, *arguments):
        """Run a call; whatever goes wrong becomes Blender's error message, unless Blender has freed the
        engine meanwhile."""
        try:
            function(*arguments)
        except (native.TracerError, PartError, OSError) as error:
            self._fail(str(error))
        except MemoryError:
            self._fail("out of memory")
        except Exception as error:  # a defect of ours must not take Blender's render job down
            logger.debug("%s", traceback.format_exc())
            if _is_gone(self):
                _free(self)
                return
            self._fail(jobs.refusal() or f"internal error: {type(error).__name__}: {error}")

    def _fail(self, message):
        _free(self)
        job.add_failure(message)
        self.error_set(f"Volley: {message}")
        self.report({'ERROR'}, f"Volley: {message}")  # on the console, too, when there is no window

    # Life of the class

    @classmethod
    def leave(cls, seconds=jobs.LONGEST_SECONDS):
        """Have Blender forget the class; whether it did. Not while a render uses it that does not end
        within the time, such as one that this is called by: then nothing is rendered any more."""
        if not jobs.end(seconds):
            return False
        bpy.utils.unregister_class(cls)
        return True


def _free(engine):
    """Free what it holds of the library; possible, too, after Blender has freed the engine."""
    # Instances that Blender only asked for passes, or whose __init__ it skipped, have nothing.
    own = object.__getattribute__(engine, "__dict__")
    for state in filter(None, (own.get("_session"), own.get("_viewport"))):
        state.free()


def _is_gone(engine):
    """Whether Blender has freed what the object stands for, which then has no attributes."""
    try:
        return engine.is_preview is None
    except ReferenceError:
        return True


def _registered():
    """The class of this engine that Blender knows, which may be of modules reloaded since, or None."""
    return next((cls for cls in bpy.types.RenderEngine.__subclasses__()
                 if cls.__name__ == VolleyRenderEngine.__name__ and "bl_rna" in vars(cls)), None)


def _leave_later():
    if not VolleyRenderEngine.leave(0.0):
        return _RETRY_SECONDS
    native.unload()
    return None


@persistent
def _after_load(*_arguments):
    """A file of this engine is open, which will be rendered before long."""
    if any(scene.render.engine == VolleyRenderEngine.bl_idname for scene in bpy.data.scenes):
        image.start_reader()


def register():
    if bpy.app.timers.is_registered(_leave_later):
        bpy.app.timers.unregister(_leave_later)
    before = _registered()
    if before not in (None, VolleyRenderEngine) and not before.leave():
        raise RuntimeError("a render of Volley is under way: enable the add-on when it has ended")
    jobs.allow()
    if before is not VolleyRenderEngine:
        bpy.utils.register_class(VolleyRenderEngine)
    bpy.app.handlers.load_post.append(_after_load)


def unregister():
    if _after_load in bpy.app.handlers.load_post:  # others may have cleared it
        bpy.app.handlers.load_post.remove(_after_load)
    if not VolleyRenderEngine.leave():
        bpy.app.timers.register(_leave_later, first_interval=_RETRY_SECONDS, persistent=True)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as Blender sees it: a gateway that hands every call on and lets no exception out."""

import traceback

import bpy

from . import native, passes, viewport, writes
from .log import logger
from .session import Session


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
    bl_use_spherical_stereo = False
    bl_use_custom_freestyle = False

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._session = None
        self._viewport = None

    def __del__(self):
        self._free()
        parent_del = getattr(super(), "__del__", None)
        if parent_del is not None:
            parent_del()

    # Final renders and previews

    def update(self, data, depsgraph):
        """Nothing to do before render(): everything is read there, under one roof."""

    def render(self, depsgraph):
        """Render one view layer of the depsgraph's scene."""
        if self._session is None:
            self._session = Session()
        with writes.render_call():
            self._guard(self._session.render, self, depsgraph)

    def update_render_passes(self, scene=None, renderlayer=None):
        """Name the passes of a view layer, for the compositor."""
        passes.register_passes(self, scene, renderlayer)

    # Viewport

    def view_update(self, context, depsgraph):
        """The scene changed."""
        with writes.draw_call(viewport.redraw):
            self._guard(self._get_viewport().update, self, context, depsgraph)

    def view_draw(self, context, depsgraph):
        """Draw what there is."""
        with writes.draw_call(viewport.redraw):
            self._guard(self._get_viewport().draw, self, context, depsgraph)

    def _get_viewport(self):
        if self._viewport is None:
            self._viewport = viewport.Viewport()
        return self._viewport

    # Errors

    def _guard(self, function, *arguments):
        """Run a call; whatever goes wrong becomes Blender's error message."""
        try:
            function(*arguments)
        except native.TracerError as error:
            self._fail(str(error))
        except MemoryError:
            self._fail("out of memory")
        except Exception as error:  # a defect of ours must not take Blender's render job down
            logger.debug("%s", traceback.format_exc())
            self._fail(f"internal error: {type(error).__name__}: {error}")

    def _fail(self, message):
        self._free()
        self.error_set(f"Volley: {message}")
        self.report({'ERROR'}, f"Volley: {message}")
        if bpy.app.background:
            logger.error(message)

    def _free(self):
        # Instances that Blender only asked for passes, or whose __init__ it skipped, have nothing.
        for name in ("_session", "_viewport"):
            state = self.__dict__.get(name) if hasattr(self, "__dict__") else None
            if state is not None:
                state.free()


def register():
    bpy.utils.register_class(VolleyRenderEngine)


def unregister():
    bpy.utils.unregister_class(VolleyRenderEngine)

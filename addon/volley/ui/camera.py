# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of a camera's panorama, which Blender shows for Cycles alone."""

from bpy.types import Panel

from ..compat import panorama_settings
from .panel import VolleyPanel, column_of


class VOLLEY_CAMERA_PT_panorama(VolleyPanel, Panel):
    bl_label = "Panorama"
    bl_context = "data"
    bl_parent_id = "DATA_PT_lens"
    needs = "camera"

    _SHOWN = {
        'EQUIRECTANGULAR': ("latitude_min", "latitude_max", "longitude_min", "longitude_max"),
        'FISHEYE_EQUIDISTANT': ("fisheye_fov",),
        'FISHEYE_EQUISOLID': ("fisheye_lens", "fisheye_fov"),
        'FISHEYE_LENS_POLYNOMIAL': ("fisheye_fov", *(f"fisheye_polynomial_k{power}" for power in range(5))),
        'CENTRAL_CYLINDRICAL': tuple(f"central_cylindrical_{name}" for name in (
            "range_v_min", "range_v_max", "range_u_min", "range_u_max", "radius")),
    }

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.camera.type == 'PANO' \
            and panorama_settings(context.camera) is not None

    def draw(self, context):
        column, settings = column_of(self, has_keys=True).column(), panorama_settings(context.camera)
        column.prop(settings, "panorama_type", text="Type")
        for name in self._SHOWN.get(settings.panorama_type, ()):
            column.prop(settings, name)

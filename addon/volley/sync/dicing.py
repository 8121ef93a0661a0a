# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive subdivision: how finely the meshes of objects that ask for it are diced, by Cycles' settings."""

import math

import bpy
import numpy as np

from .. import abi
from ..compat import SUBDIVIDES_CAGE, cycles, has_adaptive_subdivision
from . import camera, creases

_ALL_AROUND = 2.0 * math.pi  # radians that a panorama's full width is taken for


class Dicing:
    """What a camera and a scene ask for; no reference to Blender is kept but the evaluated scene."""

    def __init__(self, scene, keys, frame, is_final, warnings):
        self._scene, self._is_final, self._warnings = scene, is_final, warnings
        self._rate = cycles(scene, "dicing_rate", 1.0) if is_final else cycles(scene, "preview_dicing_rate", 8.0)
        self.settings = (self._rate, cycles(scene, "max_subdivisions", 12),
                         cycles(scene, "offscreen_dicing_scale", 4.0), cycles(scene, "feature_set", None))
        chosen = cycles(scene, "dicing_camera", None)
        if chosen is not None and chosen.type == 'CAMERA':
            lens = camera.lens_of(chosen, warnings)
            self._lens, self._window = lens, camera.window(lens, frame)
            matrix = np.array(chosen.matrix_world, np.float64)[:3]
        else:
            middle = len(keys.transforms) // 2
            self._lens, self._window = keys.lens, keys.windows[len(keys.windows) // 2]
            matrix = np.asarray(keys.transforms[middle], np.float64).reshape(3, 4)
        self._axes, self._place = matrix[:, :3], matrix[:, 3]
        self._pixel = (self._window[1] - self._window[0]) / frame.width
        if self._lens.panorama:
            self._pixel, self._window = _ALL_AROUND * self._pixel, (0.0,) * 4

    def fields_of(self, each):
        """abi.DicingDesc's fields for the mesh of an instance, None where it is not subdivided adaptively."""
        blender_object = each.object
        if not has_adaptive_subdivision(blender_object, self._scene, self._is_final):
            return None
        modifier = blender_object.modifiers[-1]
        fields = {"surface": self._surface_of(each),
                  "max_subdivisions": cycles(self._scene, "max_subdivisions", 12)}
        if self._is_final and fields["surface"] == abi.DicingSurface.CURVED:
            self._warn_of_levels(blender_object, modifier)
        if SUBDIVIDES_CAGE:
            fields["sharp_corners"] = modifier.boundary_smooth != 'ALL'
            if modifier.adaptive_space == 'OBJECT':
                return {**fields, "space": abi.DicingSpace.OBJECT,
                        "side": self._rate * modifier.adaptive_object_edge_length}
            scale = modifier.adaptive_pixel_size
        else:
            scale = cycles(blender_object, "dicing_rate", 1.0)
        space = abi.DicingSpace.PARALLEL if self._lens.is_ortho else abi.DicingSpace.CENTRAL
        to_camera = self._to_camera(np.array(each.matrix_world))
        return {**fields, "space": space, "side": self._rate * scale * self._pixel,
                "object_to_camera": tuple(to_camera.ravel()), "window": tuple(self._window),
                "offscreen_scale": cycles(self._scene, "offscreen_dicing_scale", 4.0)}

    def cage_of(self, each):
        """The mesh that Cycles subdivides, where it can be had: below the modifier, if that makes levels, nothing else
        changes the shape. Else None."""
        blender_object = each.object
        if not SUBDIVIDES_CAGE or not has_adaptive_subdivision(blender_object, self._scene, self._is_final):
            return None
        original, modifier = blender_object.original, blender_object.modifiers[-1]
        shown = [modifier for modifier in blender_object.modifiers
                 if (modifier.show_render if self._is_final else modifier.show_viewport)]
        cage = original.data
        if len(shown) > 1 or not isinstance(cage, bpy.types.Mesh) or original.mode in {'EDIT', 'SCULPT'}:
            return None
        is_still = cage.shape_keys is None and cage.animation_data is None
        has_levels = modifier.subdivision_type != 'SIMPLE' and self._levels_of(modifier) > 0
        return cage if is_still and has_levels else None

    @staticmethod
    def creases_of(each, mesh, fields):
        """Further fields, arrays, of creases for the mesh of an instance that is diced by such fields. Till 4.3,
        Cycles heeds them whatever the modifier says."""
        is_off = SUBDIVIDES_CAGE and not each.object.modifiers[-1].use_creases
        return {} if is_off or fields["surface"] != abi.DicingSurface.CATMULL_CLARK else creases.creases_of(mesh)

    def would_repeat(self, each, settings, fields):
        """Whether an instance's mesh that was diced by such settings, to such fields (None: it was not), would be
        diced alike. As in Cycles, a viewport's camera moves without dicing anew; a render's picture is its own."""
        if settings == self.settings and (fields is None or not self._is_final):
            return True
        return fields == self.fields_of(each)

    def _to_camera(self, to_world):
        """(3, 4) from an object's space to that of the camera, without the scale of that."""
        to_world[:3, 3] -= self._place
        axes = self._axes / np.linalg.norm(self._axes, axis=0)
        return np.linalg.inv(axes) @ to_world[:3]

    def _surface_of(self, each):
        """Cycles subdivides what the modifier made once more, from 5.0 on what it began with: where that cannot be
        had, the vertices that it made lie on the limit already."""
        modifier = each.object.modifiers[-1]
        if modifier.subdivision_type == 'SIMPLE':
            return abi.DicingSurface.LINEAR
        if SUBDIVIDES_CAGE and self._levels_of(modifier) > 0 and self.cage_of(each) is None:
            return abi.DicingSurface.CURVED
        return abi.DicingSurface.CATMULL_CLARK

    def _warn_of_levels(self, blender_object, modifier):
        """Of how a surface differs that follows what the modifier made; Blender squares creases, Cycles does not."""
        levels, name = self._levels_of(modifier), blender_object.name
        if levels == 1:
            self._warnings.add(f"Object '{name}': adaptive subdivision starts from the modifier's level 1, which is "
                               "too coarse for Cycles' surface; 0, 2 and more are not")
        if modifier.use_creases and creases.creases_of(blender_object.data):
            self._warnings.add(f"Object '{name}': adaptive subdivision starts from the modifier's level {levels}, "
                               "whose creases are not those of Cycles; level 0 has them")

    def _levels_of(self, modifier):
        render = self._scene.render
        levels = modifier.render_levels if self._is_final else modifier.levels
        if not render.use_simplify:
            return levels
        most = render.simplify_subdivision_render if self._is_final else render.simplify_subdivision
        return min(levels, most)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights: Blender's light objects to the library's descriptors.

A light's node tree goes to the library as a material, whose emission at the place on the light that is
seen scales what the light gives there.
"""

import math

from .. import abi, native
from ..compat import (AREA_LIGHT_POWER, LIGHT_IS_OBJECT, LIGHT_UV_IS_LOCAL,
                      SHEARS_FROM_CENTER, SPOT_IS_EVEN, SUN_IS_EVEN, casts_shadow, cycles, is_ball, uses_nodes)
from .visibility import light_visibility


def are_shown(v3d):
    """Whether a viewport, None for a render, shows the scene's lights."""
    return v3d is None or v3d.shading.type != 'RENDERED' or v3d.shading.use_scene_lights_render


def describe(instance, item, materials, warnings):
    """The fields of trc_light_desc for an instance of an evaluated light, described as an item too, or None for
    one that is skipped; materials: material.Materials, which takes its nodes."""
    light_object, light = instance.object, instance.object.data
    if light.type not in abi.LightType.__members__:
        warnings.add(f"Light '{light.name}': type {light.type} is not supported, it is left out")
        return None
    if light.type == 'AREA' and cycles(light, "is_portal", False):
        return None  # of itself dark: it tells Cycles' sampling where the world shines in
    fields = {
        "type": abi.LightType[light.type],
        "transform": tuple(item.transforms[0]),
        "color": _color(light),
        "strength": light.energy * 2.0 ** getattr(light, "exposure", 0.0) * _own_power(light, item),
        "spread": math.pi, "spot_angle": math.pi,
        "visibility": light_visibility(light_object, item),
        "light_group": item.light_group,
        "light_exclude": item.links.light_exclude,
        "shadow_exclude": item.links.shadow_exclude,
        "random": item.random,
        "bounce_limit": _bounce_limit(light),
        "material": materials.light_id(instance) if uses_nodes(light) else 0,
        "cast_shadow": int(casts_shadow(light)),
        "use_mis": int(cycles(light, "use_multiple_importance_sampling", True)),
    }
    fields.update(_SHAPES[light.type](light))
    if not light_object.is_shadow_catcher:
        fields["flags"] = fields.get("flags", 0) | abi.LightFlags.SYNTHETIC
    if LIGHT_UV_IS_LOCAL:
        fields["flags"] = fields.get("flags", 0) | abi.LightFlags.LOCAL_UV
    if LIGHT_IS_OBJECT:
        fields["flags"] = fields.get("flags", 0) | abi.LightFlags.OBJECT
        fields.update(pass_index=item.pass_index, object_color=tuple(item.color))
    return fields


def _color(light):
    """The light's colour with its temperature where Blender has that (4.5 on)."""
    color = tuple(light.color)
    if getattr(light, "use_temperature", False):
        color = tuple(c * t for c, t in zip(color, light.temperature_color))
    return color


def _own_power(light, item):
    """What its shape makes of a light's energy. Without Normalize (5.0 on) it is not shared out over the
    light's size."""
    power = AREA_LIGHT_POWER if light.type == 'AREA' else 1.0
    if getattr(light, "normalize", True):
        return power
    if light.type == 'SUN':
        return math.pi * math.sin(0.5 * light.angle) ** 2 if light.angle > 0.0 else 1.0
    if light.type == 'AREA':
        shape = _area(light)
        fill = 1.0 if shape["area_shape"] == abi.AreaShape.RECTANGLE else 0.25 * math.pi
        columns = [math.hypot(*item.transforms[0][axis::4]) for axis in (0, 1)]
        return power * fill * shape["size_x"] * columns[0] * shape["size_y"] * columns[1]
    radius = light.shadow_soft_size
    return 4.0 * math.pi * radius ** 2 if radius > 0.0 else 4.0


def _bounce_limit(light):
    """Cycles' Max Bounces counts those that are allowed; its default is more than there are."""
    bounces = cycles(light, "max_bounces", _MANY_BOUNCES)
    return 0 if bounces >= _MANY_BOUNCES else bounces + 1


_MANY_BOUNCES = 1024


def _point(light):
    return {"radius": light.shadow_soft_size, "flags": abi.LightFlags.SPHERE if is_ball(light) else 0}


def _spot(light):
    fields = _point(light)
    fields["flags"] |= abi.LightFlags.EVEN_CONE if SPOT_IS_EVEN else 0
    return {**fields, "spot_angle": light.spot_size, "spot_blend": light.spot_blend}


def _sun(light):
    return {"angle": light.angle, "flags": abi.LightFlags.EVEN_CONE if SUN_IS_EVEN else 0}


def _area(light):
    is_square = light.shape in {'SQUARE', 'DISK'}
    return {"size_x": light.size, "size_y": light.size if is_square else light.size_y,
            "flags": abi.LightFlags.CENTERED if SHEARS_FROM_CENTER else 0,
            "area_shape": abi.AreaShape.RECTANGLE if light.shape in {'SQUARE', 'RECTANGLE'}
            else abi.AreaShape.ELLIPSE,
            "spread": min(max(getattr(light, "spread", math.pi), 1e-4), math.pi)}


_SHAPES = {'POINT': _point, 'SPOT': _spot, 'SUN': _sun, 'AREA': _area}


class Lights:
    """The lights of one scene of the library, by instance key."""

    def __init__(self, scene, warnings):
        self._scene, self._warnings = scene, warnings
        self._entries = {}  # key -> (id, fields)

    def update(self, lights):
        """Make the library's lights those of {key: fields}; one it refuses is left out."""
        refused = set()
        for key, fields in lights.items():
            try:
                self._update_one(key, fields)
            except native.TracerError as error:
                if error.status != abi.StatusCode.ERROR_INVALID_ARGUMENT:
                    raise
                self._warnings.add(f"Light '{key[0]}': {error}; it is left out")
                refused.add(key)
        for key in [key for key in self._entries if key not in lights or key in refused]:
            self._scene.destroy_light(self._entries.pop(key)[0])

    def change(self, key, fields):
        """Bring one of them up to date; False if the library refuses it."""
        try:
            self._update_one(key, fields)
        except native.TracerError as error:
            if error.status != abi.StatusCode.ERROR_INVALID_ARGUMENT:
                raise
            return False
        return True

    def _update_one(self, key, fields):
        known = self._entries.get(key)
        if known is None:
            self._entries[key] = (self._scene.create_light(**fields), fields)
        elif known[1] != fields:
            self._scene.update_light(known[0], **fields)
            self._entries[key] = (known[0], fields)

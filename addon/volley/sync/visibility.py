# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rays see an object: Blender's ray visibility switches as the library's bits."""

from ..abi import VisibleRays
from ..compat import LIGHT_IS_OBJECT

# Plain numbers: these are put together for every object, and flags of Python's are slow at it.
_CAMERA, _DIFFUSE, _GLOSSY, _TRANSMISSION, _SHADOW = map(int, (
    VisibleRays.CAMERA, VisibleRays.DIFFUSE, VisibleRays.GLOSSY, VisibleRays.TRANSMISSION, VisibleRays.SHADOW))

_WORLD_BITS = (
    ("camera", _CAMERA), ("diffuse", _DIFFUSE), ("glossy", _GLOSSY), ("transmission", _TRANSMISSION))


def object_visibility(blender_object):
    """VisibleRays of an object's own switches."""
    return (_CAMERA * blender_object.visible_camera | _DIFFUSE * blender_object.visible_diffuse
            | _GLOSSY * blender_object.visible_glossy | _TRANSMISSION * blender_object.visible_transmission
            | _SHADOW * blender_object.visible_shadow)


def light_visibility(light_object, item):
    """VisibleRays of a light that is described as an item: as of any instance, before Blender 5 its own; shadow
    rays do not apply."""
    return (item.visibility if LIGHT_IS_OBJECT else object_visibility(light_object)) | _SHADOW


def world_visibility(world):
    """VisibleRays of a world; they live with Cycles' settings."""
    switches = getattr(world, "cycles_visibility", None)
    if switches is None:
        return VisibleRays.ALL
    return sum(bit for name, bit in _WORLD_BITS if getattr(switches, name)) | _SHADOW


def instance_visibility(blender_object, maker, view_layer):
    """VisibleRays of an object or the instance of it that another one makes: the switches of both."""
    mask = object_visibility(blender_object)
    if maker is not None:
        mask &= object_visibility(maker)
    owner = maker or blender_object
    if owner.indirect_only_get(view_layer=view_layer) and not is_holdout(blender_object, maker, view_layer):
        mask &= ~_CAMERA
    return mask


def is_holdout(blender_object, maker, view_layer):
    """Whether it punches a hole into the picture: as what makes it says, if something does."""
    return (maker or blender_object).holdout_get(view_layer=view_layer)


def is_shadow_catcher(blender_object, maker, view_layer):
    """Whether it stands for something of the footage; holes are no part of that."""
    is_catcher = blender_object.is_shadow_catcher or (maker is not None and maker.is_shadow_catcher)
    return is_catcher and not is_holdout(blender_object, maker, view_layer)

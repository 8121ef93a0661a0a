# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rays see an object: Blender's ray visibility switches as the library's bits."""

from ..abi import VisibleRays
from ..compat import LIGHT_IS_OBJECT

# Plain numbers: these are put together for every object, and flags of Python's are slow at it.
_CAMERA, _SHADOW = int(VisibleRays.CAMERA), int(VisibleRays.SHADOW)

_OBJECT_BITS = (
    ("visible_camera", _CAMERA), ("visible_diffuse", int(VisibleRays.DIFFUSE)),
    ("visible_glossy", int(VisibleRays.GLOSSY)), ("visible_transmission", int(VisibleRays.TRANSMISSION)),
    ("visible_shadow", _SHADOW))

_WORLD_BITS = (
    ("camera", _CAMERA), ("diffuse", int(VisibleRays.DIFFUSE)), ("glossy", int(VisibleRays.GLOSSY)),
    ("transmission", int(VisibleRays.TRANSMISSION)))


def object_visibility(blender_object):
    """VisibleRays of an object's own switches."""
    return sum(bit for name, bit in _OBJECT_BITS if getattr(blender_object, name))


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


def instance_visibility(instance, view_layer):
    """VisibleRays of one depsgraph instance: the object's and its instancer's switches."""
    blender_object = instance.object
    mask = object_visibility(blender_object)
    parent = instance.parent if instance.is_instance else None
    if parent is not None:
        mask &= object_visibility(parent)
    owner = parent or blender_object
    if owner.indirect_only_get(view_layer=view_layer) and not is_holdout(instance, view_layer):
        mask &= ~_CAMERA
    return mask


def is_holdout(instance, view_layer):
    """Whether the instance punches a hole into the picture: as what makes it says, if something does."""
    owner = instance.parent if instance.is_instance and instance.parent else instance.object
    return owner.holdout_get(view_layer=view_layer)


def is_shadow_catcher(instance, view_layer):
    """Whether the instance stands for something of the footage; holes are no part of that."""
    is_instanced = instance.is_instance and instance.parent and instance.parent.is_shadow_catcher
    return bool(instance.object.is_shadow_catcher or is_instanced) \
        and not is_holdout(instance, view_layer)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The studio light that a viewport shows in place of the scene's world."""

from collections import namedtuple

from ..abi import MappingType, NodeType
from . import flatten
from .values import CONSTANT, Value
from .working_space import from_rec709

# An equirectangular picture, turned about Z (radians); how much of it the camera sees before a colour.
Studio = namedtuple("Studio", "path rotation strength camera_share background")

_NO_STUDIO = Studio("", 0.0, 0.0, 1.0, (0.0, 0.0, 0.0))


def of_view(v3d, scene):
    """The studio light of a viewport, None for the scene's own world."""
    if v3d is None or v3d.shading.type != 'RENDERED' or v3d.shading.use_scene_world_render:
        return None
    shading = v3d.shading
    light = shading.selected_studio_light
    if light is None or not light.path:
        return _NO_STUDIO
    background = tuple(scene.world.color) if scene.world is not None else _NO_STUDIO.background
    return Studio(light.path, shading.studiolight_rotate_z, shading.studiolight_intensity,
                  shading.studiolight_background_alpha, background)


def flatten_studio(studio, image_id):
    """The light as a flat tree of the world; image_id: the library's, of its picture."""
    walker = flatten.Walker("", None)

    def constant(kind, *numbers):
        return Value(kind, CONSTANT, 0, (numbers + (0.0, 0.0, 0.0))[:3])

    direction = Value('v', walker.emit(NodeType.TEXTURE_COORDINATE, ()), 0)
    turned = Value('v', walker.emit(NodeType.MAPPING, (
        direction, constant('v'), constant('v', 0.0, 0.0, studio.rotation), constant('v', 1.0, 1.0, 1.0)),
        MappingType.VECTOR), 0)
    color = Value('c', walker.emit(NodeType.ENVIRONMENT, (turned,), image=image_id), 0)
    color = from_rec709(walker, color)
    light = walker.emit(NodeType.BACKGROUND, (color, constant('f', studio.strength)))
    if studio.camera_share < 1.0:
        is_camera = Value('f', walker.emit(NodeType.LIGHT_PATH, ()), 0)
        seen = walker.emit(NodeType.BACKGROUND, (
            constant('c', *studio.background), constant('f', 1.0)))
        share = walker.emit(NodeType.MIX_SHADER, (
            constant('f', studio.camera_share), Value('s', seen, 0), Value('s', light, 0)))
        light = walker.emit(NodeType.MIX_SHADER, (is_camera, Value('s', light, 0), Value('s', share, 0)))
    walker.flat.surface = light
    return walker.flat

# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: background, its visibility and sampling, ambient occlusion."""

from .. import abi
from ..compat import cycles
from .visibility import world_visibility


DEFAULT_AO_DISTANCE = 10.0  # m; Blender's of a new world
MIN_AO_DISTANCE = 1e-6  # m; Blender's slider goes down to 0
MIST_EXPONENTS = {'QUADRATIC': 2.0, 'LINEAR': 1.0, 'INVERSE_QUADRATIC': 0.5}


def describe(world, material_id, sun, settings, light_groups):
    """The fields of trc_world_desc; sun: sky_texture.Sun or None; settings: ``scene.volley``; light_groups:
    {name: number}. Without a world all is black."""
    fields = {"material": material_id, "visibility": abi.VisibleRays.ALL, "use_sampling": 0,
              "map_resolution": 0, "ao_factor": 0.0, "ao_distance": DEFAULT_AO_DISTANCE}
    if world is None:
        return fields
    fields["ao_distance"] = max(world.light_settings.distance, MIN_AO_DISTANCE)
    fields["light_group"] = light_groups.get(world.lightgroup, 0)
    if settings.use_ambient_occlusion:
        fields["ao_factor"] = world.light_settings.ao_factor
        fields["ao_method"] = abi.AoMethod[settings.ao_method]
    if sun is not None:
        fields["sun_direction"], fields["sun_angle"] = sun
    method = cycles(world, "sampling_method", 'AUTOMATIC')
    fields["visibility"] = world_visibility(world)
    fields["use_sampling"] = int(method != 'NONE')
    fields["cast_shadow"] = int(cycles(world, "use_shadows", True))
    if method == 'MANUAL':
        fields["map_resolution"] = cycles(world, "sample_map_resolution", 0)
    return fields


_MANY_BOUNCES = 1024  # Cycles' default, more than there are


def note_unread(world, warnings):
    """Warn of settings that change Cycles' picture alone."""
    if cycles(world, "max_bounces", _MANY_BOUNCES) < _MANY_BOUNCES:
        warnings.add(f"World '{world.name}': Max Bounces is not supported, light of the world goes on for all bounces")


def mist_fields(world):
    """The fields of trc_render_desc for the Mist pass; without a world, Blender's defaults."""
    if world is None:
        return {"mist_start": 5.0, "mist_depth": 25.0, "mist_falloff": MIST_EXPONENTS['QUADRATIC']}
    mist = world.mist_settings
    return {"mist_start": mist.start, "mist_depth": mist.depth,
            "mist_falloff": MIST_EXPONENTS[mist.falloff]}

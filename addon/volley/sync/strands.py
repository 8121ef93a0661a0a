# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and points: particle hair, Curves and Point Cloud objects, as ``curves`` has them."""

from itertools import chain

import bpy
import numpy as np

from .. import abi
from ..compat import PARTICLE_HAIR_HAS_NORMALS, VECTORS_ARE_BUFFERS
from . import curves
from .attribute_values import VELOCITY, colors_of, has_velocity, is_pair, linear, named_colors, widen
from .mesh import active_color_name, wanted_uv_layers
from .standard_attributes import UV, shown_by_uv_nodes

HAIR_ATTRIBUTE = ".hair"  # (intercept, length, thickness, random) of the Hair Info node
DIRECTION_ATTRIBUTE = ".strand"  # (x, y, z) along the strand, unit, and 1
NORMAL_ATTRIBUTE = ".normal"  # (x, y, z) of Curves objects' points in object space, and 1

_DEFAULT_RADIUS = 0.005      # m; Cycles' of curves without the attribute
_DEFAULT_POINT_RADIUS = 0.01


def hair_systems(blender_object, is_final):
    """The (number, modifier) pairs of an evaluated object's particle systems that show hair as paths."""
    modifiers = [m for m in blender_object.modifiers if m.type == 'PARTICLE_SYSTEM']
    for number, modifier in enumerate(modifiers):
        system = modifier.particle_system
        settings = system.settings if system is not None else None
        is_on = modifier.show_render if is_final else modifier.show_viewport
        if settings is not None and is_on and settings.type == 'HAIR' and settings.render_type == 'PATH':
            yield number, modifier


def has_strands(instance):
    """Whether the instance shows a Curves or Point Cloud object."""
    return isinstance(instance.object.data, _DATA_TYPES)


_DATA_TYPES = tuple(getattr(bpy.types, name) for name in ("Curves", "PointCloud") if hasattr(bpy.types, name))


class Hair:
    """The hair of one of an object's particle systems, at any time that the depsgraph is moved to.
    wanted: curves.Wanted; a strand has the values of its root."""

    def __init__(self, number, depsgraph, is_final, wanted):
        self._number, self._depsgraph, self._is_final, self._wanted = number, depsgraph, is_final, wanted

    def _find(self, instance):
        """The evaluated object itself of an instance of it, and the modifier, None where it is off."""
        real = instance.object.original.evaluated_get(self._depsgraph)
        return real, dict(hair_systems(real, self._is_final)).get(self._number)

    def may_move(self, instance):
        """Whether it may go elsewhere than its object goes."""
        real, modifier = self._find(instance)
        mesh = real.original.data
        return (any(each.type != 'PARTICLE_SYSTEM' for each in real.modifiers)
                or mesh.shape_keys is not None or mesh.animation_data is not None
                or modifier.particle_system.use_hair_dynamics
                or modifier.particle_system.settings.animation_data is not None
                or any(_has_force(each) for each in self._depsgraph.objects))

    def read(self, instance):
        """It as curves.Strands, None without a strand."""
        real, modifier = self._find(instance)
        if modifier is None:
            return None
        system = modifier.particle_system
        settings = system.settings
        steps = (1 << (settings.render_step if self._is_final else settings.display_step)) + 1
        if settings.kink == 'SPIRAL':
            steps += settings.kink_extra_steps
        shown = _shown_strands(system)
        if not shown:
            return None
        keys = _places(real, system, shown, steps)
        matrix = np.array(real.matrix_world.inverted_safe())  # particles are in the world
        keys = keys @ matrix[:3, :3].T
        keys += matrix[:3, 3]
        strands = curves.Strands(keys, np.zeros(len(keys)), np.full(len(keys) // steps, steps))
        strands.radii = _hair_radii(settings, strands)
        return strands

    @staticmethod
    def velocities(_instance):
        """As StrandObject's."""
        return None

    def curves(self, instance, strands):
        """Which keys of what was read are kept, None for all, and those as curves.CurvesData."""
        real, modifier = self._find(instance)
        values = _root_values(real.data, modifier, _shown_strands(modifier.particle_system),
                              self._wanted.uv_names, self._wanted.color_names)
        if PARTICLE_HAIR_HAS_NORMALS and NORMAL_ATTRIBUTE in self._wanted.color_names:
            rows = np.tile(np.array((0.0, 0.0, 1.0, 1.0), np.float32), (len(strands.lengths), 1))
            values.append((NORMAL_ATTRIBUTE, rows, True))
        is_kept = strands.keys_kept()
        strands = strands.only(is_kept)
        generated = None
        if self._wanted.needs_generated:
            location, size = (np.array(each) for each in (real.data.texspace_location, real.data.texspace_size))
            generated = _in_box(strands.first_points(), location, size)
        return is_kept, _curves(strands, self._wanted, values, generated)


class StrandObject:
    """A Curves or Point Cloud object, at any time; wanted: as Hair's."""

    def __init__(self, wanted):
        self._wanted = wanted

    @staticmethod
    def may_move(_instance):
        """Whether it may go elsewhere than its object goes."""
        return True

    @staticmethod
    def read(instance):
        """It as curves.Strands, None without a point."""
        data = instance.object.data
        positions = _values(data, "position", "vector", 3)
        if len(positions) == 0:
            return None
        if not isinstance(data, bpy.types.Curves):
            return curves.Strands(positions, _values(data, "radius", "value", 1, _DEFAULT_POINT_RADIUS)[:, 0])
        lengths = np.empty(len(data.curves), np.int32)
        data.curves.foreach_get("points_length", lengths)
        return curves.Strands(positions, _values(data, "radius", "value", 1, _DEFAULT_RADIUS)[:, 0], lengths)

    def curves(self, instance, strands):
        """Which keys of what was read are kept (None: all), and those as curves.CurvesData."""
        values = _object_values(instance.object.data, self._wanted.uv_names, self._wanted.color_names)
        return None, _curves(strands, self._wanted, values)

    @staticmethod
    def velocities(instance):
        """(points, 3) m/s of what moves it, None where there is nothing."""
        data = instance.object.data
        values = colors_of(data.attributes[VELOCITY]) if has_velocity(data.attributes) else None
        if values is not None and len(values) != len(data.points):  # of strands
            lengths = np.empty(len(data.curves), np.int32)
            data.curves.foreach_get("points_length", lengths)
            values = np.repeat(values, lengths, axis=0)
        return None if values is None else values[:, :3]


def _has_force(blender_object):
    """Whether an object is a force field, which bends hair."""
    return blender_object.field is not None and blender_object.field.type != 'NONE'


def _shown_strands(system):
    """Numbers of the strands of a system that are seen: its particles come before their children, beside which
    Cycles shows none of them, whatever the system's Parents is."""
    parent_count, child_count = len(system.particles), len(system.child_particles)
    first = parent_count if child_count else 0
    return range(first, parent_count + child_count)


def _places(real, system, strands, steps):
    """(keys, 3) float64: where the keys of strands are in the world. Blender gives them one by one alone."""
    place, each = system.co_hair, range(steps)
    vectors = ([place(real, particle_no=number, step=step) for step in each] for number in strands)
    if VECTORS_ARE_BUFFERS:
        keys = np.frombuffer(b"".join(map(b"".join, vectors)), np.float32).astype(np.float64)
    else:  # numbers one by one: of vectors, numpy takes five times as long
        numbers = chain.from_iterable(chain.from_iterable(vectors))
        keys = np.fromiter(numbers, np.float64, 3 * steps * len(strands))
    return _with_ends(keys.reshape(-1, steps, 3)).reshape(-1, 3)


def _with_ends(keys):
    """(strands, steps, 3) with the last key of each strand in place of those after it. Strands that are cut
    short, and children of spirals, have fewer keys than their system has steps; Blender gives zeros for the others."""
    is_key = keys.any(axis=2)
    if is_key[:, -1].all():
        return keys
    steps = np.arange(keys.shape[1])
    last = np.where(is_key, steps, 0).max(axis=1)
    return np.take_along_axis(keys, np.minimum(steps, last[:, None])[..., None], axis=1)


def _in_box(points, middle, half):
    """Places as Generated coordinates of a box; a flat side becomes 0.5."""
    return 0.5 + np.divide(points - middle, 2.0 * half, out=np.zeros(points.shape), where=half > 0.0)


def _curves(strands, wanted, values, generated=None):
    """curves.CurvesData of strands or points, with those values."""
    own = []
    if strands.lengths is not None:
        own = [(name, tell(), False) for name, tell in (
            (HAIR_ATTRIBUTE, strands.info), (DIRECTION_ATTRIBUTE, strands.directions)) if name in wanted.color_names]
    room = abi.MAX_ATTRIBUTES - len(own)  # the first is the library's default
    return curves.curves_of(strands, wanted, values[:room] + own + values[room:], generated)


def _root_values(mesh, modifier, strands, uv_names, color_names):
    """(name, (strands, 2 or 4), True) of each UV map and colour attribute that is asked for, as meshes have
    them: the default map first."""
    found = []
    for number, layer in wanted_uv_layers(mesh, uv_names):
        values = _at_roots(modifier.particle_system.uv_on_emitter, modifier, strands, uv_no=number)
        found.append((layer.name, values, True))
    for name in sorted(shown_by_uv_nodes(uv_names).union(color_names)):
        values = named_colors(name, color_names, lambda each: _root_colors(mesh, modifier, strands, each),
                              lambda each: _root_layer(mesh, each) is not None)
        if values is not None and all(name != known for known, _, _ in found):
            found.append((name, values, True))
    return found


def _root_colors(mesh, modifier, strands, name):
    """(strands, 4) of the UV map or the colour attribute of that name, None without any."""
    system, layer = modifier.particle_system, _root_layer(mesh, name)
    if layer is not None:
        return widen(_at_roots(system.uv_on_emitter, modifier, strands, uv_no=layer))
    number = mesh.vertex_colors.find(name or active_color_name(mesh))
    if number < 0:
        return None
    values = np.ones((len(strands), 4), np.float32)
    values[:, :3] = linear(_at_roots(system.mcol_on_emitter, modifier, strands, vcol_no=number))
    return values


def _root_layer(mesh, name):
    """The number of the UV map that an attribute of that name is at roots, None for none."""
    return next((number for number, layer in enumerate(mesh.uv_layers)
                 if layer.name == name or name == UV and layer.active_render), None)


def _object_values(data, uv_names, color_names):
    """(name, (strands or keys, 2 or 4), whether of strands) of each attribute that is asked for. The first of two
    numbers of each strand is the default UV map, as Cycles has it."""
    found = []
    maps = [each for each in data.attributes if each.data_type == 'FLOAT2'] if uv_names else []
    default = getattr(_default_map(data), "name", None)
    for attribute in maps:
        if attribute.name == default or attribute.name in uv_names:
            values = np.empty((len(attribute.data), 2), np.float32)
            attribute.data.foreach_get("vector", values.reshape(-1))
            found.append((attribute.name, values, attribute.domain == 'CURVE'))
    if NORMAL_ATTRIBUTE in color_names and hasattr(data, "normals"):  # not of point clouds
        normals, rows = np.empty((len(data.normals), 3), np.float32), np.ones((len(data.normals), 4), np.float32)
        data.normals.foreach_get("vector", normals.reshape(-1))
        rows[:, :3] = normals
        found.append((NORMAL_ATTRIBUTE, rows, False))
    for name in sorted(shown_by_uv_nodes(uv_names).union(color_names)):
        values = named_colors(name, color_names, lambda each: _colors(data, each),
                              lambda each: each == UV or is_pair(data.attributes, each))
        if values is not None and all(name != known for known, _, _ in found):
            found.append((name, values, len(values) != len(data.points)))  # where both are as many, it is one
    return found


def _colors(data, name):
    """Colours of an attribute of Curves or a Point Cloud, None if it is missing or of an odd type."""
    attribute = data.attributes.get(name) or (_default_map(data) if name == UV else None)
    return None if attribute is None else colors_of(attribute)


def _default_map(data):
    """The attribute that is the default UV map of Curves, None of others."""
    return next((each for each in data.attributes if each.data_type == 'FLOAT2' and each.domain == 'CURVE'), None)


def _at_roots(read, modifier, strands, **layer):
    """What read says of each strand's root. For children, read is given any particle, and their number."""
    particles = modifier.particle_system.particles
    return np.array([read(modifier, particle=particles[number if number < len(particles) else 0],
                          particle_no=number, **layer) for number in strands], np.float32)


def _values(data, name, field, width, default=0.0):
    """(points, width) of an attribute of points."""
    attribute = data.attributes.get(name)
    values = np.full((len(data.points), width), default, np.float32)
    if attribute is not None and len(attribute.data) == len(values):
        attribute.data.foreach_get(field, values.reshape(-1))
    return values


def _hair_radii(settings, strands):
    """Radii of hair, from root to tip by the settings' shape."""
    left = 1.0 - strands.fractions[0].clip(0.0, 1.0)
    shape = settings.shape
    if shape < 0.0:
        left = left ** (1.0 + shape)
    elif shape > 0.0:
        left = left ** (1.0 / max(1.0 - shape, 1e-6))
    root, tip = (radius * settings.radius_scale * 0.5 for radius in (settings.root_radius, settings.tip_radius))
    radii = left * (root - tip) + tip
    if settings.use_close_tip:
        radii[np.cumsum(strands.lengths) - 1] = 0.0  # of keys in the same place the last alone, as in Cycles
    return radii

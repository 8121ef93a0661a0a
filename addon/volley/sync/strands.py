# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and points: particle hair, Curves and Point Cloud objects, which become the solids of ``tubes``."""

import bpy
import numpy as np

from .. import abi
from . import tubes
from .mesh import active_color_name, attribute_colors, wanted_uv_layers

HAIR_ATTRIBUTE = ".hair"  # (intercept, length, thickness, random) of the Hair Info node
DIRECTION_ATTRIBUTE = ".strand"  # (x, y, z) along the strand, unit, and 1

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
    """The hair of one of an object's particle systems, at any time that the depsgraph is moved to. names:
    UV maps and colours that are wanted; a strand has those of its root."""

    def __init__(self, number, depsgraph, is_final, names):
        self._number, self._depsgraph, self._is_final, self._names = number, depsgraph, is_final, names

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
        """It as tubes.Strands, None without a strand."""
        real, modifier = self._find(instance)
        if modifier is None:
            return None
        system = modifier.particle_system
        settings, place = system.settings, system.co_hair
        steps = (1 << (settings.render_step if self._is_final else settings.display_step)) + 1
        if settings.kink == 'SPIRAL':
            steps += settings.kink_extra_steps
        keys = np.array([place(real, particle_no=number, step=step)
                         for number in _shown_strands(system) for step in range(steps)], np.float64)
        if len(keys) == 0:
            return None
        matrix = np.array(real.matrix_world.inverted_safe())  # particles are in the world
        keys = (keys @ matrix[:3, :3].T + matrix[:3, 3]).reshape(-1, steps, 3)
        radii = _hair_radii(settings, keys)
        return tubes.Strands(keys.reshape(-1, 3), radii.reshape(-1), np.full(len(keys), steps))

    def solid(self, instance, strands):
        """The tubes of what was read and their MeshData, None without a face."""
        real, modifier = self._find(instance)
        roots = _root_values(real.data, modifier, _shown_strands(modifier.particle_system), *self._names)
        return _tubes(tubes.Tubes(strands, joins_keys=True), strands, roots, self._names)


class StrandObject:
    """A Curves or Point Cloud object, at any time; names: as Hair's."""

    def __init__(self, names):
        self._names = names

    @staticmethod
    def may_move(_instance):
        """Whether it may go elsewhere than its object goes."""
        return True

    @staticmethod
    def read(instance):
        """It as tubes.Strands."""
        data = instance.object.data
        positions = _values(data, "position", "vector", 3)
        if not isinstance(data, bpy.types.Curves):
            return tubes.Strands(positions, _values(data, "radius", "value", 1, _DEFAULT_POINT_RADIUS)[:, 0])
        lengths = np.empty(len(data.curves), np.int32)
        data.curves.foreach_get("points_length", lengths)
        return tubes.Strands(positions, _values(data, "radius", "value", 1, _DEFAULT_RADIUS)[:, 0], lengths)

    def solid(self, instance, strands):
        """The tubes or balls of what was read and their MeshData, None without a face."""
        values = _object_values(instance.object.data, *self._names)
        if strands.lengths is not None:
            return _tubes(tubes.Tubes(strands), strands, values, self._names)
        if len(strands.positions) == 0:
            return None
        balls = tubes.Balls(strands)
        values = [(name, balls.spread(each)) for name, each, _ in values]
        return balls, tubes.mesh_of(balls, strands, values[:abi.MAX_ATTRIBUTES])


def _has_force(blender_object):
    """Whether an object is a force field, which bends hair."""
    return blender_object.field is not None and blender_object.field.type != 'NONE'


def _shown_strands(system):
    """Numbers of the strands of a system that are seen: its particles come before their children."""
    parent_count, child_count = len(system.particles), len(system.child_particles)
    first = parent_count if child_count and not system.settings.use_parent_particles else 0
    return range(first, parent_count + child_count)


def _tubes(solid, strands, values, names):
    """Tubes and their MeshData with values of strands or their keys as attributes, None without a face."""
    if solid.is_empty:
        return None
    values = [(name, solid.spread(each, of_keys)) for name, each, of_keys in values]
    own = [(name, tell(strands)) for name, tell in (
        (HAIR_ATTRIBUTE, solid.info), (DIRECTION_ATTRIBUTE, solid.directions)) if name in names[1]]
    return solid, tubes.mesh_of(solid, strands, values[:abi.MAX_ATTRIBUTES - len(own)] + own)


def _root_values(mesh, modifier, strands, uv_names, color_names):
    """(name, (strands, 2 or 4), False) of each UV map and colour attribute that is asked for, as meshes have
    them: the default map first."""
    found = []
    for number, layer in wanted_uv_layers(mesh, uv_names):
        values = _at_roots(modifier.particle_system.uv_on_emitter, modifier, strands, uv_no=number)
        found.append((layer.name, values, False))
    colors = mesh.vertex_colors
    for name in sorted(color_names):
        source = name or active_color_name(mesh)
        number = colors.find(source)
        if number >= 0:
            values = np.ones((len(strands), 4), np.float32)
            values[:, :3] = _linear(_at_roots(modifier.particle_system.mcol_on_emitter, modifier, strands,
                                              vcol_no=number))
            found.append((name, values, False))
    return found


def _object_values(data, uv_names, color_names):
    """(name, (strands or keys, 2 or 4), whether of keys) of each attribute that is asked for. The first
    of two numbers is the default UV map, as Cycles has it."""
    found = []
    maps = [each for each in data.attributes if each.data_type == 'FLOAT2'] if uv_names else []
    for number, attribute in enumerate(maps):
        if number == 0 or attribute.name in uv_names:
            values = np.empty((len(attribute.data), 2), np.float32)
            attribute.data.foreach_get("vector", values.reshape(-1))
            found.append((attribute.name, values, attribute.domain == 'POINT'))
    for name in sorted(color_names):
        attribute = data.attributes.get(name)
        values = None if attribute is None else attribute_colors(attribute)
        if values is not None and all(name != known for known, _, _ in found):
            found.append((name, values, attribute.domain == 'POINT'))
    return found


def _linear(values):
    """sRGB-encoded colours, which is how Blender tells those of roots, as scene-linear ones."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


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


def _hair_radii(settings, keys):
    """Radii of hair, from root to tip by the settings' shape."""
    left = 1.0 - tubes.fractions(keys)[0].clip(0.0, 1.0)
    is_tip = left <= 0.0
    shape = settings.shape
    if shape < 0.0:
        left = left ** (1.0 + shape)
    elif shape > 0.0:
        left = left ** (1.0 / max(1.0 - shape, 1e-6))
    root, tip = (radius * settings.radius_scale * 0.5 for radius in (settings.root_radius, settings.tip_radius))
    radii = left * (root - tip) + tip
    if settings.use_close_tip:
        radii[is_tip] = 0.0
    return radii



# SPDX-License-Identifier: GPL-3.0-or-later
"""The Sky Texture with light scattered more than once, Blender's default since 5.0: tables for
``sky_texture.py``.

Source: F. Garcia Linan, "Physically Based Rendering of the Sky" (master's thesis, 2022; "Spectral Sky",
2024): four wavelengths stand for the spectrum, light scattered once is integrated along the ray, and a fit
to path-traced skies stands for light scattered more often. Its matter and its fits are of the Earth.

Directions have Z up, angles are in radians, lengths in km, colours scene-linear Rec. 709.
"""

import functools
import math

import numpy as np

from .sky import XYZ_TO_RGB

# By wavelength: 630, 560, 490, 430 nm.
_SUN = np.array((1.679, 1.828, 1.986, 1.307))  # irradiance, W/(m^2 nm)
_TO_XYZ = np.array((
    (53.386917738564668, 22.981337506691025, 0.0),
    (43.904844466369358, 71.347795700053394, 0.10250686796574131),
    (1.6137278251608962, 18.422960591455485, 31.742921188390806),
    (20.762668673810577, 2.3614213523314369, 110.48009643252140)))
_AIR_SCATTERING = np.array((6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2))  # at sea level, 1/km
_OZONE_ABSORPTION = np.array((3.472e-25, 3.914e-25, 1.349e-25, 11.03e-27))  # of a molecule
_AEROSOL_ABSORPTION = np.array((2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23))  # of a particle of
_AEROSOL_SCATTERING = np.array((1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22))  # a city's air

_EARTH_RADIUS, _THICKNESS = 6371.0, 100.0
_ATMOSPHERE_RADIUS = _EARTH_RADIUS + _THICKNESS
_GROUND_ALBEDO = 0.3
_OZONE_DOBSON = 334.5  # mean over the year
_AEROSOL_DENSITY, _AEROSOL_BACKGROUND = 1.3681e20, 2e6
_AEROSOL_SCALE_HEIGHT = 0.73
_AEROSOL_ANISOTROPY = 0.8

# The fit of what comes from scattering beyond the first: its size by wavelength, and how it fades as the
# sun sets.
_MULTIPLE = 0.02 * np.array((0.217, 0.347, 0.594, 1.0))
_MULTIPLE_FADE, _MULTIPLE_SLOPE = 5.0, 17.92

# The table: azimuths all around, elevations from the nadir to the zenith, denser towards the horizon.
TABLE_WIDTH, TABLE_HEIGHT = 512, 256
_VIEW_STEPS = 64

# A table of transmittances to the end of the atmosphere: cosines to the zenith from -1 to 1, heights from
# the ground to the end. What it gets wrong between its entries is in Cycles' skies too.
_COSINES, _HEIGHTS = 256, 64
_LIGHT_STEPS = 64


def _collisions(height, amounts):
    """Scattering by air and by aerosols and extinction (..., 4) at heights (...), 1/km. amounts: of air,
    aerosols and ozone, 1 for the Earth's."""
    air, aerosols, ozone = amounts
    log_height = np.log(np.maximum(height, 1e-4))
    ozone = ozone * 3.78547397e20 * np.exp(-5.55555555 * (log_height - 3.22261) ** 2 - log_height)
    aerosols = aerosols * (_AEROSOL_DENSITY * np.exp(-height / _AEROSOL_SCALE_HEIGHT) + _AEROSOL_BACKGROUND)
    air = air * np.exp(-0.07771971 * height ** 1.16364243)
    by_air, by_aerosols = air[..., None] * _AIR_SCATTERING, aerosols[..., None] * _AEROSOL_SCATTERING
    absorbed = (aerosols[..., None] * _AEROSOL_ABSORPTION +
                ozone[..., None] * _OZONE_DOBSON * _OZONE_ABSORPTION)
    return by_air, by_aerosols, by_air + by_aerosols + absorbed


def _way_out(radius, cosine):
    """Length from a distance to the Earth's centre to the end of the atmosphere, along rays of that cosine
    to the zenith."""
    across = radius * radius * (1.0 - cosine * cosine)
    return np.sqrt(np.maximum(_ATMOSPHERE_RADIUS ** 2 - across, 0.0)) - radius * cosine


def _transmittance(radius, cosine, amounts):
    """By wavelength (..., 4), on the way out of the atmosphere; the Earth is not in the way."""
    radius, cosine = np.broadcast_arrays(np.asarray(radius, np.float64), cosine)
    step = _way_out(radius, cosine) / _LIGHT_STEPS
    depth = np.zeros(radius.shape + (4,))
    for number in range(_LIGHT_STEPS):
        along = (number + 0.5) * step
        at = np.sqrt(radius * radius + along * (along + 2.0 * radius * cosine))
        depth += _collisions(np.maximum(at - _EARTH_RADIUS, 0.0), amounts)[2] * step[..., None]
    return np.exp(-depth)


@functools.lru_cache(maxsize=4)
def _transmittance_table(amounts):
    """Transmittances (_HEIGHTS, _COSINES, 4) as float32."""
    radius = _EARTH_RADIUS + _THICKNESS * np.linspace(0.0, 1.0, _HEIGHTS)
    return _transmittance(radius[:, None], np.linspace(-1.0, 1.0, _COSINES), amounts).astype(np.float32)


def _between(count, unit):
    """Numbers of the entry before and the one after places in [0, 1], and the part of the latter, for four
    wavelengths."""
    place = np.clip(unit, 0.0, 1.0) * (count - 1)
    before = place.astype(np.int32)
    return before, np.minimum(before + 1, count - 1), (place - before).astype(np.float32)[..., None]


def _mix(before, after, part):
    return before + (after - before) * part


@functools.lru_cache(maxsize=8)  # a viewport goes back and forth between few
def table(sun_elevation, altitude, amounts):
    """Radiance (TABLE_HEIGHT, TABLE_WIDTH, 3) float32 without the sun itself; it may be negative where a
    colour is out of gamut. Entry (y, x) is of the azimuth 2 pi (x + 1/2) / TABLE_WIDTH from the one
    opposite the sun and of the elevation pi/2 l |l|, l = 2 (y + 1/2) / TABLE_HEIGHT - 1. altitude: m;
    amounts of air, aerosols and ozone: 1 for the Earth's."""
    light = _transmittance_table(amounts)
    start = _EARTH_RADIUS + 1e-3 * altitude
    line = 2.0 * (np.arange(TABLE_HEIGHT) + 0.5) / TABLE_HEIGHT - 1.0
    elevation = 0.5 * math.pi * line * np.abs(line)
    azimuth = 2.0 * math.pi * (np.arange(TABLE_WIDTH // 2) + 0.5) / TABLE_WIDTH
    up = np.sin(elevation)
    to_sun = (up[:, None] * math.sin(sun_elevation) -
              np.cos(elevation)[:, None] * np.cos(azimuth) * math.cos(sun_elevation)).astype(np.float32)
    air_phase, aerosol_phase = (phase[..., None] for phase in _phases(to_sun))
    step = _way_to_end(start, up) / _VIEW_STEPS
    spectrum = np.zeros(to_sun.shape + (4,), np.float32)
    passed = np.ones((TABLE_HEIGHT, 1, 4))
    for number in range(_VIEW_STEPS):
        along = (number + 0.5) * step
        radius = np.sqrt(start * start + along * (along + 2.0 * start * up))
        height = np.maximum(radius - _EARTH_RADIUS, 0.0)
        cosine = ((start * math.sin(sun_elevation) + along[:, None] * to_sun) / radius[:, None])
        by_air, by_aerosols, extinction = (c[:, None] for c in _collisions(height, amounts))
        left = np.exp(-extinction * step[:, None, None])
        # The step's integral: exact where its matter and its light are even.
        weight = passed * (1.0 - left) / np.maximum(extinction, 1e-7)
        by_air, by_aerosols = ((weight * c).astype(np.float32) for c in (by_air, by_aerosols))
        direct, more = _light(light, height, radius, cosine.astype(np.float32))
        spectrum += direct * (by_air * air_phase + by_aerosols * aerosol_phase) + more * (by_air + by_aerosols)
        passed = passed * left
    half = _color_of(spectrum)
    return np.concatenate((half, half[:, ::-1]), axis=1).astype(np.float32)


def _way_to_end(start, up):
    """Length of rays from a distance to the Earth's centre to the ground or out of the atmosphere."""
    below = start * start * up * up - (start * start - _EARTH_RADIUS ** 2)
    to_ground = -start * up - np.sqrt(np.maximum(below, 0.0))
    return np.where((below >= 0.0) & (up < 0.0), to_ground, _way_out(start, up))


def _phases(cosine):
    """Rayleigh's, and Henyey and Greenstein's phase functions of air and aerosols."""
    g = _AEROSOL_ANISOTROPY
    aerosols = (1.0 - g * g) / (4.0 * math.pi) / (1.0 + g * g - 2.0 * g * cosine) ** 1.5
    return 3.0 / (16.0 * math.pi) * (1.0 + cosine * cosine), aerosols


def _light(light, height, radius, cosine):
    """What reaches places of rows at a height (rows,) straight from the sun, and in the mean from all
    around: (rows, columns, 4) for cosines (rows, columns) between zenith and sun."""
    below, above, part = _between(_HEIGHTS, height / _THICKNESS)
    rows = _mix(light[below], light[above], part[..., None]).astype(np.float32)  # cosines at each height
    before, after, part = _between(_COSINES, 0.5 * cosine + 0.5)
    numbers = np.arange(len(height))[:, None]
    direct = _mix(rows[numbers, before], rows[numbers, after], part)
    # Once more from the ground, straight above which the place is taken to be.
    seen = 0.5 * (1.0 - np.sqrt(np.maximum(1.0 - (_EARTH_RADIUS / radius) ** 2, 0.0)))  # of all directions
    to_place = light[0, -1] / rows[:, -1] * (seen * _GROUND_ALBEDO / math.pi)[:, None]
    ground = _mix(light[0, before], light[0, after], part) * cosine[..., None]
    fade = 1.0 / (1.0 + _MULTIPLE_FADE * np.exp(-_MULTIPLE_SLOPE * cosine))
    return direct, (ground * to_place[:, None].astype(np.float32) +
                    fade[..., None] * _MULTIPLE.astype(np.float32))


def _color_of(spectrum):
    """Light of the sun that is left, by wavelength, as a colour."""
    return (spectrum * _SUN.astype(spectrum.dtype)) @ (_TO_XYZ @ XYZ_TO_RGB.T)


def sun_colors(sun_elevation, angle, altitude, amounts):
    """Radiance of the lowest and of the highest point of the sun's disc, without limb darkening. angle: its
    diameter."""
    solid_angle = 4.0 * math.pi * math.sin(0.25 * angle) ** 2
    cosines = np.sin(np.array((sun_elevation - 0.5 * angle, sun_elevation + 0.5 * angle)))
    return _color_of(_transmittance(_EARTH_RADIUS + 1e-3 * altitude, cosines, amounts)) / solid_angle


def horizon(altitude):
    """Elevation of the horizon, seen from that many metres."""
    return math.asin(_EARTH_RADIUS / (_EARTH_RADIUS + 1e-3 * altitude)) - 0.5 * math.pi

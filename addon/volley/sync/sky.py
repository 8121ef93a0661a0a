# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies: the Sky Texture's models as tables and coefficients; ``sky_texture.py`` makes nodes of them.

Sources: T. Nishita, T. Sirai, K. Tadamura, E. Nakamae, "Display of the Earth Taking into Account
Atmospheric Scattering" (1993): single scattering in a spherical atmosphere, with ozone; A. J. Preetham,
P. Shirley, B. Smits, "A Practical Analytic Model for Daylight" (1999); L. Hosek, A. Wilkie, "An Analytic
Model for Full Spectral Sky-Dome Radiance" (2012).

Directions have Z up, angles are in radians, colours scene-linear Rec. 709.
"""

import functools
import math

import numpy as np

_WAVELENGTHS = np.linspace(380e-9, 780e-9, 21)  # m

# CIE 1931 colour matching functions at these wavelengths: X, Y, Z.
_OBSERVER = np.array((
    (0.001368, 0.000039, 0.006450), (0.014310, 0.000396, 0.067850), (0.134380, 0.004000, 0.645600),
    (0.348280, 0.023000, 1.747060), (0.290800, 0.060000, 1.669200), (0.095640, 0.139020, 0.812950),
    (0.004900, 0.323000, 0.272000), (0.063270, 0.710000, 0.078250), (0.290400, 0.954000, 0.020300),
    (0.594500, 0.995000, 0.003900), (0.916300, 0.870000, 0.001650), (1.062200, 0.631000, 0.000800),
    (0.854450, 0.381000, 0.000190), (0.447900, 0.175000, 0.000020), (0.164900, 0.061000, 0.0),
    (0.046770, 0.017000, 0.0), (0.011359, 0.004102, 0.0), (0.002899, 0.001047, 0.0),
    (0.000690, 0.000249, 0.0), (0.000166, 0.000060, 0.0), (0.000042, 0.000015, 0.0)))

XYZ_TO_RGB = np.array(((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560),
                        (0.0556434, -0.2040259, 1.0572252)))

# The atmosphere: lengths in m, coefficients in 1/m.
_EARTH_RADIUS, _ATMOSPHERE_RADIUS = 6360e3, 6420e3
_AIR_SCALE_HEIGHT, _DUST_SCALE_HEIGHT = 8e3, 1.2e3
_DUST_SCATTERING, _DUST_EXTINCTION = 2e-5, 1.11 * 2e-5
_DUST_ANISOTROPY = 0.76
_OZONE_LOWEST, _OZONE_PEAK, _OZONE_HIGHEST = 10e3, 25e3, 40e3  # the ends of a triangle of densities

# Rayleigh scattering of air at sea level: refractive index and molecules per m^3 at 20 degrees Celsius.
_AIR_INDEX, _AIR_MOLECULES = 1.0002926, 2.504e25
_AIR_SCATTERING = (8.0 * math.pi ** 3 * (_AIR_INDEX ** 2 - 1.0) ** 2 /
                   (3.0 * _AIR_MOLECULES * _WAVELENGTHS ** 4))

# Absorption of ozone where it is densest (V. Gorshelev, A. Serdyuchenko et al., "High spectral resolution
# ozone absorption cross-sections", 2014), 1e-9/m.
_OZONE_ABSORPTION = 1e-9 * np.array((
    3.251, 5.854, 19.77, 73.10, 200.8, 403.8, 635.5, 967.1, 1548.0, 2090.4, 2461.3, 2735.5, 2151.3,
    1590.5, 1123.6, 735.28, 464.50, 330.96, 225.13, 148.79, 168.29))

# The sun: a black body seen from the Earth.
_SUN_TEMPERATURE, _SUN_RADIUS, _SUN_DISTANCE = 5778.0, 6.955e8, 1.496e11  # K, m, m


def _black_body(temperature):
    """Spectral radiance at the wavelengths, W/(m^2 sr m)."""
    planck, light_speed, boltzmann = 6.62607015e-34, 299792458.0, 1.380649e-23
    exponent = planck * light_speed / (_WAVELENGTHS * boltzmann * temperature)
    return 2.0 * planck * light_speed ** 2 / _WAVELENGTHS ** 5 / np.expm1(exponent)


_IRRADIANCE = math.pi * _black_body(_SUN_TEMPERATURE) * (_SUN_RADIUS / _SUN_DISTANCE) ** 2

# The table: azimuths all around, elevations denser towards the horizon. As in Cycles, a cell's value is
# that of its lower edges.
TABLE_WIDTH, TABLE_HEIGHT = 512, 128
_VIEW_STEPS = 32

# Places along a way out of the atmosphere, as parts of it, and their weights: Gauss-Laguerre, whose range
# ends at 25 of its scale, so that places are densest where the matter is. As Cycles has it: at a low sun
# the places show.
_LIGHT_SCALES = 25.0
_LIGHT_NODES, _LIGHT_WEIGHTS = np.polynomial.laguerre.laggauss(8)
_LIGHT_WEIGHTS = _LIGHT_WEIGHTS * np.exp(_LIGHT_NODES) / _LIGHT_SCALES
_LIGHT_NODES = _LIGHT_NODES / _LIGHT_SCALES


def _densities(height):
    """Air, dust and ozone at a height over the ground, relative to where each is densest."""
    up = (height - _OZONE_LOWEST) / (_OZONE_PEAK - _OZONE_LOWEST)
    down = (_OZONE_HIGHEST - height) / (_OZONE_HIGHEST - _OZONE_PEAK)
    return (np.exp(-height / _AIR_SCALE_HEIGHT), np.exp(-height / _DUST_SCALE_HEIGHT),
            np.clip(np.minimum(up, down), 0.0, 1.0))


def _way_out(radius, cosine):
    """Length from a distance to the Earth's centre to the end of the atmosphere, along rays of that cosine
    to the vertical."""
    across = radius * radius * (1.0 - cosine * cosine)
    return np.sqrt(_ATMOSPHERE_RADIUS ** 2 - across) - radius * cosine


def _depths(radius, cosine):
    """Columns of air, dust and ozone (m of the densest) on the way out of the atmosphere."""
    length = _way_out(radius, cosine)
    columns = [0.0, 0.0, 0.0]
    for node, weight in zip(_LIGHT_NODES, _LIGHT_WEIGHTS):
        along = length * node
        height = np.sqrt(radius * radius + along * (along + 2.0 * radius * cosine)) - _EARTH_RADIUS
        for i, density in enumerate(_densities(np.maximum(height, 0.0))):
            columns[i] = columns[i] + weight * length * density
    return columns


def _optical_depth(columns, amounts, wavelength):
    """Of columns at one wavelength, by its number; amounts of air, dust and ozone."""
    air, dust, ozone = (column * amount for column, amount in zip(columns, amounts))
    return (_AIR_SCATTERING[wavelength] * air + _DUST_EXTINCTION * dust +
            _OZONE_ABSORPTION[wavelength] * ozone)


def _phases(cosine):
    """Rayleigh's and Cornette and Shanks' phase functions of air and dust."""
    square, g = 1.0 + cosine * cosine, _DUST_ANISOTROPY
    dust = (3.0 * (1.0 - g * g) / (8.0 * math.pi * (2.0 + g * g)) * square /
            (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
    return 3.0 / (16.0 * math.pi) * square, dust


@functools.lru_cache(maxsize=8)  # a viewport goes back and forth between few
def nishita_table(sun_elevation, altitude, amounts, ends_at_zenith=False):
    """Radiance (TABLE_HEIGHT, TABLE_WIDTH, 3) float32 without the sun itself, W/(m^2 sr); it may be
    negative where a colour is out of gamut. Row y is of the elevation pi/2 (y / TABLE_HEIGHT)^2, column x
    of the azimuth 2 pi x / TABLE_WIDTH from the one opposite the sun. altitude: m; amounts of air, dust
    and ozone: 1 for the Earth's; ends_at_zenith: as in Cycles since 5.0."""
    rows = np.arange(TABLE_HEIGHT, dtype=np.float32) / TABLE_HEIGHT
    # Otherwise Cycles' rows end half a step beyond the zenith.
    top = 0.5 * math.pi * (1.0 if ends_at_zenith else 1.0 + 0.5 / TABLE_HEIGHT)
    elevation = top * rows * rows
    azimuth = 2.0 * math.pi * (0.5 - np.arange(TABLE_WIDTH // 2, dtype=np.float32) / TABLE_WIDTH)
    up, ahead = np.sin(elevation), np.cos(elevation)
    to_sun = (ahead[:, None] * (np.cos(azimuth) * math.cos(sun_elevation)) +
              up[:, None] * math.sin(sun_elevation))
    air_phase, dust_phase = _phases(to_sun)
    start = _EARTH_RADIUS + altitude
    step = _way_out(start, up.astype(np.float64)) / _VIEW_STEPS
    passed = [np.zeros((TABLE_HEIGHT, 1)) for _ in range(3)]
    spectrum = np.zeros((len(_WAVELENGTHS),) + to_sun.shape, np.float32)
    for number in range(_VIEW_STEPS):
        along = (number + 0.5) * step
        radius = np.sqrt(start * start + along * (along + 2.0 * start * up))[:, None]
        densities = _densities(np.maximum(radius - _EARTH_RADIUS, 0.0))
        for i, density in enumerate(densities):
            passed[i] = passed[i] + density * step[:, None]
        sun_cosine = (start * math.sin(sun_elevation) + along[:, None] * to_sun) / radius
        is_lit = (sun_cosine > 0.0) | (radius * np.sqrt(1.0 - sun_cosine ** 2) > _EARTH_RADIUS)
        if not is_lit.any():
            continue
        columns = [(a + b).astype(np.float32) for a, b in zip(passed, _depths(radius, sun_cosine))]
        air = (is_lit * densities[0] * step[:, None] * amounts[0] * air_phase).astype(np.float32)
        dust = (is_lit * densities[1] * step[:, None] * amounts[1] * dust_phase).astype(np.float32)
        for wavelength, scattering in enumerate(_AIR_SCATTERING):
            depth = _optical_depth(columns, amounts, wavelength)
            spectrum[wavelength] += np.exp(-depth) * (np.float32(scattering) * air +
                                                      np.float32(_DUST_SCATTERING) * dust)
    half = _color_of(np.moveaxis(spectrum, 0, -1) * _IRRADIANCE.astype(np.float32))
    return np.concatenate((half, half[:, ::-1]), axis=1).astype(np.float32)


def _color_of(spectrum):
    """A spectrum (..., wavelengths) as a colour."""
    xyz = spectrum @ (_OBSERVER * (_WAVELENGTHS[1] - _WAVELENGTHS[0]))
    return xyz @ XYZ_TO_RGB.T


def sun_colors(sun_elevation, angle, altitude, amounts):
    """Radiance of the lowest and of the highest point of the sun's disc, without limb darkening; as in
    Cycles, ozone does not dim it. angle: its diameter."""
    radius = np.float64(_EARTH_RADIUS + altitude)
    solid_angle = 4.0 * math.pi * math.sin(0.25 * angle) ** 2
    colors = []
    for elevation in (sun_elevation - 0.5 * angle, sun_elevation + 0.5 * angle):
        columns = _depths(radius, math.sin(max(elevation, 0.0)))
        depth = _AIR_SCATTERING * columns[0] * amounts[0] + _DUST_EXTINCTION * columns[1] * amounts[1]
        colors.append(_color_of(_IRRADIANCE / solid_angle * np.exp(-depth)))
    return colors


# Preetham, Shirley and Smits: the five coefficients of Perez' formula for x, y and Y, as a line over
# turbidity, and chromaticity of the zenith, as polynomials of the sun's angle to it (columns, highest
# power first) and of turbidity (rows).
_PEREZ = {
    'x': ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    'y': ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
    'Y': ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703))}
_ZENITH = {
    'x': ((0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394),
          (0.11693, -0.21196, 0.06052, 0.25886)),
    'y': ((0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516),
          (0.15346, -0.26756, 0.06670, 0.26688))}
_LUMINANCE_SCALE = 0.06  # of Cycles, from kcd/m^2


def preetham(sun_angle, turbidity):
    """The sky's zenith (x, y, Y) over Perez' formula there, and the formula's coefficients A to E, each of
    x, y and Y: (3,), (5, 3). sun_angle: from the zenith."""
    coefficients = np.array([[a * turbidity + b for a, b in _PEREZ[name]] for name in 'xyY']).T
    zenith = [np.polyval([np.polyval(row, sun_angle) for row in _ZENITH[name]], turbidity)
              for name in 'xy']
    chi = (4.0 / 9.0 - turbidity / 120.0) * (math.pi - 2.0 * sun_angle)
    zenith.append(_LUMINANCE_SCALE * ((4.0453 * turbidity - 4.9710) * math.tan(chi)
                                      - 0.2155 * turbidity + 2.4192))
    a, b, c, d, e = coefficients
    at_zenith = (1.0 + a * np.exp(b)) * (1.0 + c * np.exp(d * sun_angle) + e * math.cos(sun_angle) ** 2)
    return np.array(zenith) / at_zenith, coefficients


def hosek_wilkie(elevation, turbidity, albedo):
    """The coefficients of the formula in the order of ``sky_hosek_wilkie.py`` and the radiance, each of X, Y and Z:
    (10, 3). elevation: the sun's, not below the horizon."""
    from .sky_hosek_wilkie import CURVES  # some thousand numbers that few files need
    place = min(max(turbidity, 1.0), float(len(CURVES))) - 1.0
    low = min(int(place), len(CURVES) - 2)
    ground = CURVES[low] + (place - low) * (CURVES[low + 1] - CURVES[low])
    points = ground[0] + albedo * (ground[1] - ground[0])
    x = (elevation / (0.5 * math.pi)) ** (1.0 / 3.0)
    degree = points.shape[-1] - 1
    weights = [math.comb(degree, k) * x ** k * (1.0 - x) ** (degree - k) for k in range(degree + 1)]
    return (points @ weights).T

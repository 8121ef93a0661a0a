# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramic cameras and spherical stereo: Blender's settings as fields of trc_camera_desc."""

import math

from .. import abi
from ..compat import panorama_setting

_TYPES = {
    'EQUIRECTANGULAR': abi.CameraType.EQUIRECTANGULAR,
    'EQUIANGULAR_CUBEMAP_FACE': abi.CameraType.CUBE_MAP_FACE,
    'MIRRORBALL': abi.CameraType.MIRROR_BALL,
    'FISHEYE_EQUIDISTANT': abi.CameraType.FISHEYE_EQUIDISTANT,
    'FISHEYE_EQUISOLID': abi.CameraType.FISHEYE_EQUISOLID,
    'FISHEYE_LENS_POLYNOMIAL': abi.CameraType.FISHEYE_POLYNOMIAL,
    'CENTRAL_CYLINDRICAL': abi.CameraType.CYLINDRICAL,
}

# Names and defaults of the settings, which are Cycles' where Blender has none itself.
_LONGITUDES = (("longitude_min", -math.pi), ("longitude_max", math.pi))
_LATITUDES = (("latitude_min", -0.5 * math.pi), ("latitude_max", 0.5 * math.pi))
_POLYNOMIAL = (-1.1735143712967577e-05, -0.019988736953434998, -3.3525322965709175e-06,
               3.099275275886036e-06, -2.6064646454854524e-08)


def fields(data, warnings):
    """What a camera of Blender's type PANO adds to trc_camera_desc, without the sensor; a tuple of pairs,
    empty for a projection that is not supported."""
    name = panorama_setting(data, "panorama_type", 'FISHEYE_EQUISOLID')
    if name not in _TYPES:
        warnings.add(f"Camera '{data.name}': panorama {name} is not supported, perspective is used")
        return ()
    found = {"type": _TYPES[name], "fisheye_angle": panorama_setting(data, "fisheye_fov", math.pi)}
    if name == 'EQUIRECTANGULAR':
        found.update((key, panorama_setting(data, key, default))
                     for key, default in _LONGITUDES + _LATITUDES)
    elif name == 'CENTRAL_CYLINDRICAL':
        found.update(_cylinder(data))
    elif name == 'FISHEYE_EQUISOLID':
        found["fisheye_lens"] = panorama_setting(data, "fisheye_lens", 10.5)
    elif name == 'FISHEYE_LENS_POLYNOMIAL':
        found["fisheye_polynomial"] = tuple(
            panorama_setting(data, f"fisheye_polynomial_k{power}", default)
            for power, default in enumerate(_POLYNOMIAL))
    return tuple(found.items())


def _cylinder(data):
    """The part of a cylinder that is seen; the library's has radius 1."""
    def setting(name, default):
        return panorama_setting(data, f"central_cylindrical_{name}", default)

    radius = max(setting("radius", 1.0), 1e-6)
    return {"longitude_min": setting("range_u_min", -math.pi),
            "longitude_max": setting("range_u_max", math.pi),
            "height_min": setting("range_v_min", -1.0) / radius,
            "height_max": setting("range_v_max", 1.0) / radius}


def stereo_fields(data, view_name):
    """What spherical stereo adds to trc_camera_desc for a view; no eye for one but 'left' and 'right'."""
    stereo = data.stereo
    side = {"left": -0.5, "right": 0.5}.get(view_name, 0.0)
    found = {"eye_offset": side * stereo.interocular_distance,
             "convergence_distance": math.inf if stereo.convergence_mode == 'PARALLEL'
             else max(stereo.convergence_distance, 1e-5)}
    if stereo.use_pole_merge:
        found["pole_merge_from"] = stereo.pole_merge_angle_from
        found["pole_merge_to"] = stereo.pole_merge_angle_to
    return tuple(found.items())

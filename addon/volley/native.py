# SPDX-License-Identifier: GPL-3.0-or-later
"""libtracer from Python: the one module that knows ctypes.

``load()`` opens the shared library beside this package (``lib/``), compares the ABI version and the
size of every descriptor, and keeps the reason when something does not fit (``load_error()``).
:class:`Scene` and :class:`Render` own a handle each; arrays come and go as numpy arrays; a failed call
raises :class:`TracerError` with the library's own message. Units and conventions are those of the
library's headers (metres, radians, column vectors, 3x4 row-major transforms).

``CDLL`` releases Python's lock during every call, so other threads run while the library builds.
"""

import ctypes
import functools
import os
import sys

import numpy as np

ABI_VERSION = 2

# Limits and enumerators of the headers ---------------------------------------------------------

MAX_KEYS = 33
MAX_ATTRIBUTES = 8
MAX_NODES = 4096
UNLIMITED_DEPTH = 0xFFFFFFFF

OK = 0
ERROR_INVALID_ARGUMENT = 1
ERROR_TOO_LARGE = 4
ERROR_OUT_OF_MEMORY = 5
ERROR_CANCELLED = 8
ERROR_UNSUPPORTED = 9
ERROR_IMAGE = 10
ERROR_FORMAT = 11
STATUS_NAMES = (
    "ok", "invalid argument", "invalid handle", "wrong structure size", "too large", "out of memory",
    "no thread", "scene not committed", "cancelled", "not supported by this build", "unreadable image",
    "unknown image format")

NORMALS_NONE, NORMALS_VERTEX, NORMALS_CORNER = 0, 1, 2

VISIBLE_CAMERA, VISIBLE_DIFFUSE, VISIBLE_GLOSSY, VISIBLE_TRANSMISSION, VISIBLE_SHADOW = 1, 2, 4, 8, 16
VISIBLE_ALL = 31
INSTANCE_SHADOW_CATCHER = 1

CAMERA_PERSPECTIVE, CAMERA_ORTHOGRAPHIC = 0, 1

LIGHT_TYPES = {'POINT': 0, 'SPOT': 1, 'SUN': 2, 'AREA': 3}
AREA_RECTANGLE, AREA_ELLIPSE = 0, 1
LIGHT_SPHERE, LIGHT_EVEN_CONE, LIGHT_SYNTHETIC = 1, 2, 4

INTEGRATORS = {'RAYCAST': 0, 'WHITTED': 1, 'DISTRIBUTION': 2}
SAMPLERS = {'SOBOL': 0, 'SUDOKU': 1, 'JITTER': 2, 'INDEPENDENT': 3, 'BLUE_NOISE': 4}
ASSEMBLIES = {'AUTO': 0, 'TYPES': 1, 'RUNS': 2, 'GROUPS': 3, 'OCTANTS': 4, 'BLIND': 5, 'NONE': 6}
FILTERS = {'BOX': 0, 'GAUSSIAN': 1, 'BLACKMAN_HARRIS': 2}

AO_METHODS = {'ADD': 0, 'REPLACE': 1}

PASS_COMBINED = 0

ALPHA_STRAIGHT, ALPHA_PREMULTIPLIED, ALPHA_CHANNEL_PACKED, ALPHA_NONE = 0, 1, 2, 3

MATERIAL_SAMPLE_EMISSION = 1
MATERIAL_TRANSPARENT_SHADOW = 2
MATERIAL_PLAIN_CHOICE = 4

STATE_RUNNING, STATE_DONE, STATE_CANCELLED, STATE_FAILED = 0, 1, 2, 3

FEATURE_NAMES = (
    "depth of field", "camera motion", "object motion", "deformation", "instances", "specular", "glossy",
    "refraction", "transparency", "textures", "node programs", "lights", "area lights",
    "emissive meshes", "environment", "environment image", "ray visibility", "ambient occlusion",
    "shadow catchers")

# Descriptors -----------------------------------------------------------------------------------
# A pointer is declared as c_void_p: numpy gives addresses as integers, and what the library reads is
# copied before the call returns.

_u32, _i32, _u64, _f32, _f64 = (ctypes.c_uint32, ctypes.c_int32, ctypes.c_uint64, ctypes.c_float,
                                ctypes.c_double)
_ptr, _str = ctypes.c_void_p, ctypes.c_char_p


class _Struct(ctypes.Structure):
    """A descriptor whose first field, struct_size, fills itself in."""

    def __init__(self, **values):
        super().__init__(**values)
        if self._fields_[0][0] == "struct_size":
            self.struct_size = ctypes.sizeof(self)


class _CornerAttribute(_Struct):
    _fields_ = [("struct_size", _u32), ("width", _u32), ("name", _str), ("values", _ptr),
                ("value_count", _u64)]


class _MeshDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("key_count", _u32), ("vertex_count", _u64),
                ("triangle_count", _u64), ("positions", _ptr), ("position_count", _u64),
                ("indices", _ptr), ("index_count", _u64), ("normals", _ptr), ("normal_count", _u64),
                ("normal_kind", _u32), ("attribute_count", _u32), ("smooth", _ptr),
                ("material_index", _ptr), ("attributes", _ptr), ("generated", _ptr),
                ("generated_count", _u64)]


class _InstanceDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("key_count", _u32), ("mesh", _u64), ("transforms", _ptr),
                ("materials", _ptr), ("material_count", _u32), ("visibility", _u32),
                ("pass_index", _i32), ("random", _f32), ("color", _f32 * 4),
                ("cryptomatte_object", _f32), ("cryptomatte_asset", _f32), ("light_group", _u32),
                ("flags", _u32), ("reserved", _u32), ("value_count", _u32), ("values", _ptr)]


class _LightDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("type", _u32), ("transform", _f32 * 12), ("color", _f32 * 3),
                ("strength", _f32), ("radius", _f32), ("angle", _f32), ("size_x", _f32),
                ("size_y", _f32), ("area_shape", _u32), ("spread", _f32), ("spot_angle", _f32),
                ("spot_blend", _f32), ("visibility", _u32), ("cast_shadow", _u32), ("use_mis", _u32),
                ("light_group", _u32), ("flags", _u32)]


class _WorldDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("use_sampling", _u32), ("material", _u64),
                ("visibility", _u32), ("map_resolution", _u32), ("ao_distance", _f32),
                ("ao_factor", _f32), ("ao_method", _u32), ("light_group", _u32),
                ("sun_direction", _f32 * 3), ("sun_angle", _f32)]


class _CameraDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("type", _u32), ("key_count", _u32), ("blade_count", _u32),
                ("transforms", _ptr), ("windows", _ptr), ("window_key_count", _u32),
                ("clip_start", _f32), ("clip_end", _f32), ("aperture_radius", _f32),
                ("focus_distance", _f32), ("blade_rotation", _f32), ("aperture_ratio", _f32),
                ("shutter_time", _f32), ("shutter_curve_count", _u32), ("shutter_curve", _ptr)]


class _NodeInput(_Struct):
    _fields_ = [("node", _i32), ("output", _u32), ("value", _f32 * 3)]


class _Node(_Struct):
    _fields_ = [("type", _u32), ("mode", _u32), ("first_input", _u32), ("input_count", _u32),
                ("image", _u64), ("name", _str), ("table", _ptr), ("table_count", _u64)]


class _MaterialDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("node_count", _u32), ("nodes", _ptr), ("inputs", _ptr),
                ("input_count", _u32), ("surface", _i32), ("pass_index", _i32), ("flags", _u32),
                ("cryptomatte", _f32), ("reserved", _u32)]


class _ImageDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("width", _u32), ("height", _u32), ("alpha_mode", _u32),
                ("is_srgb", _u32), ("is_float", _u32), ("pixels", _ptr), ("pixel_bytes", _u64),
                ("path", _str), ("color_config", _str), ("color_space", _str), ("max_side", _u32),
                ("is_mip_mapped", _u32)]


class _SceneDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("thread_count", _u32), ("is_final", _u32),
                ("image_megabytes", _u32), ("reader", _u64)]


class _ReaderDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("reserved", _u32), ("program", _str)]


class _SceneStats(_Struct):
    _fields_ = [("struct_size", _u32), ("features", _u32), ("triangle_count", _u64),
                ("instanced_triangle_count", _u64), ("skipped_triangle_count", _u64),
                ("mesh_count", _u64), ("instance_count", _u64), ("skipped_instance_count", _u64),
                ("light_count", _u64), ("material_count", _u64), ("emissive_triangle_count", _u64),
                ("bvh_bytes", _u64), ("geometry_bytes", _u64), ("image_bytes", _u64),
                ("build_seconds", _f64), ("commit_seconds", _f64), ("built_count", _u32),
                ("refitted_count", _u32), ("bounds_lower", _f32 * 3), ("bounds_upper", _f32 * 3)]


class _RenderDesc(_Struct):
    _fields_ = [("struct_size", _u32), ("width", _u32), ("height", _u32), ("crop_x", _u32),
                ("crop_y", _u32), ("crop_width", _u32), ("crop_height", _u32), ("integrator", _u32),
                ("sample_count", _u32), ("light_samples", _u32), ("max_depth", _u32),
                ("max_transparent_depth", _u32), ("max_glossy_depth", _u32),
                ("max_transmission_depth", _u32), ("attenuation_cutoff", _f32),
                ("filter_glossy", _f32), ("clamp_direct", _f32), ("clamp_indirect", _f32),
                ("assembly", _u32), ("packet_size", _u32), ("sampler", _u32), ("seed", _u32),
                ("filter", _u32), ("filter_width", _f32), ("film_transparent", _u32),
                ("film_exposure", _f32), ("passes", _u64), ("thread_count", _u32),
                ("progressive", _u32), ("noise_threshold", _f32), ("min_samples", _u32),
                ("mist_start", _f32), ("mist_depth", _f32), ("mist_falloff", _f32),
                ("cryptomattes", _u32), ("cryptomatte_depth", _u32), ("aov_value_count", _u32),
                ("aov_color_count", _u32), ("light_group_count", _u32)]


class _RenderProgress(_Struct):
    _fields_ = [("struct_size", _u32), ("state", _u32), ("fraction", _f32), ("samples_done", _u32),
                ("seconds", _f64), ("rays_camera", _u64), ("rays_shadow", _u64),
                ("rays_reflection", _u64), ("rays_refraction", _u64), ("dropped_samples", _u64),
                ("memory_bytes", _u64), ("peak_memory_bytes", _u64), ("tiles_done", _u32),
                ("tile_count", _u32), ("version", _u32), ("reserved", _u32), ("seconds_trace", _f64),
                ("seconds_shade", _f64), ("seconds_other", _f64)]

    @property
    def ray_count(self):
        """Rays of every kind traced so far."""
        return self.rays_camera + self.rays_shadow + self.rays_reflection + self.rays_refraction


_STRUCTS = {
    "trc_corner_attribute": _CornerAttribute, "trc_mesh_desc": _MeshDesc,
    "trc_instance_desc": _InstanceDesc, "trc_light_desc": _LightDesc, "trc_world_desc": _WorldDesc,
    "trc_camera_desc": _CameraDesc, "trc_node_input": _NodeInput, "trc_node": _Node,
    "trc_material_desc": _MaterialDesc, "trc_image_desc": _ImageDesc, "trc_scene_desc": _SceneDesc,
    "trc_reader_desc": _ReaderDesc,
    "trc_scene_stats": _SceneStats, "trc_render_desc": _RenderDesc,
    "trc_render_progress": _RenderProgress}

_FUNCTIONS = {  # name: (result, arguments); a status result is checked by _call
    "trc_version_string": (_str, ()), "trc_last_message": (_str, ()), "trc_isa": (_u32, ()),
    "trc_isa_name": (_str, (_u32,)), "trc_pass_channels": (_u32, (_u32,)),
    "trc_cryptomatte_id": (_f32, (_str,)),
    "trc_reader_create": (_i32, (_ptr, _ptr)), "trc_reader_start": (_i32, (_u64,)),
    "trc_reader_destroy": (_i32, (_u64,)),
    "trc_scene_create": (_i32, (_ptr, _ptr)), "trc_scene_destroy": (_i32, (_u64,)),
    "trc_scene_commit": (_i32, (_u64,)), "trc_scene_cancel": (_i32, (_u64,)),
    "trc_scene_get_stats": (_i32, (_u64, _ptr)),
    "trc_scene_get_warnings": (_i32, (_u64, _ptr, _u64, _ptr)),
    "trc_scene_set_camera": (_i32, (_u64, _ptr)), "trc_scene_set_world": (_i32, (_u64, _ptr)),
    "trc_mesh_create": (_i32, (_u64, _ptr, _ptr)),
    "trc_mesh_update": (_i32, (_u64, _u64, _u32, _ptr, _u64, _ptr, _u64)),
    "trc_mesh_destroy": (_i32, (_u64, _u64)),
    "trc_instance_create": (_i32, (_u64, _ptr, _ptr)),
    "trc_instance_update": (_i32, (_u64, _u64, _ptr)), "trc_instance_destroy": (_i32, (_u64, _u64)),
    "trc_light_create": (_i32, (_u64, _ptr, _ptr)), "trc_light_update": (_i32, (_u64, _u64, _ptr)),
    "trc_light_destroy": (_i32, (_u64, _u64)),
    "trc_material_create": (_i32, (_u64, _ptr, _ptr)),
    "trc_material_update": (_i32, (_u64, _u64, _ptr)), "trc_material_destroy": (_i32, (_u64, _u64)),
    "trc_image_create": (_i32, (_u64, _ptr, _ptr)), "trc_image_destroy": (_i32, (_u64, _u64)),
    "trc_image_expect": (_i32, (_u64, _ptr)),
    "trc_render_start": (_i32, (_u64, _ptr, _ptr)), "trc_render_poll": (_i32, (_u64, _ptr)),
    "trc_render_wait": (_i32, (_u64, _f64)), "trc_render_cancel": (_i32, (_u64,)),
    "trc_render_read": (_i32, (_u64, _u32, _ptr, _u64)), "trc_render_destroy": (_i32, (_u64,))}


class TracerError(Exception):
    """A call of the library failed. ``status`` is its TRC_ERROR code, 0 when it could not be loaded."""

    def __init__(self, status, message):
        super().__init__(message)
        self.status = status


# Loading ---------------------------------------------------------------------------------------

_library = None
_load_error = "libtracer has not been loaded"
_reader = 0  # of image files, for all scenes: its program is started once and not for each frame
_owners = set()  # ids of the Scenes and Renders whose handles are alive


def library_path():
    """Where the shared library belongs: lib/ beside this module, by the platform's own name."""
    name = {"win32": "tracer.dll", "darwin": "libtracer.dylib"}.get(sys.platform, "libtracer.so")
    return os.path.join(os.path.dirname(os.path.abspath(__file__)), "lib", name)


def load(path=None):
    """Load the library; True on success. On failure ``load_error()`` says why, nothing is raised."""
    global _library, _load_error, _reader
    if _library is not None:
        return True
    path = path or library_path()
    try:
        library = ctypes.CDLL(path, mode=getattr(ctypes, "RTLD_LOCAL", 0))
        _check_abi(library)
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError, TracerError) as error:
        _load_error = f"libtracer cannot be used ({path}): {error}"
        return False
    _library, _load_error = library, ""
    try:
        _reader = _create_reader()
    except TracerError:  # out of memory: each scene has one of its own
        _reader = 0
    return True


def _create_reader():
    """A reader of image files. What unpacks an archive may have made its program a plain file."""
    program = os.path.join(os.path.dirname(library_path()), "tracer_reader")
    if os.path.isfile(program) and not os.access(program, os.X_OK):
        try:
            os.chmod(program, os.stat(program).st_mode | 0o111)
        except OSError:
            pass  # the library says that it cannot be started
    handle, desc = _u64(), _ReaderDesc()
    _call("trc_reader_create", ctypes.byref(desc), ctypes.byref(handle))
    return handle.value


def start_reader():
    """Let the program that reads image files load its libraries while others work. Returns at once."""
    if _reader:
        _call("trc_reader_start", _reader)


def unload():
    """Free the library, so that its file can be replaced and loaded anew. It stays while a handle is alive,
    as its threads may be at work."""
    global _library, _load_error, _reader
    if _library is None or _owners:
        return
    if _reader:
        _library.trc_reader_destroy(_reader)
        _reader = 0
    handle, _library = _library._handle, None
    _load_error = "libtracer has been unloaded"
    import _ctypes
    (_ctypes.FreeLibrary if sys.platform == "win32" else _ctypes.dlclose)(handle)


def load_error():
    """Why the library is not available, "" if it is."""
    return _load_error


def description():
    """Version and instruction set of the loaded library, for people."""
    library = _require()
    isa = library.trc_isa_name(library.trc_isa()).decode()
    return f"libtracer {library.trc_version_string().decode()}, {isa}"


def _check_abi(library):
    """Refuse a library of another interface: version first, then each descriptor's size."""
    library.trc_abi_version.restype = _u32
    version = library.trc_abi_version()
    if version != ABI_VERSION:
        raise TracerError(0, f"its interface is version {version}, this add-on needs {ABI_VERSION}")
    library.trc_struct_size.restype = _u32
    library.trc_struct_size.argtypes = (_str,)
    for name, struct in _STRUCTS.items():
        size = library.trc_struct_size(name.encode())
        if size != ctypes.sizeof(struct):
            raise TracerError(0, f"{name} has {size} bytes, this add-on expects {ctypes.sizeof(struct)}")


def _require():
    if _library is None:
        raise TracerError(0, _load_error)
    return _library


def _call(name, *arguments):
    """Call a function that returns a status; raise on anything but TRC_OK."""
    library = _require()
    status = getattr(library, name)(*arguments)
    if status != OK:
        message = (library.trc_last_message() or b"").decode("utf-8", "replace")
        known = STATUS_NAMES[status] if 0 <= status < len(STATUS_NAMES) else f"status {status}"
        raise TracerError(status, message or f"{name}: {known}")


def _array(values, dtype):
    """A contiguous array of that type, without a copy where it already is one; None stays None."""
    return None if values is None else np.ascontiguousarray(values, dtype=dtype)


def _address(array):
    return None if array is None or array.size == 0 else array.ctypes.data


def view(address, shape, dtype):
    """Memory of Blender's as an array; only while what it belongs to is there."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.frombuffer((ctypes.c_char * size).from_address(address), dtype).reshape(shape)


def _text(value):
    return value.encode("utf-8") if value else None


def pass_channels(pass_index):
    """Floats per pixel of a TRC_PASS, 0 for an unknown one."""
    return _require().trc_pass_channels(pass_index)


@functools.lru_cache(maxsize=1 << 16)  # a sync asks for every object
def cryptomatte_id(name):
    """The id of a name in Cryptomatte passes, a float32."""
    return _require().trc_cryptomatte_id(name.encode("utf-8"))


# Objects ---------------------------------------------------------------------------------------

class Scene:
    """A scene of the library. Ids are plain integers; 0 stands for "none"."""

    def __init__(self, is_final=True, thread_count=0, image_megabytes=0):
        handle = _u64()
        desc = _SceneDesc(thread_count=thread_count, is_final=int(is_final),
                          image_megabytes=image_megabytes, reader=_reader)
        _call("trc_scene_create", ctypes.byref(desc), ctypes.byref(handle))
        self._handle = handle.value
        _owners.add(id(self))
        self.revision = 0  # rises with every edit: equal numbers mean nothing to commit

    def destroy(self):
        """Free everything; renders already started are not disturbed. May be called twice."""
        handle, self._handle = self._handle, 0
        if handle:
            _library.trc_scene_destroy(handle)
            _owners.discard(id(self))

    def commit(self):
        """Build what changed and publish it to renders started afterwards."""
        _call("trc_scene_commit", self._handle)

    def cancel(self):
        """Make a commit that runs on another thread return soon."""
        _call("trc_scene_cancel", self._handle)

    def stats(self):
        """The statistics of the last commit (fields of trc_scene_stats)."""
        stats = _SceneStats()
        _call("trc_scene_get_stats", self._handle, ctypes.byref(stats))
        return stats

    def features(self):
        """Names of what the committed scene uses."""
        bits = self.stats().features
        return [name for i, name in enumerate(FEATURE_NAMES) if bits >> i & 1]

    def warnings(self):
        """Warnings of the last commit, a list of strings."""
        size = _u64()
        _call("trc_scene_get_warnings", self._handle, None, 0, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(max(1, size.value))
        _call("trc_scene_get_warnings", self._handle, buffer, len(buffer), None)
        return [line for line in buffer.value.decode("utf-8", "replace").split("\n") if line]

    # Meshes

    def create_mesh(self, positions, indices, normals=None, normal_kind=NORMALS_NONE, smooth=None,
                    material_index=None, attributes=(), generated=None):
        """A mesh. positions (keys, vertices, 3) float32; indices (triangles, 3) uint32; normals
        (keys, vertices | triangles * 3, 3); smooth (triangles,) uint8; material_index (triangles,)
        uint16; attributes: (name, array (triangles * 3, 2 | 4) float32) pairs, default UV map first;
        generated: (vertices, 3) or None."""
        positions, indices = _array(positions, np.float32), _array(indices, np.uint32)
        normals, smooth = _array(normals, np.float32), _array(smooth, np.uint8)
        material_index, generated = _array(material_index, np.uint16), _array(generated, np.float32)
        arrays = [(_text(name) or b"", _array(values, np.float32)) for name, values in attributes]
        structs = (_CornerAttribute * max(1, len(arrays)))(*(
            _CornerAttribute(width=values.shape[-1], name=name, values=_address(values),
                             value_count=values.size) for name, values in arrays))
        desc = _MeshDesc(
            key_count=positions.shape[0], vertex_count=positions.shape[1], triangle_count=len(indices),
            positions=_address(positions), position_count=positions.size, indices=_address(indices),
            index_count=indices.size, normals=_address(normals),
            normal_count=0 if normals is None else normals.size,
            normal_kind=NORMALS_NONE if normals is None else normal_kind,
            attribute_count=len(arrays), smooth=_address(smooth),
            material_index=_address(material_index),
            attributes=ctypes.addressof(structs) if arrays else None, generated=_address(generated),
            generated_count=0 if generated is None else generated.size)
        return self._create("trc_mesh_create", desc)

    def update_mesh(self, mesh, positions, normals=None):
        """New positions, (keys, vertices, 3), and normals for the same topology."""
        positions, normals = _array(positions, np.float32), _array(normals, np.float32)
        self._edit("trc_mesh_update", mesh, positions.shape[0], _address(positions),
                   positions.size, _address(normals), 0 if normals is None else normals.size)

    def destroy_mesh(self, mesh):
        self._edit("trc_mesh_destroy", mesh)

    # Instances

    def create_instance(self, **values):
        """An instance; see :meth:`update_instance`."""
        desc, keep = self._instance_desc(**values)
        return self._create("trc_instance_create", desc)

    def update_instance(self, instance, **values):
        """mesh: id; transforms (keys, 12) float32; materials: ids by slot; visibility; pass_index;
        random [0, 1); color: four floats; cryptomatte_object and cryptomatte_asset: ids; light_group: of
        its emission, 0 for none; flags: INSTANCE_*; values: numbers that its materials ask for."""
        desc, keep = self._instance_desc(**values)
        self._edit("trc_instance_update", instance, ctypes.byref(desc))

    def destroy_instance(self, instance):
        self._edit("trc_instance_destroy", instance)

    @staticmethod
    def _instance_desc(mesh, transforms, materials=(), visibility=VISIBLE_ALL, pass_index=0,
                       random=0.0, color=(1.0, 1.0, 1.0, 1.0), cryptomatte_object=0.0,
                       cryptomatte_asset=0.0, light_group=0, flags=0, values=()):
        transforms = _array(transforms, np.float32).reshape(-1, 12)
        ids = np.array(materials, dtype=np.uint64)
        numbers = np.array(values, dtype=np.float32)
        desc = _InstanceDesc(
            key_count=len(transforms), mesh=mesh, transforms=_address(transforms),
            materials=_address(ids), material_count=len(ids), visibility=visibility,
            pass_index=pass_index, random=random, color=tuple(color),
            cryptomatte_object=cryptomatte_object, cryptomatte_asset=cryptomatte_asset,
            light_group=light_group, flags=flags, values=_address(numbers), value_count=len(numbers))
        return desc, (transforms, ids, numbers)

    # Lights, world, camera

    def create_light(self, **values):
        """A light; keywords are the fields of trc_light_desc (transform: 12 floats)."""
        return self._create("trc_light_create", _LightDesc(**values))

    def update_light(self, light, **values):
        self._edit("trc_light_update", light, ctypes.byref(_LightDesc(**values)))

    def destroy_light(self, light):
        self._edit("trc_light_destroy", light)

    def set_world(self, **values):
        """Keywords are the fields of trc_world_desc."""
        self._edit("trc_scene_set_world", ctypes.byref(_WorldDesc(**values)))

    def set_camera(self, transforms, windows, shutter_curve=None, **values):
        """transforms (keys, 12); windows (keys or 1, 4): left, right, bottom, top; shutter_curve:
        samples of the shutter's opening or None; other keywords are fields of trc_camera_desc."""
        transforms = _array(transforms, np.float32).reshape(-1, 12)
        windows = _array(windows, np.float32).reshape(-1, 4)
        curve = _array(shutter_curve, np.float32)
        desc = _CameraDesc(
            key_count=len(transforms), transforms=_address(transforms), windows=_address(windows),
            window_key_count=len(windows), shutter_curve=_address(curve),
            shutter_curve_count=0 if curve is None else len(curve), **values)
        self._edit("trc_scene_set_camera", ctypes.byref(desc))

    # Materials and images

    def create_material(self, nodes, surface, **values):
        """A material from a flat node list; see :meth:`update_material`."""
        desc, keep = self._material_desc(nodes, surface, **values)
        return self._create("trc_material_create", desc)

    def update_material(self, material, nodes, surface, **values):
        """nodes: objects with type, mode, inputs, image, name, table; inputs: (node, output, (x, y, z))
        triples, node -1 for the constant, -2 for the socket's own default. surface: node index; other
        keywords are fields of trc_material_desc: pass_index, flags, cryptomatte."""
        desc, keep = self._material_desc(nodes, surface, **values)
        self._edit("trc_material_update", material, ctypes.byref(desc))

    def destroy_material(self, material):
        self._edit("trc_material_destroy", material)

    @staticmethod
    def _material_desc(nodes, surface, **values):
        keep, structs, inputs = [], [], []
        for node in nodes:
            table = _array(node.table, np.float32)
            keep.append(table)
            structs.append(_Node(
                type=node.type, mode=node.mode, first_input=len(inputs), input_count=len(node.inputs),
                image=node.image, name=_text(node.name), table=_address(table),
                table_count=0 if table is None else table.size))
            inputs += [_NodeInput(node=source, output=output, value=tuple(value))
                       for source, output, value in node.inputs]
        structs, inputs = (_Node * len(structs))(*structs), (_NodeInput * len(inputs))(*inputs)
        desc = _MaterialDesc(
            node_count=len(structs), nodes=ctypes.addressof(structs) if len(structs) else None,
            inputs=ctypes.addressof(inputs) if len(inputs) else None, input_count=len(inputs),
            surface=surface, **values)
        return desc, (keep, structs, inputs)

    def create_image(self, **values):
        """An image from a file or from pixels (height, width, 4), float32 or uint8, bottom row first; other
        keywords as :meth:`_image_desc`."""
        desc, keep = self._image_desc(**values)
        return self._create("trc_image_create", desc)

    def expect_image(self, **values):
        """Read the file of an image ahead, beside others: :meth:`create_image` with equal keywords, before
        the next commit, takes it from there."""
        desc, keep = self._image_desc(**values)
        _call("trc_image_expect", self._handle, ctypes.byref(desc))

    @staticmethod
    def _image_desc(pixels=None, path=None, alpha_mode=ALPHA_STRAIGHT, is_srgb=False,
                    color_space=(None, None), max_side=0, is_mip_mapped=False):
        """path: absolute; color_space: a configuration of OpenColorIO and a name in it; max_side: pixels, to
        which a larger one is halved, 0 for none; is_mip_mapped: with smaller levels for minification."""
        config, space = color_space[0] and os.fsencode(color_space[0]), _text(color_space[1])
        desc = _ImageDesc(alpha_mode=alpha_mode, is_srgb=int(is_srgb), path=path and os.fsencode(path),
                          color_config=config, color_space=space, max_side=max_side,
                          is_mip_mapped=int(is_mip_mapped))
        if pixels is not None:
            pixels = np.ascontiguousarray(pixels)
            desc.height, desc.width = pixels.shape[:2]
            desc.is_float = int(pixels.dtype == np.float32)
            desc.pixels, desc.pixel_bytes = _address(pixels), pixels.nbytes
        return desc, pixels

    def destroy_image(self, image):
        self._edit("trc_image_destroy", image)

    def start_render(self, **values):
        """Start rendering the committed scene in the background; keywords are the fields of
        trc_render_desc. Returns a :class:`Render`."""
        handle = _u64()
        desc = _RenderDesc(**values)
        _call("trc_render_start", self._handle, ctypes.byref(desc), ctypes.byref(handle))
        size = (desc.crop_width or desc.width, desc.crop_height or desc.height)
        return Render(handle.value, size)

    def _create(self, function, desc):
        new_id = _u64()
        self._edit(function, ctypes.byref(desc), ctypes.byref(new_id))
        return new_id.value

    def _edit(self, function, *arguments):
        _call(function, self._handle, *arguments)
        self.revision += 1


class Render:
    """A render that runs in threads of the library. ``size``: width and height of its film, pixels."""

    def __init__(self, handle, size):
        self._handle = handle
        _owners.add(id(self))
        self.size = size

    def poll(self):
        """How far it is (fields of trc_render_progress)."""
        progress = _RenderProgress()
        _call("trc_render_poll", self._handle, ctypes.byref(progress))
        return progress

    def wait(self, timeout_seconds):
        """Return when it has ended or after the time."""
        _call("trc_render_wait", self._handle, timeout_seconds)

    def cancel(self):
        """Ask it to stop; what is finished stays readable."""
        _call("trc_render_cancel", self._handle)

    def read(self, pass_index, out):
        """Copy a pass of the film into out, flat float32 of width * height * channels, bottom row
        first."""
        _call("trc_render_read", self._handle, pass_index, _address(out), out.size)
        return out

    def destroy(self):
        """Cancel, wait and free. May be called twice."""
        handle, self._handle = self._handle, 0
        if handle:
            _library.trc_render_destroy(handle)
            _owners.discard(id(self))

# SPDX-License-Identifier: GPL-3.0-or-later
"""libtracer from Python: with abi.py, which states its binary interface, all that knows ctypes.

``load()`` opens the shared library beside this package (``lib/``), compares its version, values, sizes and
offsets with those of abi.py, and keeps the reason when something does not fit (``load_error()``).
:class:`Scene` and :class:`Render` own a handle each; arrays come and go as numpy arrays; a failed call
raises :class:`TracerError` with the library's own message. Units and conventions are those of the
library's headers (metres, radians, column vectors, 3x4 row-major transforms), and so is the default of
each field of a descriptor.

``CDLL`` releases Python's lock during every call, so other threads run while the library builds.
"""

import ctypes
import functools
import importlib.util
import os
import sys
import zlib

import numpy as np

from . import abi
from .abi import AlphaMode, FeatureFlags, NormalsLayout, StatusCode


class TracerError(Exception):
    """A call of the library failed. ``status`` is its StatusCode, OK when it could not be loaded."""

    def __init__(self, status, message):
        super().__init__(message)
        self.status = status


_READER_SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "reader", "program.py")

# Loading ---------------------------------------------------------------------------------------

_library = None
_load_error = "libtracer has not been loaded"
_reader = 0  # of image files, for all scenes: its program is started once and not for each frame
_defaults = {}  # class of a structure: the library's default, as bytes
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
        check_abi(library)
        _declare(library, abi.FUNCTIONS)
        _defaults.update((structure, bytes(getattr(library, f"{name}_default")()))
                         for name, structure in abi.STRUCTURES.items())
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
    """A reader of image files: the program beside the library or, in packages, which have none, Blender's
    Python with the OpenImageIO that it brings."""
    program = os.path.join(os.path.dirname(library_path()), "tracer_reader" + (".exe" if os.name == "nt" else ""))
    values = {}
    if os.path.isfile(program):
        _make_runnable(program)
    elif _python() and importlib.util.find_spec("OpenImageIO"):
        values = {"program": os.fsencode(_python()), "script": os.fsencode(_READER_SCRIPT)}
    handle = ctypes.c_uint64()
    _call("trc_reader_create", ctypes.byref(describe(abi.ReaderDesc, **values)), ctypes.byref(handle))
    return handle.value


def _make_runnable(program):
    """What unpacks an archive may have made it a plain file."""
    if not os.access(program, os.X_OK):
        try:
            os.chmod(program, os.stat(program).st_mode | 0o111)
        except OSError:
            pass  # the library says that it cannot be started


def _python():
    """The program of the Python that runs inside Blender, None where there is none. What sys.executable
    names may be another one, found by the user's path."""
    name = "python.exe" if os.name == "nt" else f"python{sys.version_info.major}.{sys.version_info.minor}"
    path = os.path.join(sys.prefix, "bin", name)
    return path if os.access(path, os.X_OK) else None


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
    """Version, revision and instruction set of the loaded library, for people."""
    library = _require()
    isa = library.trc_isa_name(library.trc_isa()).decode()
    return f"libtracer {library.trc_version_string().decode()}{_revision()}, {isa}"


def _revision():
    """The state of the sources that the add-on was built from, as git names it, where that is known."""
    try:
        with open(os.path.join(os.path.dirname(library_path()), "revision"), encoding="utf-8") as file:
            return f" ({file.read().strip()})"
    except OSError:
        return ""


def _declare(library, names):
    for name in names:
        function = getattr(library, name)
        function.restype, function.argtypes = abi.FUNCTIONS[name]


def check_abi(library):
    """Refuse a library of another interface: its version first, then all that abi.py states."""
    _declare(library, ["trc_abi_version"])
    version = library.trc_abi_version()
    if version != abi.ABI_VERSION:
        raise TracerError(StatusCode.OK, f"its interface is version {version}, this add-on needs "
                          f"{abi.ABI_VERSION}")
    _declare(library, ["trc_abi_value"])
    value = ctypes.c_int64()
    for name, expected in _abi_values():
        if library.trc_abi_value(name.encode(), ctypes.byref(value)) != StatusCode.OK:
            raise TracerError(StatusCode.OK, f"it has no {name}, which this add-on needs")
        if value.value != expected:
            raise TracerError(StatusCode.OK, f"{name} is {value.value}, this add-on expects {expected}")


def _abi_values():
    """All that abi.py states: (name in C, number) of values, sizes of structures and offsets of fields."""
    yield from abi.CONSTANTS.items()
    for enumeration, prefix in abi.ENUMERATIONS.items():
        for name, member in enumeration.__members__.items():
            yield prefix + name, int(member)
    for name, structure in abi.STRUCTURES.items():
        yield name, ctypes.sizeof(structure)
        for field, _ in structure._fields_:
            yield f"{name}.{field}", getattr(structure, field).offset


def _require():
    if _library is None:
        raise TracerError(StatusCode.OK, _load_error)
    return _library


def _call(name, *arguments):
    """Call a function that returns a status; raise on anything but TRC_OK."""
    library = _require()
    status = getattr(library, name)(*arguments)
    if status != StatusCode.OK:
        message = (library.trc_last_message() or b"").decode("utf-8", "replace")
        raise TracerError(status, message or f"{name}: status {status}")


def describe(structure, **values):
    """A structure of abi.py as the library's default, with these fields changed."""
    desc = structure.from_buffer_copy(_defaults[structure])
    for name, value in values.items():
        setattr(desc, name, value)
    return desc


def ray_count(progress):
    """Rays of every kind that a render has traced so far."""
    return (progress.rays_camera + progress.rays_shadow + progress.rays_reflection
            + progress.rays_refraction)


def _array(values, dtype):
    """A contiguous array of that type, without a copy where it already is one; None stays None."""
    return None if values is None else np.ascontiguousarray(values, dtype=dtype)


_MAX_NAME_BYTES = 63  # of an attribute; Blender 5 has longer ones

# Of abi.DicingDesc: fields that are arrays, of their numbers of elements, and types.
_DICING_ARRAYS = (("faces", "face_count", np.uint32), ("crease_edges", "crease_edge_count", np.uint32),
                  ("crease_sharpness", "crease_count", np.float32),
                  ("vertex_sharpness", "vertex_sharpness_count", np.float32))


def _address(array):
    return None if array is None or array.size == 0 else array.ctypes.data


def view(address, shape, dtype):
    """Memory of Blender's as an array; only while what it belongs to is there."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.frombuffer((ctypes.c_char * size).from_address(address), dtype).reshape(shape)


def _text(value):
    return value.encode("utf-8") if value else None


def _attribute_name(name):
    """The name of an attribute as the library takes it: of a longer one the beginning, and a digest."""
    text = name.encode("utf-8")
    if len(text) <= _MAX_NAME_BYTES:
        return text
    digest = b" %08x" % zlib.crc32(text)
    return text[:_MAX_NAME_BYTES - len(digest)] + digest


def find_tangents(positions, normals, uvs, form, has_seams=True):
    """(triangles * 3, 3 or 4) float32 of a TRC_TANGENTS form, of triangles' corners: (triangles, 3, ...) each."""
    positions, normals, uvs = (_array(values, np.float32) for values in (positions, normals, uvs))
    width = 3 if form == abi.TangentsForm.VECTORS else 4
    found = np.empty((3 * len(positions), width), np.float32)
    desc = describe(abi.TangentsDesc, has_seams=int(has_seams), triangle_count=len(positions),
                    positions=_address(positions), normals=_address(normals), uvs=_address(uvs))
    _call("trc_tangents_find", ctypes.byref(desc), form, _address(found), found.size)
    return found


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
        _require()
        handle = ctypes.c_uint64()
        desc = describe(abi.SceneDesc, thread_count=thread_count, is_final=int(is_final),
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
        stats = describe(abi.SceneStats)
        _call("trc_scene_get_stats", self._handle, ctypes.byref(stats))
        return stats

    def features(self):
        """Names of what the committed scene uses."""
        bits = self.stats().features
        return [feature.name.lower().replace("_", " ") for feature in FeatureFlags if bits & feature]

    def warnings(self):
        """Warnings of the last commit, a list of strings."""
        size = ctypes.c_uint64()
        _call("trc_scene_get_warnings", self._handle, None, 0, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(max(1, size.value))
        _call("trc_scene_get_warnings", self._handle, buffer, len(buffer), None)
        return [line for line in buffer.value.decode("utf-8", "replace").split("\n") if line]

    # Meshes

    def create_mesh(self, positions, indices, normals=None, normal_kind=NormalsLayout.NONE, smooth=None,
                    material_index=None, attributes=(), generated=None, dicing=None):
        """A mesh. positions (keys, vertices, 3) float32; indices (triangles, 3) uint32; normals
        (keys, vertices | triangles * 3, 3); smooth (triangles,) uint8; material_index (triangles,)
        uint16; attributes: (name, array (triangles * 3, 2 | 4) float32) pairs, default UV map first;
        generated: (vertices, 3) or None; dicing: fields of abi.DicingDesc, of which faces, (triangles,)
        uint32, and those of creases, if there are any, are arrays, or None."""
        positions, indices = _array(positions, np.float32), _array(indices, np.uint32)
        normals, smooth = _array(normals, np.float32), _array(smooth, np.uint8)
        material_index, generated = _array(material_index, np.uint16), _array(generated, np.float32)
        arrays = [(_attribute_name(name), _array(values, np.float32)) for name, values in attributes]
        structs = (abi.CornerAttribute * len(arrays))(*(
            describe(abi.CornerAttribute, width=values.shape[-1], name=name, values=_address(values),
                     value_count=values.size) for name, values in arrays))
        desc = describe(
            abi.MeshDesc, key_count=positions.shape[0], vertex_count=positions.shape[1],
            triangle_count=len(indices), positions=_address(positions), position_count=positions.size,
            indices=_address(indices), index_count=indices.size, normals=_address(normals),
            normal_count=0 if normals is None else normals.size,
            normal_kind=NormalsLayout.NONE if normals is None else normal_kind,
            attribute_count=len(arrays), smooth=_address(smooth),
            material_index=_address(material_index),
            attributes=structs if arrays else None, generated=_address(generated),
            generated_count=0 if generated is None else generated.size)
        if dicing:
            arrays = {name: _array(dicing.get(name), dtype) for name, _, dtype in _DICING_ARRAYS}
            counts = {count: 0 if arrays[name] is None else arrays[name].size for name, count, _ in _DICING_ARRAYS}
            places = {name: _address(values) for name, values in arrays.items()}
            desc.dicing = ctypes.pointer(describe(abi.DicingDesc, **{**dicing, **places, **counts}))
        return self._create("trc_mesh_create", desc)

    def update_mesh(self, mesh, positions, normals=None):
        """New positions, (keys, vertices, 3), and normals for the same topology."""
        positions, normals = _array(positions, np.float32), _array(normals, np.float32)
        self._edit("trc_mesh_update", mesh, positions.shape[0], _address(positions),
                   positions.size, _address(normals), 0 if normals is None else normals.size)

    def create_curves(self, points, lengths=None, shape=abi.CurveShape.RIBBON, piece_count=1, attributes=(),
                      generated=None, tolerance=0.0):
        """Curves: points (keys, points, 4) float32, place and radius; lengths (strands,) uint32, points of
        each, None of balls; attributes: (name, array (points | strands, 2 | 4) float32, whether of strands),
        the default UV map first; generated: (strands, 3) or None; tolerance: in radii, 0 for piece_count
        pieces everywhere. They are a mesh to all else."""
        points, lengths = _array(points, np.float32), _array(lengths, np.uint32)
        generated = _array(generated, np.float32)
        arrays = [(_attribute_name(name), _array(values, np.float32), of_strands)
                  for name, values, of_strands in attributes]
        structs = (abi.CurveAttribute * len(arrays))(*(
            describe(abi.CurveAttribute, width=values.shape[-1], name=name, values=_address(values),
                     value_count=values.size, per_strand=int(of_strands))
            for name, values, of_strands in arrays))
        desc = describe(
            abi.CurvesDesc, key_count=points.shape[0], shape=shape, piece_count=piece_count,
            tolerance=tolerance, point_count=points.shape[1], points=_address(points), point_value_count=points.size,
            lengths=_address(lengths), strand_count=0 if lengths is None else len(lengths),
            generated=_address(generated), generated_count=0 if generated is None else generated.size,
            attributes=structs if arrays else None, attribute_count=len(arrays))
        return self._create("trc_curves_create", desc)

    def update_curves(self, mesh, points):
        """New places and radii, (keys, points, 4), of the same strands."""
        points = _array(points, np.float32)
        self._edit("trc_curves_update", mesh, points.shape[0], _address(points), points.size)

    def destroy_mesh(self, mesh):
        self._edit("trc_mesh_destroy", mesh)

    # Instances

    def create_instance(self, **values):
        """An instance; see :meth:`update_instance`."""
        desc, keep = self._instance_desc(**values)
        return self._create("trc_instance_create", desc)

    def update_instance(self, instance, **values):
        """transforms (keys, 12) float32; materials: ids by slot; values: numbers that its materials ask for;
        other keywords are fields of trc_instance_desc."""
        desc, keep = self._instance_desc(**values)
        self._edit("trc_instance_update", instance, ctypes.byref(desc))

    def move_instances(self, instances, transforms):
        """New transforms (instances, keys, 12) for several, which keep their numbers of keys."""
        ids, transforms = _array(instances, np.uint64), _array(transforms, np.float32)
        self._edit("trc_instances_move", _address(ids), len(ids), transforms.shape[1], _address(transforms),
                   transforms.size)

    def destroy_instance(self, instance):
        self._edit("trc_instance_destroy", instance)

    @staticmethod
    def _instance_desc(transforms, materials=(), values=(), **fields):
        transforms = _array(transforms, np.float32).reshape(-1, 12)
        ids = np.array(materials, dtype=np.uint64)
        numbers = np.array(values, dtype=np.float32)
        desc = describe(
            abi.InstanceDesc, key_count=len(transforms), transforms=_address(transforms),
            materials=_address(ids), material_count=len(ids), values=_address(numbers),
            value_count=len(numbers), **fields)
        return desc, (transforms, ids, numbers)

    # Lights, world, camera

    def create_light(self, **values):
        """A light; keywords are the fields of trc_light_desc (transform: 12 floats)."""
        return self._create("trc_light_create", describe(abi.LightDesc, **values))

    def update_light(self, light, **values):
        self._edit("trc_light_update", light, ctypes.byref(describe(abi.LightDesc, **values)))

    def destroy_light(self, light):
        self._edit("trc_light_destroy", light)

    def set_world(self, **values):
        """Keywords are the fields of trc_world_desc."""
        self._edit("trc_scene_set_world", ctypes.byref(describe(abi.WorldDesc, **values)))

    def set_camera(self, transforms, windows, shutter_curve=None, **values):
        """transforms (keys, 12); windows (keys or 1, 4): left, right, bottom, top; shutter_curve:
        samples of the shutter's opening or None; other keywords are fields of trc_camera_desc."""
        transforms = _array(transforms, np.float32).reshape(-1, 12)
        windows = _array(windows, np.float32).reshape(-1, 4)
        curve = _array(shutter_curve, np.float32)
        desc = describe(
            abi.CameraDesc, key_count=len(transforms), transforms=_address(transforms),
            windows=_address(windows), window_key_count=len(windows), shutter_curve=_address(curve),
            shutter_curve_count=0 if curve is None else len(curve), **values)
        self._edit("trc_scene_set_camera", ctypes.byref(desc))

    # Materials and images

    def create_material(self, nodes, surface, film_colors=None, **values):
        """A material from a flat node list; see :meth:`update_material`."""
        desc, keep = self._material_desc(nodes, surface, film_colors, **values)
        return self._create("trc_material_create", desc)

    def update_material(self, material, nodes, surface, film_colors=None, **values):
        """nodes: objects with type, mode, inputs, image, name, table; inputs: (node, output, (x, y, z))
        triples, node -1 for the constant, -2 for the socket's own default. surface: node index;
        film_colors: matrix (3, 3) or None; other keywords are fields of trc_material_desc: pass_index,
        flags, cryptomatte."""
        desc, keep = self._material_desc(nodes, surface, film_colors, **values)
        self._edit("trc_material_update", material, ctypes.byref(desc))

    def destroy_material(self, material):
        self._edit("trc_material_destroy", material)

    @staticmethod
    def _material_desc(nodes, surface, film_colors, **values):
        film_colors = _array(film_colors, np.float32)
        keep, structs, inputs = [film_colors], [], []
        for node in nodes:
            table = _array(node.table, np.float32)
            keep.append(table)
            structs.append(abi.Node(
                type=node.type, mode=node.mode, first_input=len(inputs), input_count=len(node.inputs),
                image=node.image, name=_attribute_name(node.name), table=_address(table),
                table_count=0 if table is None else table.size))
            inputs += [abi.NodeInput(node=source, output=output, value=tuple(value))
                       for source, output, value in node.inputs]
        structs, inputs = (abi.Node * len(structs))(*structs), (abi.NodeInput * len(inputs))(*inputs)
        desc = describe(
            abi.MaterialDesc, node_count=len(structs), nodes=structs if len(structs) else None,
            inputs=inputs if len(inputs) else None, input_count=len(inputs), surface=surface,
            film_colors=_address(film_colors), **values)
        return desc, (keep, structs, inputs)

    def create_image(self, **values):
        """An image from a file or from pixels (height, width, 4), float32 or uint8, bottom row first; without either
        it is magenta until :meth:`update_image`. Other keywords as :meth:`_image_desc`."""
        desc, keep = self._image_desc(**values)
        return self._create("trc_image_create", desc)

    def update_image(self, image, **values):
        """Other contents of an image; keywords as of :meth:`create_image`."""
        desc, keep = self._image_desc(**values)
        self._edit("trc_image_update", image, ctypes.byref(desc))

    def expect_image(self, **values):
        """Read the file of an image ahead, beside others: :meth:`create_image` or :meth:`update_image` with equal
        keywords, before the next commit, takes it from there."""
        desc, keep = self._image_desc(**values)
        _call("trc_image_expect", self._handle, ctypes.byref(desc))

    @staticmethod
    def _image_desc(pixels=None, path=None, alpha_mode=AlphaMode.STRAIGHT, is_srgb=False,
                    color_space=(None, None), max_side=0, is_mip_mapped=False, is_alpha_literal=False):
        """path: absolute; color_space: a configuration of OpenColorIO and a name in it; max_side: pixels, to
        which a larger one is halved, 0 for none; is_mip_mapped: with smaller levels for minification;
        is_alpha_literal: alpha_mode is that of a file's colours, whatever it says."""
        config, space = color_space[0] and os.fsencode(color_space[0]), _text(color_space[1])
        desc = describe(abi.ImageDesc, alpha_mode=alpha_mode, is_srgb=int(is_srgb),
                        path=path and os.fsencode(path), color_config=config, color_space=space,
                        max_side=max_side, is_mip_mapped=int(is_mip_mapped),
                        is_alpha_literal=int(is_alpha_literal))
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
        handle = ctypes.c_uint64()
        desc = describe(abi.RenderDesc, **values)
        _call("trc_render_start", self._handle, ctypes.byref(desc), ctypes.byref(handle))
        size = (desc.crop_width or desc.width, desc.crop_height or desc.height)
        return Render(handle.value, size)

    def _create(self, function, desc):
        new_id = ctypes.c_uint64()
        self._edit(function, ctypes.byref(desc), ctypes.byref(new_id))
        return new_id.value

    def _edit(self, function, *arguments):
        _call(function, self._handle, *arguments)
        self.revision += 1


def start_merge(has_catchers, **values):
    """A :class:`Render` whose samples come by :meth:`Render.add_part`; keywords are the fields of
    trc_render_desc of the whole."""
    handle = ctypes.c_uint64()
    desc = describe(abi.RenderDesc, **values)
    _call("trc_merge_start", ctypes.byref(desc), int(has_catchers), ctypes.byref(handle))
    return Render(handle.value, (desc.crop_width or desc.width, desc.crop_height or desc.height))


class Render:
    """A render that runs in threads of the library. ``size``: width and height of its film, pixels."""

    def __init__(self, handle, size):
        self._handle = handle
        _owners.add(id(self))
        self.size = size

    def poll(self):
        """How far it is (fields of trc_render_progress)."""
        progress = describe(abi.RenderProgress)
        _call("trc_render_poll", self._handle, ctypes.byref(progress))
        return progress

    def sums_channels(self, number):
        """Doubles of each pixel under a number of sums, 0 for none."""
        return _require().trc_sums_channels(self._handle, number)

    def read_sums(self, number):
        """Sums of a render that has ended, flat float64, in the order of :meth:`read`."""
        out = np.empty(self.size[0] * self.size[1] * self.sums_channels(number), np.float64)
        _call("trc_sums_read", self._handle, number, _address(out), out.size)
        return out

    def add_part(self, sample_offset, sample_subset, sums):
        """Add a part to a merge; sums: {number: flat float64}."""
        arrays = {number: _array(values, np.float64) for number, values in sums.items()}
        structs = (abi.Sums * len(arrays))(*(
            describe(abi.Sums, number=number, values=_address(values), value_count=values.size)
            for number, values in arrays.items()))
        desc = describe(abi.PartDesc, sample_offset=sample_offset, sample_subset=sample_subset,
                        sums_count=len(arrays), sums=structs)
        _call("trc_merge_add", self._handle, ctypes.byref(desc))

    def finish_merge(self):
        """All parts are there."""
        _call("trc_merge_finish", self._handle)

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

    def read_preview(self, out):
        """Copy Combined, quickly reconstructed, into out, as :meth:`read`."""
        _call("trc_render_read_preview", self._handle, _address(out), out.size)
        return out

    def destroy(self):
        """Cancel, wait and free. May be called twice."""
        handle, self._handle = self._handle, 0
        if handle:
            _library.trc_render_destroy(handle)
            _owners.discard(id(self))

# SPDX-License-Identifier: Apache-2.0
"""The binary interface: what Python states of it, what the library states, and what the headers say."""

import ctypes
import os
import re
import subprocess
import sys
from enum import IntEnum
from pathlib import Path

import addon_modules
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
HEADERS = sorted((ROOT / "libtracer" / "include" / "tracer").glob("*.h"))
LIBRARY = Path(os.environ.get("VOLLEY_BUILD", ROOT / "build")) / "lib" / "libtracer.so"

sys.path.insert(0, str(ROOT / "libtracer" / "tools"))
import generate_abi  # noqa: E402

abi, native = addon_modules.load("abi"), addon_modules.load("native")

# C types of scalars and of results, apart from the generator's own list.
SCALARS = {"uint32_t": ctypes.c_uint32, "int32_t": ctypes.c_int32, "uint64_t": ctypes.c_uint64,
           "int64_t": ctypes.c_int64, "float": ctypes.c_float, "double": ctypes.c_double,
           "trc_status": ctypes.c_int32, "trc_scene": ctypes.c_uint64, "trc_render": ctypes.c_uint64,
           "trc_reader": ctypes.c_uint64, "trc_id": ctypes.c_uint64}


@pytest.fixture(scope="module")
def library():
    return ctypes.CDLL(str(LIBRARY))


def declarations():
    """{name: (result, arguments)} of the functions in the headers, as C text without names."""
    found = {}
    for header in HEADERS:
        text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)
        for result, name, arguments in re.findall(r"TRC_API ([\w ]+?[ *]+)(trc_\w+)\(([^)]*)\);", text):
            parts = [re.sub(r"\w+\s*$", "", part).strip() for part in arguments.split(",")]
            found[name] = result.strip(), [part for part in parts if part]
    return found


def matches(stated, c_type):
    """Whether a ctypes type is that of C. A pointer to numbers may be one to anything."""
    if "*" not in c_type:
        return stated is SCALARS.get(c_type, abi.STRUCTURES.get(c_type))
    target = c_type.replace("const", "").rstrip("* ").strip()
    if target == "char":
        return stated is ctypes.c_char_p
    if target in abi.STRUCTURES:
        return stated._type_ is abi.STRUCTURES[target]
    return stated is ctypes.c_void_p or stated._type_ is SCALARS[target]


# The generated files -----------------------------------------------------------------------------

def test_both_files_are_what_the_headers_say():
    for path, text in generate_abi.generated(generate_abi.read_interface()).items():
        assert path.read_text() == text, f"run libtracer/tools/generate_abi.py: {path} is not up to date"


def test_another_header_makes_them_stale(tmp_path):
    """A field, an enumerator, a limit or a function more is in both files."""
    folder = tmp_path / "tracer"
    folder.mkdir()
    for header in (*HEADERS, *HEADERS[0].parent.glob("*.def")):
        (folder / header.name).write_text(header.read_text())
    with open(folder / "camera.h", "a") as file:
        file.write("#define TRC_MAX_LENSES 7\nenum trc_lens_kind { TRC_LENS_ROUND, TRC_LENS_FLAT = 1 << 4 };\n"
                   "enum { TRC_LOOSE = TRC_LENS_FLAT + 1 };\n"
                   "typedef struct trc_lens { float a, *b; const trc_id c[2]; } trc_lens;\n"
                   "TRC_API float trc_lens_of(const trc_lens *lens, uint8_t *out, uint64_t *size_out);\n")
    interface = generate_abi.read_interface(tmp_path)
    names = {}
    exec(generate_abi.python_text(interface), names)
    assert names["MAX_LENSES"] == 7 and names["LOOSE"] == 17
    assert names["LensKind"].FLAT == 16 and names["LensKind"].ROUND == 0
    assert names["Lens"]._fields_ == (("a", ctypes.c_float), ("b", ctypes.c_void_p),
                                      ("c", ctypes.c_uint64 * 2))
    result, (lens, out, size) = names["FUNCTIONS"]["trc_lens_of"]
    assert result is ctypes.c_float and out is ctypes.c_void_p
    assert lens._type_ is names["Lens"] and size._type_ is ctypes.c_uint64
    entries = dict(generate_abi.table_entries(interface))
    assert entries["trc_lens.c"] == "offsetof(trc_lens, c)" and "TRC_LENS_FLAT" in entries


def test_lists_become_enumerators_and_tables(tmp_path):
    """The form in which tracer/nodes.def is included."""
    folder = tmp_path / "tracer"
    folder.mkdir()
    (folder / "nodes.def").write_text('/* A, (B) */\nTRC_NODE(TINT, 3, "Tint, soft",\n  TRC_IN(COLOR, color) '
                                      'TRC_IN(FLOAT, factor),\n  TRC_OUT(COLOR, color), mode <= (2))\n'
                                      '#ifndef TRC_TEXTURE\n#define TRC_TEXTURE TRC_NODE\n#endif\n'
                                      'TRC_TEXTURE(NOTHING, 4, "Nothing", , TRC_OUT(FLOAT, one), mode == 0)\n'
                                      '#undef TRC_NODE\n')
    (folder / "nodes.h").write_text('enum trc_node_type {\n#define TRC_NODE(name, number, label, i, o, m) '
                                    'TRC_NODE_##name = number,\n#include "tracer/nodes.def"\n};\n')
    names = {}
    exec(generate_abi.python_text(generate_abi.read_interface(tmp_path)), names)
    assert [(node.name, node.value) for node in names["NodeType"]] == [("TINT", 3), ("NOTHING", 4)]
    assert names["NODES"][3] == ("Tint, soft", (("COLOR", "color"), ("FLOAT", "factor")),
                                 (("COLOR", "color"),))
    assert names["NODES"][4] == ("Nothing", (), (("FLOAT", "one"),))


def test_passes_become_enumerators_and_channels(tmp_path):
    """The form in which tracer/passes.def is included."""
    folder = tmp_path / "tracer"
    folder.mkdir()
    (folder / "passes.def").write_text('#ifndef TRC_PASS\n#define TRC_PASS(a, b, c)\n#endif\n'
                                       'TRC_PASS(GLOW, 0, "RGB", LIGHT, NONE, 0.0f)\n'
                                       'TRC_PASS_RANGE(GUIDE, 64, 2 * TRC_MAX_GUIDES, "X", MEAN)\n')
    (folder / "passes.h").write_text(
        '#define TRC_MAX_GUIDES 8\n'
        'enum trc_pass_id {\n#define TRC_PASS(N, n, c, k, d, m) TRC_PASS_##N = n,\n'
        '#include "tracer/passes.def"\n    TRC_PASS_COUNT\n};\n'
        'enum trc_pass_range {\n#define TRC_PASS_RANGE(N, f, n, c, k) TRC_PASS_FIRST_##N = f,\n'
        '#include "tracer/passes.def"\n};\n')
    names = {}
    exec(generate_abi.python_text(generate_abi.read_interface(tmp_path)), names)
    assert names["PassId"].COUNT == 1 and names["PASS_CHANNELS"] == {names["PassId"].GLOW: "RGB"}
    assert names["PASS_RANGES"] == {names["PassRange"].FIRST_GUIDE: (16, "X")}
    assert names["PassRange"].FIRST_GUIDE == 64


def test_names_lose_the_words_of_their_enumeration():
    assert abi.StatusCode.ERROR_TOO_LARGE == 4 and abi.VisibleRays.ALL == 31
    assert abi.PassId.COMBINED == 0 and abi.InputSource.DEFAULT == -2
    assert abi.NO_HIT == 0xffffffff and abi.MAX_CRYPTOMATTE_DEPTH == 16


# Functions ---------------------------------------------------------------------------------------

def test_all_exports_are_declared():
    text = subprocess.run(["nm", "-D", "--defined-only", str(LIBRARY)], capture_output=True, text=True,
                          check=True).stdout
    exported = {line.split()[-1] for line in text.splitlines()} - {"_init", "_fini"}
    assert exported == set(abi.FUNCTIONS) == set(declarations())


def test_functions_have_the_types_of_the_headers():
    for name, (result, arguments) in declarations().items():
        stated_result, stated = abi.FUNCTIONS[name]
        assert matches(stated_result, result), (name, result)
        arguments = [argument for argument in arguments if argument != "void"]
        assert len(stated) == len(arguments), name
        for number, (is_stated, argument) in enumerate(zip(stated, arguments)):
            assert matches(is_stated, argument), (name, number, argument)


def test_every_structure_has_a_default(library):
    for name, structure in abi.STRUCTURES.items():
        function = getattr(library, f"{name}_default")
        function.restype = structure
        desc = function()
        if structure._fields_[0][0] == "struct_size":
            assert desc.struct_size == ctypes.sizeof(structure), name


# The check at load -------------------------------------------------------------------------------

def test_the_library_is_accepted(library):
    native.check_abi(library)


def test_the_library_knows_what_the_headers_say(library):
    """Every enumerator and field that a plain search finds in the headers."""
    value = ctypes.c_int64()
    names = set()
    for header in HEADERS:
        text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)
        for body in re.findall(r"enum trc_\w+ {([^}]*)}", text):
            names.update(re.findall(r"^\s*(TRC_\w+)\b(?!\()", re.sub("[,{]", "\n", body), flags=re.M))
        for body, name in re.findall(r"struct trc_\w+ {([^}]*)} (\w+);", text):
            names.update(f"{name}.{field}" for field in re.findall(r"(\w+)(?:\[\d+\])?[,;]", body))
    assert len(names) > 300
    for name in names:
        assert library.trc_abi_value(name.encode(), ctypes.byref(value)) == 0, name


def test_other_names_are_refused(library):
    value = ctypes.c_int64(77)
    for name in (b"", b"TRC", b"TRC_NOTHING", b"trc_mesh_desc.", b"trc_mesh_desc.nothing", b"zzz", None):
        assert library.trc_abi_value(name, ctypes.byref(value)) == abi.StatusCode.ERROR_INVALID_ARGUMENT
    assert library.trc_abi_value(b"TRC_OK", None) == abi.StatusCode.ERROR_INVALID_ARGUMENT
    assert value.value == 77


def refusal(library):
    with pytest.raises(native.TracerError) as caught:
        native.check_abi(library)
    return str(caught.value)


def test_another_version_is_refused(library, monkeypatch):
    monkeypatch.setattr(abi, "ABI_VERSION", abi.ABI_VERSION + 1)
    assert f"version {abi.ABI_VERSION - 1}" in refusal(library)


def test_another_limit_is_refused(library, monkeypatch):
    monkeypatch.setitem(abi.CONSTANTS, "TRC_MAX_KEYS", 34)
    assert refusal(library) == "TRC_MAX_KEYS is 33, this add-on expects 34"


def test_another_enumerator_is_refused(library, monkeypatch):
    changed = IntEnum("CameraType", {"PERSPECTIVE": 1, "ORTHOGRAPHIC": 0})
    monkeypatch.setattr(abi, "ENUMERATIONS", {changed: "TRC_CAMERA_"})
    assert "TRC_CAMERA_PERSPECTIVE is 0" in refusal(library)
    longer = IntEnum("CameraType", {"PERSPECTIVE": 0, "PANORAMA": 7})
    monkeypatch.setattr(abi, "ENUMERATIONS", {longer: "TRC_CAMERA_"})
    assert "no TRC_CAMERA_PANORAMA" in refusal(library)


def test_another_order_of_fields_is_refused(library, monkeypatch):
    """Of the same size, which a check of sizes alone lets through."""
    first, second, third, *others = abi.LightDesc._fields_
    changed = type("LightDesc", (ctypes.Structure,), {"_fields_": (first, third, second, *others)})
    assert ctypes.sizeof(changed) == ctypes.sizeof(abi.LightDesc)
    monkeypatch.setitem(abi.STRUCTURES, "trc_light_desc", changed)
    assert "trc_light_desc.transform is 8" in refusal(library)


def test_another_size_is_refused(library, monkeypatch):
    changed = type("LightDesc", (ctypes.Structure,),
                   {"_fields_": (*abi.LightDesc._fields_, ("more", ctypes.c_uint32))})
    monkeypatch.setitem(abi.STRUCTURES, "trc_light_desc", changed)
    assert "trc_light_desc is " in refusal(library)


def test_load_says_what_does_not_fit(monkeypatch):
    monkeypatch.setitem(abi.CONSTANTS, "TRC_MAX_KEYS", 34)
    assert not native.load(str(LIBRARY))
    assert "TRC_MAX_KEYS" in native.load_error() and str(LIBRARY) in native.load_error()


# Through native.py -------------------------------------------------------------------------------

@pytest.fixture
def loaded():
    assert native.load(str(LIBRARY)), native.load_error()
    yield native
    native.unload()


def test_descriptors_begin_as_the_library_says(loaded):
    desc = native.describe(abi.RenderDesc, width=3)
    assert desc.width == 3 and desc.film_exposure == 1.0
    assert desc.max_glossy_depth == 0xffffffff
    with pytest.raises(AttributeError):
        native.describe(abi.RenderDesc, widht=3)


def test_a_picture_through_all_descriptors(loaded):
    """A square that shines 2, seen from 3 m by the default camera."""
    scene = native.Scene()
    emission = type("Node", (), {"type": abi.NodeType.EMISSION, "mode": 0, "image": 0, "name": "",
                                 "table": None, "inputs": [(abi.InputSource.CONSTANT, 0, (1.0, 1.0, 1.0)),
                                                           (abi.InputSource.CONSTANT, 0, (2.0, 0.0, 0.0))]})
    material = scene.create_material([emission], 0)
    square = [[[-9.0, -9.0, -3.0], [9.0, -9.0, -3.0], [9.0, 9.0, -3.0], [-9.0, 9.0, -3.0]]]
    mesh = scene.create_mesh(np.array(square), [[0, 1, 2], [0, 2, 3]],
                             attributes=[("UV", np.zeros((6, 2)))])
    scene.create_instance(mesh=mesh, transforms=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], materials=[material])
    scene.create_light(type=abi.LightType.SUN)
    scene.set_world()
    scene.set_camera([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], [-0.5, 0.5, -0.5, 0.5])
    scene.commit()
    assert scene.stats().triangle_count == 2 and "lights" in scene.features()
    render = scene.start_render(width=4, height=4, sample_count=1)
    render.wait(-1.0)
    assert render.poll().state == abi.ProgressState.DONE
    pixels = render.read(abi.PassId.COMBINED, np.zeros(64, np.float32))
    render.destroy()
    scene.destroy()
    assert pixels.reshape(-1, 4).tolist() == [[2.0, 2.0, 2.0, 1.0]] * 16

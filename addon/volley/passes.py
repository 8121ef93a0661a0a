# SPDX-License-Identifier: GPL-3.0-or-later
"""The render passes: one list that registers them, asks the library for them and reads them back."""

from collections import namedtuple

import numpy as np

from .abi import (CRYPTOMATTE_LAYER_RANKS, MAX_AOVS, MAX_CRYPTOMATTE_DEPTH, MAX_CRYPTOMATTE_LAYERS,
                  MAX_LIGHT_GROUPS, PASS_CHANNELS, PASS_RANGES, CryptomatteKind, PassesFlags, PassId, PassRange)
from .compat import BACKGROUND_MOVES, HAS_BLENDED_FEATURES, HAS_LONG_PASS_NAMES, HAS_MEAN_REFRACTION

# index: a PassId, or a number of a PassRange; names: before 5.0 and since; channels: one letter each;
# setting: path below the view layer.
Pass = namedtuple("Pass", "index names channels setting")

# Names before Blender 5.0 and since, and settings, in the order in which Blender shows them.
_BLENDER_PASSES = {
    PassId.COMBINED: ("Combined", "Combined", "use_pass_combined"),
    PassId.DEPTH: ("Depth", "Depth", "use_pass_z"),
    PassId.POSITION: ("Position", "Position", "use_pass_position"),
    PassId.NORMAL: ("Normal", "Normal", "use_pass_normal"),
    PassId.VECTOR: ("Vector", "Vector", "use_pass_vector"),
    PassId.UV: ("UV", "UV", "use_pass_uv"),
    PassId.OBJECT_INDEX: ("IndexOB", "Object Index", "use_pass_object_index"),
    PassId.MATERIAL_INDEX: ("IndexMA", "Material Index", "use_pass_material_index"),
    PassId.DIFFUSE_DIRECT: ("DiffDir", "Diffuse Direct", "use_pass_diffuse_direct"),
    PassId.DIFFUSE_INDIRECT: ("DiffInd", "Diffuse Indirect", "use_pass_diffuse_indirect"),
    PassId.DIFFUSE_COLOR: ("DiffCol", "Diffuse Color", "use_pass_diffuse_color"),
    PassId.GLOSSY_DIRECT: ("GlossDir", "Glossy Direct", "use_pass_glossy_direct"),
    PassId.GLOSSY_INDIRECT: ("GlossInd", "Glossy Indirect", "use_pass_glossy_indirect"),
    PassId.GLOSSY_COLOR: ("GlossCol", "Glossy Color", "use_pass_glossy_color"),
    PassId.TRANSMISSION_DIRECT: ("TransDir", "Transmission Direct", "use_pass_transmission_direct"),
    PassId.TRANSMISSION_INDIRECT: ("TransInd", "Transmission Indirect", "use_pass_transmission_indirect"),
    PassId.TRANSMISSION_COLOR: ("TransCol", "Transmission Color", "use_pass_transmission_color"),
    PassId.EMISSION: ("Emit", "Emission", "use_pass_emit"),
    PassId.ENVIRONMENT: ("Env", "Environment", "use_pass_environment"),
    PassId.AMBIENT_OCCLUSION: ("AO", "Ambient Occlusion", "use_pass_ambient_occlusion"),
    PassId.SHADOW: ("Shadow", "Shadow", "use_pass_shadow"),
    PassId.SHADOW_CATCHER: ("Shadow Catcher", "Shadow Catcher", "volley.use_pass_shadow_catcher"),
    PassId.MIST: ("Mist", "Mist", "use_pass_mist"),
    PassId.NOISY_COMBINED: ("Noisy Image", "Noisy Image", "volley.denoising_store_passes"),
    PassId.DENOISING_ALBEDO: ("Denoising Albedo", "Denoising Albedo", "volley.denoising_store_passes"),
    PassId.DENOISING_NORMAL: ("Denoising Normal", "Denoising Normal", "volley.denoising_store_passes"),
    PassId.DENOISING_DEPTH: ("Denoising Depth", "Denoising Depth", "volley.denoising_store_passes"),
    PassId.DENOISING_ROUGHNESS: ("Denoising Roughness", "Denoising Roughness",
                                 "volley.denoising_store_passes"),
    PassId.DENOISING_SPECULAR_ALBEDO: ("Denoising Specular Albedo", "Denoising Specular Albedo",
                                       "volley.denoising_store_passes"),
    PassId.SAMPLE_COUNT: ("Debug Sample Count", "Debug Sample Count", "volley.use_pass_sample_count"),
}
PASSES = tuple(Pass(index, (name, long_name), PASS_CHANNELS[index], setting)
               for index, (name, long_name, setting) in _BLENDER_PASSES.items())
COMBINED = PASSES[0]

_LARGE_PAGE_BYTES = 2 << 20

# Name, setting of the view layer.
CRYPTOMATTES = {CryptomatteKind.OBJECT: ("CryptoObject", "use_pass_cryptomatte_object"),
                CryptomatteKind.MATERIAL: ("CryptoMaterial", "use_pass_cryptomatte_material"),
                CryptomatteKind.ASSET: ("CryptoAsset", "use_pass_cryptomatte_asset")}

# The passes of the two types of AOVs.
_AOVS = {'VALUE': PassRange.FIRST_AOV_VALUE, 'COLOR': PassRange.FIRST_AOV_COLOR}


def name_of(entry, long_names=HAS_LONG_PASS_NAMES):
    """The pass's name in this Blender."""
    return entry.names[1 if long_names else 0]


def kind_of(entry):
    """The pass's kind as Blender's register_pass() wants it."""
    if len(entry.channels) == 1:
        return 'VALUE'
    return 'COLOR' if entry.channels.upper().startswith("RGB") else 'VECTOR'


def _in_range(first, number, name, setting):
    """A pass of a PassRange."""
    return Pass(first + number, (name, name), PASS_RANGES[first][1], setting)


def is_enabled(entry, view_layer):
    """Whether the view layer asks for the pass; Combined is always there."""
    if entry is COMBINED:
        return True
    value = view_layer
    for part in entry.setting.split("."):
        value = getattr(value, part, False)
    return bool(value)


def enabled(view_layer):
    """The passes a view layer asks for."""
    entries = [entry for entry in PASSES if is_enabled(entry, view_layer)]
    return [*entries, *_aovs(view_layer), *_light_groups(view_layer),
            *_cryptomatte_layers(view_layer)]


def aov_numbers(view_layer):
    """{name: (type, number among those of its type)} of the AOVs that a view layer asks for."""
    numbers, counts = {}, dict.fromkeys(_AOVS, 0)
    for aov in view_layer.aovs:
        if aov.is_valid and counts[aov.type] < MAX_AOVS:
            numbers[aov.name] = aov.type, counts[aov.type]
            counts[aov.type] += 1
    return numbers


def _aovs(view_layer):
    for name, (aov_type, number) in aov_numbers(view_layer).items():
        yield _in_range(_AOVS[aov_type], number, name, "aovs")


def light_group_numbers(view_layer):
    """{name: number from 1 on} of the light groups of a view layer."""
    names = [group.name for group in view_layer.lightgroups[:MAX_LIGHT_GROUPS]]
    return {name: number + 1 for number, name in enumerate(names)}


def left_out(view_layer):
    """Messages about AOVs and light groups that are more than the library has room for."""
    aovs = [aov.name for aov in view_layer.aovs if aov.is_valid]
    groups = [group.name for group in view_layer.lightgroups]
    kept_aovs, kept_groups = aov_numbers(view_layer), light_group_numbers(view_layer)
    return [f"AOV '{name}': there are more than {MAX_AOVS} of its type, it is left out"
            for name in aovs if name not in kept_aovs] + [
        f"Light group '{name}': there are more than {MAX_LIGHT_GROUPS}, it is left out"
        for name in groups if name not in kept_groups]


def _light_groups(view_layer):
    for name, number in light_group_numbers(view_layer).items():
        yield _in_range(PassRange.FIRST_LIGHT_GROUP, number - 1, f"Combined_{name}", "lightgroups")


def _cryptomatte_layers(view_layer):
    ranks = min(view_layer.pass_cryptomatte_depth, MAX_CRYPTOMATTE_DEPTH)
    for kind, (name, setting) in CRYPTOMATTES.items():
        if getattr(view_layer, setting):
            for layer in range((ranks + 1) // CRYPTOMATTE_LAYER_RANKS):
                number = kind * MAX_CRYPTOMATTE_LAYERS + layer
                yield _in_range(PassRange.FIRST_CRYPTOMATTE, number, f"{name}{layer:02d}", setting)


def register_passes(engine, scene, view_layer):
    """Tell the compositor which sockets there are."""
    for entry in enabled(view_layer):
        engine.register_pass(scene, view_layer, name_of(entry), len(entry.channels), entry.channels,
                             kind_of(entry))


def add_to_result(engine, entries, layer_name):
    """Make room in the render result's layer of that name for all passes but Blender's own Combined."""
    for entry in entries:
        if entry is not COMBINED:
            engine.add_pass(name_of(entry), len(entry.channels), entry.channels, layer=layer_name)


def without_vector(entries):
    """The passes to ask the library for with motion blur, which leaves Vector black as in Cycles."""
    return [entry for entry in entries if entry.setting != "use_pass_vector"]


def request_fields(entries):
    """The passes as fields of trc_render_desc."""
    def numbers(first):
        return [entry.index - first for entry in entries if 0 <= entry.index - first < PASS_RANGES[first][0]]
    layers = [divmod(number, MAX_CRYPTOMATTE_LAYERS) for number in numbers(PassRange.FIRST_CRYPTOMATTE)]
    asked = {entry.index for entry in entries if entry.index < PassId.COUNT}
    if PassId.DENOISING_ALBEDO in asked:  # which has it added
        asked.add(PassId.DENOISING_EMISSION)
    return {
        "passes": sum(1 << index for index in asked),
        "aov_value_count": len(numbers(PassRange.FIRST_AOV_VALUE)),
        "aov_color_count": len(numbers(PassRange.FIRST_AOV_COLOR)),
        "light_group_count": len(numbers(PassRange.FIRST_LIGHT_GROUP)),
        "cryptomattes": sum(1 << kind for kind in {kind for kind, _ in layers}),
        "cryptomatte_depth": CRYPTOMATTE_LAYER_RANKS * max((layer + 1 for _, layer in layers), default=0),
        "pass_flags": (PassesFlags.BLENDED_FEATURES if HAS_BLENDED_FEATURES else 0)
        | (PassesFlags.BACKGROUND_MOTION if BACKGROUND_MOVES else 0)
        | (PassesFlags.MEAN_REFRACTION if HAS_MEAN_REFRACTION else 0),
    }


def _room(count):
    """Float32 for the library to fill, flat. numpy asks for large pages of what is many, which it does not align."""
    if count * 4 < _LARGE_PAGE_BYTES:
        return np.empty(count, np.float32)
    room = np.empty(count + _LARGE_PAGE_BYTES // 4, np.float32)
    start = -room.ctypes.data % _LARGE_PAGE_BYTES // 4
    return room[start:start + count]


def write(render, layer, entries):
    """Copy the film into a render layer's passes with one assignment.

    The collection's ``rect`` is the passes' pixels one after the other, width * height * channels
    float32 each, bottom row first. A pass that is not ours becomes black."""
    by_name = {name_of(entry): entry for entry in entries}
    pixel_count = render.size[0] * render.size[1]
    targets = [(by_name.get(target.name), target.channels * pixel_count) for target in layer.passes]
    flat = _room(sum(count for _, count in targets))
    start = 0
    for entry, count in targets:
        pixels = flat[start:start + count]
        if entry is None:
            pixels[:] = 0.0
        else:
            render.read(entry.index, pixels)
        start += count
    layer.passes.foreach_set("rect", flat)


# What a viewport may show; it has no motion for the Vector pass.
SHOWN_PASSES = {entry.index.name: entry for entry in PASSES if entry.index != PassId.VECTOR}


def shown_in(v3d):
    """The pass that a viewport shows."""
    return SHOWN_PASSES[v3d.shading.volley.render_pass]


def read_shown(render, entry):
    """A pass as a picture, (height, width, 4) float32, bottom row first: numbers are grey."""
    if entry is COMBINED:
        return read_combined(render)
    width, height = render.size
    channels = len(entry.channels)
    values = render.read(entry.index, _room(width * height * channels))
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values.reshape(height, width, channels)[..., :3]
    return pixels


def read_preview(render):
    """The film's Combined pass as :func:`read_combined`, quickly reconstructed."""
    width, height = render.size
    return render.read_preview(_room(width * height * 4)).reshape(height, width, 4)


def read_combined(render):
    """The film's Combined pass, (height, width, 4) float32, bottom row first."""
    width, height = render.size
    return render.read(COMBINED.index, _room(width * height * 4)).reshape(height, width, 4)

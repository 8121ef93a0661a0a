# SPDX-License-Identifier: GPL-3.0-or-later
"""The render passes: one list that registers them, asks the library for them and reads them back."""

from collections import namedtuple

import numpy as np

from .abi import (CRYPTOMATTE_LAYER_RANKS, MAX_AOVS, MAX_CRYPTOMATTE_DEPTH, MAX_CRYPTOMATTE_LAYERS,
                  MAX_LIGHT_GROUPS, CryptomatteKind, PassId, PassRange)
from .compat import HAS_LONG_PASS_NAMES

# index: a PassId, or a number from a PassRange on; names: before 5.0 and since; channels: one letter
# each; kind: as Blender's; setting: path below the view layer.
Pass = namedtuple("Pass", "index names channels kind setting")

PASSES = (
    Pass(PassId.COMBINED, ("Combined", "Combined"), "RGBA", 'COLOR', "use_pass_combined"),
    Pass(PassId.DEPTH, ("Depth", "Depth"), "Z", 'VALUE', "use_pass_z"),
    Pass(PassId.POSITION, ("Position", "Position"), "XYZ", 'VECTOR', "use_pass_position"),
    Pass(PassId.NORMAL, ("Normal", "Normal"), "XYZ", 'VECTOR', "use_pass_normal"),
    Pass(PassId.VECTOR, ("Vector", "Vector"), "XYZW", 'VECTOR', "use_pass_vector"),
    Pass(PassId.UV, ("UV", "UV"), "UVA", 'VECTOR', "use_pass_uv"),
    Pass(PassId.OBJECT_INDEX, ("IndexOB", "Object Index"), "X", 'VALUE', "use_pass_object_index"),
    Pass(PassId.MATERIAL_INDEX, ("IndexMA", "Material Index"), "X", 'VALUE', "use_pass_material_index"),
    Pass(PassId.DIFFUSE_DIRECT, ("DiffDir", "Diffuse Direct"), "RGB", 'COLOR', "use_pass_diffuse_direct"),
    Pass(PassId.DIFFUSE_INDIRECT, ("DiffInd", "Diffuse Indirect"), "RGB", 'COLOR',
         "use_pass_diffuse_indirect"),
    Pass(PassId.DIFFUSE_COLOR, ("DiffCol", "Diffuse Color"), "RGB", 'COLOR', "use_pass_diffuse_color"),
    Pass(PassId.GLOSSY_DIRECT, ("GlossDir", "Glossy Direct"), "RGB", 'COLOR', "use_pass_glossy_direct"),
    Pass(PassId.GLOSSY_INDIRECT, ("GlossInd", "Glossy Indirect"), "RGB", 'COLOR', "use_pass_glossy_indirect"),
    Pass(PassId.GLOSSY_COLOR, ("GlossCol", "Glossy Color"), "RGB", 'COLOR', "use_pass_glossy_color"),
    Pass(PassId.TRANSMISSION_DIRECT, ("TransDir", "Transmission Direct"), "RGB", 'COLOR',
         "use_pass_transmission_direct"),
    Pass(PassId.TRANSMISSION_INDIRECT, ("TransInd", "Transmission Indirect"), "RGB", 'COLOR',
         "use_pass_transmission_indirect"),
    Pass(PassId.TRANSMISSION_COLOR, ("TransCol", "Transmission Color"), "RGB", 'COLOR',
         "use_pass_transmission_color"),
    Pass(PassId.EMISSION, ("Emit", "Emission"), "RGB", 'COLOR', "use_pass_emit"),
    Pass(PassId.ENVIRONMENT, ("Env", "Environment"), "RGB", 'COLOR', "use_pass_environment"),
    Pass(PassId.AMBIENT_OCCLUSION, ("AO", "Ambient Occlusion"), "RGB", 'COLOR', "use_pass_ambient_occlusion"),
    Pass(PassId.SHADOW, ("Shadow", "Shadow"), "RGB", 'COLOR', "use_pass_shadow"),
    Pass(PassId.SHADOW_CATCHER, ("Shadow Catcher", "Shadow Catcher"), "RGB", 'COLOR',
         "volley.use_pass_shadow_catcher"),
    Pass(PassId.MIST, ("Mist", "Mist"), "Z", 'VALUE', "use_pass_mist"),
    Pass(PassId.DENOISING_ALBEDO, ("Denoising Albedo", "Denoising Albedo"), "RGB", 'COLOR',
         "volley.denoising_store_passes"),
    Pass(PassId.DENOISING_NORMAL, ("Denoising Normal", "Denoising Normal"), "XYZ", 'VECTOR',
         "volley.denoising_store_passes"),
    Pass(PassId.DENOISING_DEPTH, ("Denoising Depth", "Denoising Depth"), "Z", 'VALUE',
         "volley.denoising_store_passes"),
    Pass(PassId.SAMPLE_COUNT, ("Debug Sample Count", "Debug Sample Count"), "X", 'VALUE',
         "volley.use_pass_sample_count"),
)
COMBINED = PASSES[0]

# Name, setting of the view layer.
CRYPTOMATTES = {CryptomatteKind.OBJECT: ("CryptoObject", "use_pass_cryptomatte_object"),
                CryptomatteKind.MATERIAL: ("CryptoMaterial", "use_pass_cryptomatte_material"),
                CryptomatteKind.ASSET: ("CryptoAsset", "use_pass_cryptomatte_asset")}

# By the type of an AOV: number of the first, channels, kind of pass.
_AOVS = {'VALUE': (PassRange.FIRST_AOV_VALUE, "X", 'VALUE'),
         'COLOR': (PassRange.FIRST_AOV_COLOR, "RGBA", 'COLOR')}


def name_of(entry, long_names=HAS_LONG_PASS_NAMES):
    """The pass's name in this Blender."""
    return entry.names[1 if long_names else 0]


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
        first, channels, kind = _AOVS[aov_type]
        yield Pass(first + number, (name, name), channels, kind, "aovs")


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
        yield Pass(PassRange.FIRST_LIGHT_GROUP + number - 1, (f"Combined_{name}",) * 2, "RGB", 'COLOR',
                   "lightgroups")


def _cryptomatte_layers(view_layer):
    """Channels in small letters: so Blender's OpenEXR writer knows that they must not be changed."""
    ranks = min(view_layer.pass_cryptomatte_depth, MAX_CRYPTOMATTE_DEPTH)
    for kind, (name, setting) in CRYPTOMATTES.items():
        if getattr(view_layer, setting):
            for layer in range((ranks + 1) // CRYPTOMATTE_LAYER_RANKS):
                index = PassRange.FIRST_CRYPTOMATTE + kind * MAX_CRYPTOMATTE_LAYERS + layer
                yield Pass(index, (f"{name}{layer:02d}",) * 2, "rgba", 'COLOR', setting)


def register_passes(engine, scene, view_layer):
    """Tell the compositor which sockets there are."""
    for entry in enabled(view_layer):
        engine.register_pass(scene, view_layer, name_of(entry), len(entry.channels), entry.channels,
                             entry.kind)


def add_to_result(engine, entries):
    """Make room in the render result for all passes but Blender's own Combined."""
    for entry in entries:
        if entry is not COMBINED:
            engine.add_pass(name_of(entry), len(entry.channels), entry.channels)


def without_vector(entries):
    """The passes to ask the library for with motion blur, which leaves Vector black as in Cycles."""
    return [entry for entry in entries if entry.setting != "use_pass_vector"]


def request_fields(entries):
    """The passes as fields of trc_render_desc."""
    layers = [divmod(entry.index - PassRange.FIRST_CRYPTOMATTE, MAX_CRYPTOMATTE_LAYERS) for entry in entries
              if entry.index >= PassRange.FIRST_CRYPTOMATTE]
    aov_counts = [sum(first <= entry.index < first + MAX_AOVS for entry in entries)
                  for first, _, _ in _AOVS.values()]
    return {
        "passes": sum(1 << entry.index for entry in entries if entry.index < PassId.COUNT),
        "aov_value_count": aov_counts[0], "aov_color_count": aov_counts[1],
        "light_group_count": sum(PassRange.FIRST_LIGHT_GROUP <= entry.index < PassRange.FIRST_CRYPTOMATTE
                                 for entry in entries),
        "cryptomattes": sum(1 << kind for kind in {kind for kind, _ in layers}),
        "cryptomatte_depth": CRYPTOMATTE_LAYER_RANKS * max((layer + 1 for _, layer in layers), default=0),
    }


def write(render, layer, entries):
    """Copy the film into a render layer's passes with one assignment.

    The collection's ``rect`` is the passes' pixels one after the other, width * height * channels
    float32 each, bottom row first. A pass that is not ours becomes black."""
    by_name = {name_of(entry): entry for entry in entries}
    pixel_count = render.size[0] * render.size[1]
    targets = [(by_name.get(target.name), target.channels * pixel_count) for target in layer.passes]
    flat = np.zeros(sum(count for _, count in targets), np.float32)
    start = 0
    for entry, count in targets:
        if entry is not None:
            render.read(entry.index, flat[start:start + count])
        start += count
    layer.passes.foreach_set("rect", flat)


def read_combined(render):
    """The film's Combined pass, (height, width, 4) float32, bottom row first."""
    width, height = render.size
    pixels = np.empty(width * height * 4, np.float32)
    return render.read(COMBINED.index, pixels).reshape(height, width, 4)

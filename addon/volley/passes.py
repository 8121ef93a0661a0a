# SPDX-License-Identifier: GPL-3.0-or-later
"""The render passes: one list that registers them, asks the library for them and reads them back."""

from collections import namedtuple

import numpy as np

from .compat import HAS_LONG_PASS_NAMES

# index: TRC_PASS_*; names: before 5.0 and since; channels: one letter each; kind: as Blender's;
# setting: path below the view layer.
Pass = namedtuple("Pass", "index names channels kind setting")

PASSES = (
    Pass(0, ("Combined", "Combined"), "RGBA", 'COLOR', "use_pass_combined"),
    Pass(1, ("Depth", "Depth"), "Z", 'VALUE', "use_pass_z"),
    Pass(3, ("Position", "Position"), "XYZ", 'VECTOR', "use_pass_position"),
    Pass(2, ("Normal", "Normal"), "XYZ", 'VECTOR', "use_pass_normal"),
    Pass(23, ("Vector", "Vector"), "XYZW", 'VECTOR', "use_pass_vector"),
    Pass(4, ("UV", "UV"), "UVA", 'VECTOR', "use_pass_uv"),
    Pass(5, ("IndexOB", "Object Index"), "X", 'VALUE', "use_pass_object_index"),
    Pass(6, ("IndexMA", "Material Index"), "X", 'VALUE', "use_pass_material_index"),
    Pass(9, ("DiffDir", "Diffuse Direct"), "RGB", 'COLOR', "use_pass_diffuse_direct"),
    Pass(10, ("DiffInd", "Diffuse Indirect"), "RGB", 'COLOR', "use_pass_diffuse_indirect"),
    Pass(11, ("DiffCol", "Diffuse Color"), "RGB", 'COLOR', "use_pass_diffuse_color"),
    Pass(12, ("GlossDir", "Glossy Direct"), "RGB", 'COLOR', "use_pass_glossy_direct"),
    Pass(13, ("GlossInd", "Glossy Indirect"), "RGB", 'COLOR', "use_pass_glossy_indirect"),
    Pass(14, ("GlossCol", "Glossy Color"), "RGB", 'COLOR', "use_pass_glossy_color"),
    Pass(15, ("TransDir", "Transmission Direct"), "RGB", 'COLOR', "use_pass_transmission_direct"),
    Pass(16, ("TransInd", "Transmission Indirect"), "RGB", 'COLOR', "use_pass_transmission_indirect"),
    Pass(17, ("TransCol", "Transmission Color"), "RGB", 'COLOR', "use_pass_transmission_color"),
    Pass(7, ("Emit", "Emission"), "RGB", 'COLOR', "use_pass_emit"),
    Pass(8, ("Env", "Environment"), "RGB", 'COLOR', "use_pass_environment"),
    Pass(24, ("AO", "Ambient Occlusion"), "RGB", 'COLOR', "use_pass_ambient_occlusion"),
    Pass(25, ("Shadow", "Shadow"), "RGB", 'COLOR', "use_pass_shadow"),
    Pass(26, ("Shadow Catcher", "Shadow Catcher"), "RGB", 'COLOR', "volley.use_pass_shadow_catcher"),
    Pass(19, ("Mist", "Mist"), "Z", 'VALUE', "use_pass_mist"),
    Pass(20, ("Denoising Albedo", "Denoising Albedo"), "RGB", 'COLOR', "volley.denoising_store_passes"),
    Pass(21, ("Denoising Normal", "Denoising Normal"), "XYZ", 'VECTOR', "volley.denoising_store_passes"),
    Pass(22, ("Denoising Depth", "Denoising Depth"), "Z", 'VALUE', "volley.denoising_store_passes"),
    Pass(18, ("Debug Sample Count", "Debug Sample Count"), "X", 'VALUE',
         "volley.use_pass_sample_count"),
)
COMBINED = PASSES[0]

# By TRC_CRYPTOMATTE_*: name, setting of the view layer.
CRYPTOMATTES = (("CryptoObject", "use_pass_cryptomatte_object"),
                ("CryptoMaterial", "use_pass_cryptomatte_material"),
                ("CryptoAsset", "use_pass_cryptomatte_asset"))
_FIRST_CRYPTOMATTE, _MOST_LAYERS = 128, 8  # TRC_PASS_CRYPTOMATTE
_LAYER_RANKS = 2

# By the type of an AOV: TRC_PASS_AOV_*, channels, kind of pass.
_AOVS = {'VALUE': (64, "X", 'VALUE'), 'COLOR': (80, "RGBA", 'COLOR')}
_MOST_AOVS = 16

_FIRST_LIGHT_GROUP, _MOST_LIGHT_GROUPS = 96, 32  # TRC_PASS_LIGHT_GROUP


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
        if aov.is_valid and counts[aov.type] < _MOST_AOVS:
            numbers[aov.name] = aov.type, counts[aov.type]
            counts[aov.type] += 1
    return numbers


def _aovs(view_layer):
    for name, (aov_type, number) in aov_numbers(view_layer).items():
        first, channels, kind = _AOVS[aov_type]
        yield Pass(first + number, (name, name), channels, kind, "aovs")


def light_group_numbers(view_layer):
    """{name: number from 1 on} of the light groups of a view layer."""
    names = [group.name for group in view_layer.lightgroups[:_MOST_LIGHT_GROUPS]]
    return {name: number + 1 for number, name in enumerate(names)}


def left_out(view_layer):
    """Messages about AOVs and light groups that are more than the library has room for."""
    aovs = [aov.name for aov in view_layer.aovs if aov.is_valid]
    groups = [group.name for group in view_layer.lightgroups]
    kept_aovs, kept_groups = aov_numbers(view_layer), light_group_numbers(view_layer)
    return [f"AOV '{name}': there are more than {_MOST_AOVS} of its type, it is left out"
            for name in aovs if name not in kept_aovs] + [
        f"Light group '{name}': there are more than {_MOST_LIGHT_GROUPS}, it is left out"
        for name in groups if name not in kept_groups]


def _light_groups(view_layer):
    for name, number in light_group_numbers(view_layer).items():
        yield Pass(_FIRST_LIGHT_GROUP + number - 1, (f"Combined_{name}",) * 2, "RGB", 'COLOR',
                   "lightgroups")


def _cryptomatte_layers(view_layer):
    """Channels in small letters: so Blender's OpenEXR writer knows that they must not be changed."""
    ranks = min(view_layer.pass_cryptomatte_depth, _LAYER_RANKS * _MOST_LAYERS)
    for kind, (name, setting) in enumerate(CRYPTOMATTES):
        if getattr(view_layer, setting):
            for layer in range((ranks + 1) // _LAYER_RANKS):
                index = _FIRST_CRYPTOMATTE + kind * _MOST_LAYERS + layer
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
    layers = [divmod(entry.index - _FIRST_CRYPTOMATTE, _MOST_LAYERS) for entry in entries
              if entry.index >= _FIRST_CRYPTOMATTE]
    aov_counts = [sum(first <= entry.index < first + _MOST_AOVS for entry in entries)
                  for first, _, _ in _AOVS.values()]
    return {
        "passes": sum(1 << entry.index for entry in entries if entry.index < _AOVS['VALUE'][0]),
        "aov_value_count": aov_counts[0], "aov_color_count": aov_counts[1],
        "light_group_count": sum(_FIRST_LIGHT_GROUP <= entry.index < _FIRST_CRYPTOMATTE
                                 for entry in entries),
        "cryptomattes": sum(1 << kind for kind in {kind for kind, _ in layers}),
        "cryptomatte_depth": _LAYER_RANKS * max((layer + 1 for _, layer in layers), default=0),
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

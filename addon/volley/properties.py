# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the engine: ``scene.volley`` and ``view_layer.volley``. Names are part of the interface.

Where Cycles has a setting of the same meaning, the default is Cycles' own, so that a file looks the
same in both engines without touching anything.
"""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from . import passes

SINGLE_SAMPLE = 1    # default of the integrators without distribution
DISTRIBUTION_SAMPLES = 64

INTEGRATOR_ITEMS = (
    ('RAYCAST', "Ray Casting", "Camera rays and shadow rays: direct light alone"),
    ('WHITTED', "Whitted", "Ideal reflection and refraction, both branches traced; hard shadows"),
    ('DISTRIBUTION', "Distribution", "Soft shadows, gloss, depth of field and motion blur by "
                                     "distributing rays over light, lobe, lens and time"),
)
ASSEMBLY_ITEMS = (
    ('AUTO', "Automatic", "Let the library choose"),
    ('TYPES', "Ray Types", "Packets of shadow, reflection and refraction rays apart"),
    ('RUNS', "Runs", "Packets of neighbours that hit the same material"),
    ('GROUPS', "Groups", "Packets by material over the whole packet"),
    ('OCTANTS', "Octants", "Packets by the signs of the direction"),
    ('BLIND', "Blind", "Packets in the order the rays arise"),
    ('NONE', "None", "Every secondary ray alone"),
)
PACKET_ITEMS = (
    ('AUTO', "Automatic", "Let the library choose"),
    ('4', "2 x 2", "4 rays in a packet"),
    ('16', "4 x 4", "16 rays in a packet"),
    ('64', "8 x 8", "64 rays in a packet"),
    ('256', "16 x 16", "256 rays in a packet where they stay together, 64 elsewhere"),
)
SAMPLER_ITEMS = (
    ('SOBOL', "Sobol", "Joint Owen-scrambled Sobol sequence"),
    ('SUDOKU', "Interleaved", "One sample set on a tile of pixels, interleaved; static over time"),
    ('JITTER', "Jittered", "Stratified samples"),
    ('INDEPENDENT', "Independent", "Random samples, as a reference"),
    ('BLUE_NOISE', "Blue Noise", "Sobol with blue-noise ordering over the screen"),
)
GUIDE_ITEMS = (
    ('RGB', "None", "The picture alone: textures and edges lose sharpness where there is noise"),
    ('RGB_ALBEDO', "Albedo", "The colours of surfaces, too: textures stay sharp"),
    ('RGB_ALBEDO_NORMAL', "Albedo and Normal", "Normals and depth, too: shapes stay sharp"),
)
AO_METHOD_ITEMS = (
    ('REPLACE', "Replace", "The world's light, which only near objects keep away from diffuse surfaces"),
    ('ADD', "Add", "White light on diffuse surfaces besides all other"),
)
TEXTURE_LIMIT_ITEMS = (
    ('CYCLES', "As in Cycles", "The limit among the settings of Cycles, where there are any"),
    ('OFF', "No Limit", "Images of any size"),
    *((str(size), str(size), f"Images of at most {size} pixels a side")
      for size in (128, 256, 512, 1024, 2048, 4096, 8192)),
)
FILTER_ITEMS = (
    ('BOX', "Box", "Box filter"),
    ('GAUSSIAN', "Gaussian", "Gaussian filter"),
    ('BLACKMAN_HARRIS', "Blackman-Harris", "Blackman-Harris filter"),
)


def _changed(_settings, _context):
    """An update function, even an empty one, makes Blender tell the depsgraph of an edit by script;
    without it, viewports and persistent data would not notice."""


def _integrator_changed(settings, _context):
    """Follow the integrator's own default number of samples, unless the user chose another."""
    before, after = SINGLE_SAMPLE, DISTRIBUTION_SAMPLES
    if settings.integrator != 'DISTRIBUTION':
        before, after = after, before
    if settings.samples == before:
        settings.samples = after


class VolleySceneSettings(bpy.types.PropertyGroup):
    """Render settings, ``scene.volley``."""

    integrator: EnumProperty(
        name="Integrator", items=INTEGRATOR_ITEMS, default='DISTRIBUTION', update=_integrator_changed,
        description="What is modelled")
    samples: IntProperty(
        name="Samples", default=DISTRIBUTION_SAMPLES, min=1, max=1 << 20, soft_max=4096,
        description="Samples of each pixel in the final render", update=_changed)
    preview_samples: IntProperty(
        name="Samples", default=32, min=1, max=1 << 20, soft_max=4096,
        description="Samples of each pixel in the viewport", update=_changed)
    preview_pause: BoolProperty(
        name="Pause Viewport", default=False, update=_changed,
        description="Stop rendering in all viewports; what is on the screen stays")
    light_samples: IntProperty(
        name="Light Samples", default=0, min=0, max=64,
        description="Shadow rays at each point the camera sees; 0 lets the library choose",
        update=_changed)
    extra_samples: FloatProperty(
        name="Extra Samples", default=0.25, min=0.0, max=1.0, subtype='FACTOR',
        description="Share of all rays that the final render takes besides, where noise remains once every "
                    "pixel has its samples: few pixels get 2, 4 or 8 times as many. Not with a noise threshold or "
                    "a time limit, nor of parts", update=_changed)
    use_adaptive_sampling: BoolProperty(
        name="Use Adaptive Sampling", default=False,
        description="Stop sampling a pixel when its estimated noise is low enough", update=_changed)
    noise_threshold: FloatProperty(
        name="Noise Threshold", default=0.01, min=0.0, max=1.0, soft_min=0.001, precision=4,
        description="Noise at which sampling stops; lower is better and slower. 0 chooses by the "
                    "number of samples", update=_changed)
    adaptive_min_samples: IntProperty(
        name="Min Samples", default=0, min=0, max=4096,
        description="Samples of each pixel before noise is judged, to discover noisy features; "
                    "rounded up to a power of two. 0 chooses by the noise threshold",
        update=_changed)
    use_preview_adaptive_sampling: BoolProperty(
        name="Use Adaptive Sampling", default=False,
        description="Stop sampling a pixel of the viewport when its estimated noise is low enough",
        update=_changed)
    preview_noise_threshold: FloatProperty(
        name="Noise Threshold", default=0.1, min=0.0, max=1.0, soft_min=0.001, precision=4,
        description="Noise at which sampling stops in the viewport; lower is better and slower. 0 "
                    "chooses by the number of samples", update=_changed)
    preview_adaptive_min_samples: IntProperty(
        name="Min Samples", default=0, min=0, max=4096,
        description="Samples of each pixel of the viewport before noise is judged; rounded up to a "
                    "power of two. 0 chooses by the noise threshold", update=_changed)
    time_limit: FloatProperty(
        name="Time Limit", default=0.0, min=0.0, step=100, unit='TIME_ABSOLUTE',
        description="Most seconds of rendering for each view layer, without synchronizing and building: the "
                    "picture has the samples that were taken by then, one of each pixel at least. 0 is no "
                    "limit", update=_changed)
    use_denoising: BoolProperty(
        name="Denoise", default=False,
        description="Take the noise out of the picture once it has all samples, not one that Esc or a time "
                    "limit ends before; with more samples it goes to the same limit as without",
        update=_changed)
    use_preview_denoising: BoolProperty(
        name="Denoise", default=False,
        description="Take the noise out of the viewport's picture, quickly while it gathers samples and as final "
                    "renders once it has all; not in scenes with shadow catchers before it has all",
        update=_changed)
    denoising_input_passes: EnumProperty(
        name="Passes", items=GUIDE_ITEMS, default='RGB_ALBEDO_NORMAL', description="What denoising goes by",
        update=_changed)
    preview_denoising_input_passes: EnumProperty(
        name="Passes", items=GUIDE_ITEMS, default='RGB_ALBEDO_NORMAL',
        description="What denoising of the viewport goes by", update=_changed)
    preview_denoising_start_sample: IntProperty(
        name="Start Sample", default=1, min=0, max=(1 << 20),
        description="Samples of the viewport's picture from which on it is shown without its noise",
        update=_changed)
    sampler: EnumProperty(
        name="Sampler", items=SAMPLER_ITEMS, default='SOBOL', description="Where samples are taken",
        update=_changed)
    seed: IntProperty(
        name="Seed", default=0, min=0, description="Another number gives other noise", update=_changed)
    sample_offset: IntProperty(
        name="Sample Offset", default=0, min=0, max=(1 << 20) - 1,
        description="First sample of a part of the picture, counted from 0; parts are put together by the "
                    "command line of farms", update=_changed)
    sample_subset: IntProperty(
        name="Sample Subset", default=0, min=0, max=1 << 20,
        description="Samples of a part of the picture; 0 is all from the first on", update=_changed)
    use_animated_seed: BoolProperty(
        name="Animate Seed", default=False, description="Other noise on every frame", update=_changed)

    max_depth: IntProperty(
        name="Total", default=50, min=0, max=1024, soft_max=64,
        description="Most bounces of a ray; 0 is direct light alone", update=_changed)
    max_glossy_depth: IntProperty(
        name="Glossy", default=50, min=0, max=1024, soft_max=64, description="Most reflections of a ray",
        update=_changed)
    max_transmission_depth: IntProperty(
        name="Transmission", default=50, min=0, max=1024, soft_max=64,
        description="Most refractions of a ray", update=_changed)
    max_transparent_depth: IntProperty(
        name="Transparent", default=8, min=0, max=1024, soft_max=64,
        description="Most transparent surfaces a ray passes straight", update=_changed)
    attenuation_cutoff: FloatProperty(
        name="Attenuation Cutoff", default=0.001, min=0.0, max=1.0, precision=4,
        description="Rays that would add less than this to the picture are not followed. Distribution "
                    "decides by chance instead, without bias", update=_changed)
    clamp_direct: FloatProperty(
        name="Direct Light", default=0.0, min=0.0, soft_max=100.0,
        description="Largest value of direct light in a sample; 0 is no limit", update=_changed)
    clamp_indirect: FloatProperty(
        name="Indirect Light", default=10.0, min=0.0, soft_max=100.0,
        description="Largest value of reflected light in a sample; 0 is no limit", update=_changed)
    filter_glossy: FloatProperty(
        name="Filter Glossy", default=1.0, min=0.0, max=10.0,
        description="Blur reflections seen in reflections, for less noise; 0 is off", update=_changed)
    use_ambient_occlusion: BoolProperty(
        name="Ambient Occlusion", default=False,
        description="Light diffuse surfaces where nothing is near, a cheap stand-in for light between "
                    "surfaces. Factor and distance are the world's", update=_changed)
    ao_method: EnumProperty(
        name="Method", items=AO_METHOD_ITEMS, default='ADD', description="What light it is",
        update=_changed)

    assembly: EnumProperty(
        name="Packet Assembly", items=ASSEMBLY_ITEMS, default='AUTO',
        description="How secondary rays are put into packets", update=_changed)
    packet_size: EnumProperty(
        name="Packet Size", items=PACKET_ITEMS, default='AUTO', description="Rays in a packet",
        update=_changed)
    texture_memory: IntProperty(
        name="Texture Limit", default=0, min=0, soft_max=65536, max=0xFFFFFF,
        description="Most memory for images, MiB: where more are used, the largest are shown at half their "
                    "size, again and again. 0 for no limit; taken by renders and views that start",
        update=_changed)

    texture_limit: EnumProperty(
        name="Viewport Texture Limit", items=TEXTURE_LIMIT_ITEMS, default='CYCLES', update=_changed,
        description="Largest size of images in the viewport, while Simplify is on")
    texture_limit_render: EnumProperty(
        name="Render Texture Limit", items=TEXTURE_LIMIT_ITEMS, default='CYCLES', update=_changed,
        description="Largest size of images in renders, while Simplify is on")
    is_cycles_answered: BoolProperty(
        name="Settings of Cycles", default=False, options={'HIDDEN'},
        description="Whether the user has chosen to take over Cycles' settings, or not to")

    film_exposure: FloatProperty(
        name="Exposure", default=1.0, min=0.0, soft_max=10.0, description="Factor on all light",
        update=_changed)
    film_transparent_glass: BoolProperty(
        name="Transparent Glass", default=False, update=_changed,
        description="Where the film is transparent, show glass over the footage, too: the background is seen "
                    "through it")
    film_transparent_roughness: FloatProperty(
        name="Roughness Threshold", default=0.1, min=0.0, max=1.0, update=_changed,
        description="Glass that is rougher hides the background")
    pixel_filter_type: EnumProperty(
        name="Filter Type", items=FILTER_ITEMS, default='BLACKMAN_HARRIS', description="Pixel filter",
        update=_changed)
    filter_width: FloatProperty(
        name="Width", default=1.5, min=0.01, max=10.0, subtype='PIXEL',
        description="Width of the pixel filter", update=_changed)


class VolleyViewLayerSettings(bpy.types.PropertyGroup):
    """Settings of a view layer, ``view_layer.volley``."""

    use_pass_sample_count: BoolProperty(
        name="Sample Count", default=False, description="Deliver the number of samples of each pixel",
        update=_changed)
    use_pass_shadow_catcher: BoolProperty(
        name="Shadow Catcher", default=False,
        description="Deliver what shadow catchers leave of the light, to multiply the footage by, and "
        "Combined without their shadows", update=_changed)
    denoising_store_passes: BoolProperty(
        name="Denoising Data", default=False,
        description="Deliver albedo, normal and depth for the compositor's Denoise node",
        update=_changed)


class VolleyViewSettings(bpy.types.PropertyGroup):
    """Settings of a 3D view, ``space.shading.volley``."""

    render_pass: EnumProperty(
        name="Render Pass", default=passes.COMBINED.index.name, description="What the viewport shows",
        items=tuple((name, entry.names[1], "") for name, entry in passes.SHOWN_PASSES.items()))


_classes = (VolleySceneSettings, VolleyViewLayerSettings, VolleyViewSettings)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.volley = PointerProperty(type=VolleySceneSettings, name="Volley Settings")
    bpy.types.ViewLayer.volley = PointerProperty(type=VolleyViewLayerSettings, name="Volley Settings")
    bpy.types.View3DShading.volley = PointerProperty(type=VolleyViewSettings, name="Volley Settings")


def unregister():
    del bpy.types.View3DShading.volley
    del bpy.types.ViewLayer.volley
    del bpy.types.Scene.volley
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)

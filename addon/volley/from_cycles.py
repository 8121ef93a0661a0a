# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings taken over from Cycles, for a file that was made with it."""

import bpy
from bpy.types import Operator

# Settings of scene.cycles and those of scene.volley with the same meaning.
_COPIED = (
    ("samples", "samples"), ("preview_samples", "preview_samples"), ("time_limit", "time_limit"),
    ("use_adaptive_sampling", "use_adaptive_sampling"), ("adaptive_threshold", "noise_threshold"),
    ("adaptive_min_samples", "adaptive_min_samples"),
    ("use_preview_adaptive_sampling", "use_preview_adaptive_sampling"),
    ("preview_adaptive_threshold", "preview_noise_threshold"),
    ("preview_adaptive_min_samples", "preview_adaptive_min_samples"),
    ("use_denoising", "use_denoising"), ("use_preview_denoising", "use_preview_denoising"),
    ("denoising_input_passes", "denoising_input_passes"),
    ("preview_denoising_input_passes", "preview_denoising_input_passes"),
    ("preview_denoising_start_sample", "preview_denoising_start_sample"),
    ("seed", "seed"), ("use_animated_seed", "use_animated_seed"),
    ("max_bounces", "max_depth"), ("glossy_bounces", "max_glossy_depth"),
    ("transmission_bounces", "max_transmission_depth"), ("transparent_max_bounces", "max_transparent_depth"),
    ("sample_clamp_direct", "clamp_direct"), ("sample_clamp_indirect", "clamp_indirect"),
    ("blur_glossy", "filter_glossy"), ("use_fast_gi", "use_ambient_occlusion"),
    ("fast_gi_method", "ao_method"), ("film_exposure", "film_exposure"),
    ("film_transparent_glass", "film_transparent_glass"),
    ("film_transparent_roughness", "film_transparent_roughness"),
    ("pixel_filter_type", "pixel_filter_type"), ("filter_width", "filter_width"),
    ("texture_limit", "texture_limit"), ("texture_limit_render", "texture_limit_render"),
)

# Settings without one, the value that changes nothing, and what they are called.
_UNMATCHED = (
    ("diffuse_bounces", 0, "Diffuse Bounces"), ("volume_bounces", 0, "Volume Bounces"),
    ("min_light_bounces", 0, "Min Light Bounces"), ("min_transparent_bounces", 0, "Min Transparent Bounces"),
    ("light_sampling_threshold", 0.0, "Light Threshold"), ("use_guiding", False, "Path Guiding"),
    ("sample_offset", 0, "Sample Offset"),
    ("scrambling_distance", 1.0, "Scrambling Distance"),
    ("caustics_reflective", True, "Reflective Caustics"), ("caustics_refractive", True, "Refractive Caustics"),
    ("use_layer_samples", 'USE', "Layer Samples"), ("use_pixel_jitter", False, "Pixel Jitter"),
    ("texture_resolution", 1.0, "Texture Resolution"),
    ("ao_bounces", 1, "AO Bounces"), ("ao_bounces_render", 1, "AO Bounces (Render)"),
    ("texture_resolution_render", 1.0, "Texture Resolution (Render)"),
)


def _settings_of(scene):
    return getattr(scene, "cycles", None)


def is_offered(scene):
    """Whether to offer it: for a scene with settings of Cycles' and none of ours, until the user chooses."""
    theirs, ours = _settings_of(scene), scene.volley
    return theirs is not None and not ours.is_cycles_answered \
        and any(theirs.is_property_set(name) for name, _ in _COPIED if hasattr(theirs, name)) \
        and not any(ours.is_property_set(name) for _, name in _COPIED)


def copy(scene):
    """Take over what there is a setting for; the names of what else changes the picture."""
    theirs, ours = _settings_of(scene), scene.volley
    for source, target in _COPIED:
        if hasattr(theirs, source):
            setattr(ours, target, getattr(theirs, source))
    if theirs.pixel_filter_type == 'BOX':
        ours.filter_width = 1.0  # Cycles' box has no other width
    ours.is_cycles_answered = True
    left = []
    for name, neutral, label in _UNMATCHED:
        if getattr(theirs, name, neutral) == neutral:
            continue
        if hasattr(ours, name):
            setattr(ours, name, getattr(theirs, name))
        else:
            left.append(label)
    return left


class VOLLEY_OT_copy_cycles_settings(Operator):
    """Take over samples, bounces, clamps, filter, exposure and the like from this scene's Cycles settings"""

    bl_idname = "volley.copy_cycles_settings"
    bl_label = "Copy Settings from Cycles"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return _settings_of(context.scene) is not None

    def execute(self, context):
        left = copy(context.scene)
        without = f"; Volley has nothing for {', '.join(left)}" if left else ""
        self.report({'INFO'}, f"Settings copied from Cycles{without}")
        return {'FINISHED'}


class VOLLEY_OT_keep_settings(Operator):
    """Keep Volley's settings as they are, and do not ask again in this scene"""

    bl_idname = "volley.keep_settings"
    bl_label = "Keep Volley's Settings"
    bl_options = {'REGISTER', 'UNDO'}

    def execute(self, context):
        context.scene.volley.is_cycles_answered = True
        return {'FINISHED'}


def draw_offer(layout, scene):
    """The question, while it stands."""
    if not is_offered(scene):
        return
    box = layout.box().column(align=True)
    box.label(text="This scene has settings of Cycles", icon='INFO')
    row = box.row(align=True)
    row.operator(VOLLEY_OT_copy_cycles_settings.bl_idname, text="Copy Them")
    row.operator(VOLLEY_OT_keep_settings.bl_idname, text="Keep Volley's")


_classes = (VOLLEY_OT_copy_cycles_settings, VOLLEY_OT_keep_settings)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)

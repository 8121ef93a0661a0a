# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the Sampling panel: Volley's own, and the user's."""

import os

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.types import Operator, Panel

_SUBDIRECTORY = "volley/sampling"
_OWN = os.path.join(os.path.dirname(__file__), "sampling")
_SAVED = ("integrator", "samples", "preview_samples", "light_samples", "extra_samples", "use_adaptive_sampling",
          "noise_threshold", "adaptive_min_samples", "use_preview_adaptive_sampling",
          "preview_noise_threshold", "preview_adaptive_min_samples", "time_limit", "use_denoising",
          "use_preview_denoising", "preview_denoising_start_sample",
          "denoising_input_passes", "preview_denoising_input_passes", "sampler")


class VOLLEY_PT_sampling_presets(PresetPanel, Panel):
    bl_label = "Sampling Presets"
    preset_subdir = _SUBDIRECTORY
    preset_operator = "script.execute_preset"
    preset_add_operator = "volley.sampling_preset_add"
    COMPAT_ENGINES = {'VOLLEY'}

    def draw(self, context):
        layout = self.layout
        layout.emboss = 'PULLDOWN_MENU'
        layout.operator_context = 'EXEC_DEFAULT'
        self.path_menu([_OWN, *bpy.utils.preset_paths(_SUBDIRECTORY)], self.preset_operator,
                       filter_ext=lambda extension: extension == ".py", add_operator=self.preset_add_operator)


class VOLLEY_OT_sampling_preset_add(AddPresetBase, Operator):
    """Add or remove a preset of the settings of sampling"""

    bl_idname = "volley.sampling_preset_add"
    bl_label = "Add Sampling Preset"
    preset_menu = "VOLLEY_PT_sampling_presets"
    preset_subdir = _SUBDIRECTORY
    preset_defines = ["volley = bpy.context.scene.volley"]
    preset_values = [f"volley.{name}" for name in _SAVED]


_classes = (VOLLEY_PT_sampling_presets, VOLLEY_OT_sampling_preset_add)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)

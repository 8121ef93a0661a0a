# SPDX-License-Identifier: Apache-2.0
"""Whole files: a first F12 of scenes that others made, and of generated ones with many objects, lights, glass,
leaves and triangles in motion."""

from . import elsewhere, whole_renders
from .scope import FOLDER_FILES, picture_folders
from .tables import digits

SIZE_PX = 640, 480


def measure(options, scope, pictures):
    """As whole_renders.measure(); PNGs of both into a folder."""
    folders = picture_folders(scope.file_scenes, FOLDER_FILES, options, pictures) if scope.file_scenes else {}
    return whole_renders.measure(folders, SIZE_PX, options, scope)


def headlines(results):
    """The least and the most gain beside each Blender's Cycles."""
    lines = []
    for cycles, made in elsewhere.beside(results, "files"):
        ratios = [gain["ratio"] for _name, gain in whole_renders.gains(made)]
        errors = sorted(whole_renders.error_ratios(engines)["mse"] for engines in made.values())
        lines.append(f"A first F12 of {len(ratios)} whole files at {SIZE_PX[0]}×{SIZE_PX[1]} and "
                     f"{whole_renders.SAMPLES} samples takes {cycles} {digits(ratios[0], 2)} to "
                     f"{digits(ratios[-1], 2)} times as long; Volley's MSE is {digits(errors[0], 2)} to "
                     f"{digits(errors[-1], 2)} of its.")
    return lines


def losses(results):
    """Scenes in which Cycles is done sooner, or has the smaller error."""
    return [line for cycles, made in elsewhere.beside(results, "files")
            for line in whole_renders.losses(made, cycles)]


def section(results):
    """Seconds and errors of each scene, a table for each Blender."""
    tables = [f"{cycles}:\n\n{whole_renders.section_table(made)}" for cycles, made in elsewhere.beside(results, "files")]
    if not tables:
        return ""
    return "\n\n".join([
        "## Whole files",
        f"A first F12 in a new Blender at {SIZE_PX[0]}×{SIZE_PX[1]} and {whole_renders.SAMPLES} samples, none extra: "
        "evaluation, sync, build and rays. Errors are against a Cycles picture of more samples, the same for both.", *tables])

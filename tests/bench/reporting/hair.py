# SPDX-License-Identifier: Apache-2.0
"""Hair, fur and grass: a first F12, in which Blender grows the strands, too."""

from . import whole_renders
from .tables import digits

SIZE_PX = 240, 180


def measure(options, scope, pictures):
    """As whole_renders.measure(); PNGs of both into a folder."""
    return whole_renders.measure(dict.fromkeys(scope.hair_scenes, pictures), SIZE_PX, options, scope)


def headline(results):
    """The least and the most gain."""
    ratios = [gain["ratio"] for _name, gain in whole_renders.gains(results)]
    return (f"With {len(ratios)} scenes of hair, a first F12 of {whole_renders.SAMPLES} samples takes Cycles "
            f"{digits(ratios[0], 2)} to {digits(ratios[-1], 2)} times as long.")


def losses(results):
    """Scenes in which Cycles is done sooner, or has the smaller error."""
    return whole_renders.losses(results)


def section(results):
    """Seconds and errors of each scene."""
    return "\n\n".join([
        "## Hair",
        f"A first F12 in a new Blender at {SIZE_PX[0]}×{SIZE_PX[1]} and {whole_renders.SAMPLES} samples: Blender's "
        "growing of the strands, sync, build and rays. Errors are against a Cycles picture of more samples, the same "
        "for both.",
        whole_renders.section_table(results)])

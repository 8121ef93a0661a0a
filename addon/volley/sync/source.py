# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a sync reads from."""

from dataclasses import dataclass, field

from .changes import Changes


class Cancelled(Exception):
    """The user stopped the sync."""


@dataclass
class Source:
    """Where a sync reads from. engine: moves the scene in time for motion blur, else None; v3d: the
    viewport whose visibility counts, None for a render; aovs: {name: (type, number)} and light_groups:
    {name: number} of those that are rendered; is_cancelled: asked now and then; culling: culling.Culling or
    None; dicing: dicing.Dicing or None."""

    depsgraph: object
    changes: Changes
    engine: object = None
    v3d: object = None
    needs_uv: bool = False
    aovs: dict = field(default_factory=dict)
    light_groups: dict = field(default_factory=dict)
    is_cancelled: object = staticmethod(lambda: False)
    culling: object = None
    dicing: object = None

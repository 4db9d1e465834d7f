# SPDX-License-Identifier: Apache-2.0
"""Wings of a revolving door: four, on a post in the middle of the drum."""

from __future__ import annotations

import math

from doorstate.simulation.scene.box import Box, place
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.fittings import with_pane
from doorstate.simulation.scene.leaf import finished, leaf_slab
from doorstate.types import Part

_POST_M = 0.08
_WING_GAP_M = 0.02
_STILE_M = 0.08
_QUARTER_RAD = math.pi / 2
_GLAZED_ORDER = (0, 2, 1, 3)  # opposite wings first


def revolving_wings(door: Door, share: float) -> list[Box]:
    """Return the post and the wings; at a share of 0 the wings meet the ends of the drum's walls."""
    slab = leaf_slab(door, 1.0)
    z, height = slab.center_m[2], slab.size_m[2]
    length = door.opening_width_m / 2 - _POST_M / 2 - _WING_GAP_M
    wing = Box(Part.LEAF, (_POST_M / 2 + length / 2, 0.0, z), (length, door.leaf_thickness_m, height))
    framed = with_pane(wing, (_STILE_M, _STILE_M), _STILE_M, z - height / 2 + 2 * _STILE_M)
    glazed = _GLAZED_ORDER[: door.glass_panels or 0]
    boxes = [Box(Part.LEAF, (0.0, 0.0, z), (_POST_M, _POST_M, height))]
    for number in range(4):
        boxes += place(
            framed if number in glazed else [wing], 0.0, 0.0, (number + 0.5 + share) * _QUARTER_RAD
        )
    return place(finished(door, boxes), 0.0, -door.wall_thickness_m / 2, 0.0)

# SPDX-License-Identifier: Apache-2.0
"""Share of a door that is hidden by clutter in front of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.render import render, render_behind_glass
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.scene import Scene, box_groups
from doorstate.simulation.visibility import looks_into, opening_depth_m
from doorstate.types import Part

BINS = ("0", "0-25", "25-50", "50-75", "75-100")  # per cent
_NEGLIGIBLE = 0.01
_COLUMNS = 160


class DoorView:
    """The pixels that see the main door without clutter: its leaf, its frame, and through its opening.

    The image has 160 columns and a centred camera: shares hardly differ from those of the full image, and are fast.
    """

    def __init__(
        self,
        scene: Scene,
        opening: Opening,
        pose: CameraPose,
        camera: DepthCamera,
        other_openings: Sequence[Opening] = (),
    ) -> None:
        assert scene.door is not None
        height = round(_COLUMNS * camera.height / camera.width)
        size = {"width": _COLUMNS, "height": height, "cx_px": None, "cy_px": None}
        self._pose, self._intrinsics = pose, camera.model_copy(update=size).intrinsics()
        uncluttered = scene.without_clutter()
        groups = box_groups(uncluttered, opening, other_openings)
        rendered = render_behind_glass(groups.all(), pose, self._intrinsics)
        width_m, height_m = scene.door.opening_width_m, scene.door.opening_height_m
        opening_m = opening_depth_m(pose, self._intrinsics, width_m, height_m)
        solid = (rendered.part == Part.LEAF) | (rendered.part == Part.FRAME)
        solid &= rendered.box < len(groups.main)
        self._door = solid | looks_into(rendered.depth_m, opening_m)
        # Objects in the room behind do not hide the opening.
        self._depth = np.where(solid, rendered.depth_m, np.fmin(rendered.depth_m, opening_m))

    def occluded_share(self, clutter: list[Box]) -> float:
        """Return the share of the door's pixels that the boxes hide; 0 if no pixel sees the door."""
        hidden = self._door & (render(clutter, self._pose, self._intrinsics).depth_m < self._depth)
        return round(int(hidden.sum()) / max(int(self._door.sum()), 1), 6)


def occluded_bin(share: float) -> str:
    """Return the name of the bin; less than 1 % counts as 0, and an upper edge belongs to its bin."""
    if share < _NEGLIGIBLE:
        return BINS[0]
    return BINS[1 + int(np.searchsorted((0.25, 0.5, 0.75), share))]

# SPDX-License-Identifier: Apache-2.0
"""How much of a door is hidden by what stands before it."""

from __future__ import annotations

import numpy as np

from doorstate.simulation.doors import Opening
from doorstate.simulation.frames import looks_into, opening_depth_m
from doorstate.simulation.scene import Box
from doorstate.simulation.scenes import Scene, scene_boxes
from doorstate.simulation.sensor import CameraPose, DepthCamera, render, render_behind_glass
from doorstate.types import Part

BINS = ("0", "0-25", "25-50", "50-75", "75-100")  # per cent
_AS_GOOD_AS_NOTHING = 0.01
_COLUMNS = 160


class DoorView:
    """The pixels of a door that nothing stands before: those of its leaf, of its frame, and into its opening.

    The image is that of the camera with 160 columns and centred: shares are much the same in the others, and take time.
    """

    def __init__(self, scene: Scene, opening: Opening, pose: CameraPose, camera: DepthCamera) -> None:
        assert scene.door is not None
        height = round(_COLUMNS * camera.height / camera.width)
        size = {"width": _COLUMNS, "height": height, "cx_px": None, "cy_px": None}
        self._pose, self._intrinsics = pose, camera.model_copy(update=size).intrinsics()
        alone = scene.model_copy(update={"items": ()})
        seen = render_behind_glass(scene_boxes(alone, opening), pose, self._intrinsics)
        width_m, height_m = scene.door.opening_width_m, scene.door.opening_height_m
        opening_m = opening_depth_m(pose, self._intrinsics, width_m, height_m)
        solid = (seen.part == Part.LEAF) | (seen.part == Part.FRAME)
        self._door = solid | looks_into(seen.depth_m, opening_m)
        # What stands in the room behind hides nothing of an opening.
        self._depth = np.where(solid, seen.depth_m, np.fmin(seen.depth_m, opening_m))

    def occluded_share(self, clutter: list[Box]) -> float:
        """Share of the pixels that the boxes hide; 0 where no pixel sees the door."""
        hidden = self._door & (render(clutter, self._pose, self._intrinsics).depth_m < self._depth)
        return round(int(hidden.sum()) / max(int(self._door.sum()), 1), 6)


def occluded_bin(share: float) -> str:
    """Name of the bin; less than 1 % is nothing, and an upper edge belongs to its bin."""
    if share < _AS_GOOD_AS_NOTHING:
        return BINS[0]
    return BINS[1 + int(np.searchsorted((0.25, 0.5, 0.75), share))]

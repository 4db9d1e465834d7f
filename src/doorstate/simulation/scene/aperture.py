# SPDX-License-Identifier: Apache-2.0
"""Apertures without a door in the walls of a room: windows, passages and niches."""

from __future__ import annotations

import math
from typing import Literal, get_args

from pydantic import Field

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.box import Box, Pose, place
from doorstate.simulation.scene.placed_door import WallName, wall_pose
from doorstate.simulation.scene.room import OUTDOORS, Space, space_boxes
from doorstate.simulation.scene.wall import Gap
from doorstate.simulation.scene.window import CASEMENT_M, sash_boxes
from doorstate.types import Part

ApertureKind = Literal["window", "passage", "niche"]
APERTURES: tuple[ApertureKind, ...] = get_args(ApertureKind)

_LINING_M = 0.05


class Aperture(FrozenModel):
    """A hole in a wall and what fills it; `along_m` is the x of its middle in the frame of its wall.

    A window has `sashes` side by side; the first is turned into the room by `sash_deg`. A niche is `depth_m` deep.
    """

    kind: ApertureKind
    wall: WallName
    along_m: Metres
    width_m: Metres
    bottom_m: Metres = 0.0
    top_m: Metres
    wall_thickness_m: Metres
    depth_m: Metres = 0.0
    sashes: int = Field(default=1, ge=0, le=10)
    sash_deg: Degrees = 0.0
    beyond: Space = OUTDOORS

    @property
    def gap(self) -> Gap:
        """The gap in the wall."""
        return Gap(self.along_m, self.width_m / 2, self.top_m, self.bottom_m)

    def pose(self, near: Space) -> Pose:
        """Return the frame of the aperture in that of the main door.

        Raises:
            ValueError: the room has no such wall.
        """
        return wall_pose(self.wall, near).after(Pose(self.along_m, 0.0, 0.0))


def aperture_boxes(aperture: Aperture, near: Space, height_m: float) -> list[Box]:
    """Return sashes or the lining of a niche, and the walls beyond, in the main door's frame."""
    own: list[Box] = []
    if aperture.kind == "window":
        own = _window(aperture)
    elif aperture.kind == "niche":
        own = _niche(aperture)
    if not aperture.beyond.is_outdoors:
        own = [*own, *space_boxes(aperture.beyond, -aperture.wall_thickness_m, -1, height_m)]
    return aperture.pose(near).place(own)


def _window(aperture: Aperture) -> list[Box]:
    if not aperture.sashes:
        return []
    width, y = aperture.width_m / aperture.sashes, -CASEMENT_M / 2 - 0.02
    boxes = []
    for number in range(aperture.sashes):
        sash = sash_boxes(width, aperture.bottom_m, aperture.top_m, y)
        left = number * width - aperture.width_m / 2
        if number or not aperture.sash_deg:
            boxes += place(sash, left + width / 2, 0.0, 0.0)
        else:
            # The hinge is on the sash's inner corner, so that it turns past the edge of the wall.
            hinged = place(sash, width / 2, CASEMENT_M / 2 - y, 0.0)
            boxes += place(hinged, left, 0.0, math.radians(aperture.sash_deg))
    return boxes


def _niche(aperture: Aperture) -> list[Box]:
    """Return back, cheeks, and where the niche needs them sill and head."""
    half, depth, low, top = aperture.width_m / 2, aperture.depth_m, aperture.bottom_m, aperture.top_m
    lining, height = _LINING_M, top - low + 2 * _LINING_M
    outer, middle_z = 2 * (half + lining), (low + top) / 2
    boxes = [Box(Part.WALL, (0.0, -depth - lining / 2, middle_z), (outer, lining, height))]
    for side in (1, -1):
        boxes.append(
            Box(Part.WALL, (side * (half + lining / 2), -depth / 2, middle_z), (lining, depth, height))
        )
    for z in (low - lining / 2, top + lining / 2):
        boxes.append(Box(Part.WALL, (0.0, -depth / 2, z), (2 * half, depth, lining)))
    return boxes

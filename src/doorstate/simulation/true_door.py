# SPDX-License-Identifier: Apache-2.0
"""A door of a simulated frame as it is: pose, sizes, state, and how much of it the frame shows."""

from __future__ import annotations

import math

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.draw.openings import state_of
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.clearance import passable_width_m
from doorstate.simulation.scene.door import Door, DoorKind, Opening
from doorstate.types import LabelledState, Swing


class VisiblePixels(FrozenModel):
    """Pixels that see the parts of one door."""

    leaf: int = 0
    frame: int = 0
    opening: int = 0  # through the opening, with nothing in front of it

    @property
    def total(self) -> int:
        """Pixels that see any of them."""
        return self.leaf + self.frame + self.opening


class TrueDoor(FrozenModel):
    """A door in the level sensor frame; `yaw_deg` is the direction of its x axis, 90 for a wall straight ahead."""

    x_m: Metres  # of the door frame's origin: middle of the opening, on the robot's face of the wall
    y_m: Metres
    yaw_deg: Degrees
    floor_z_m: Metres
    width_m: Metres
    height_m: Metres
    kind: DoorKind
    hinge: str  # of the active leaf; empty for a door without an angle
    swing: Swing
    state: LabelledState
    ambiguous: bool  # between the ranges of two states
    opening_angle_deg: Degrees | None  # of the active leaf; None for sliding, folding and revolving doors
    passive_angle_deg: Degrees | None  # of double doors only
    opening_share: float | None  # of these
    passable_width_m: Metres
    visible_px: VisiblePixels = VisiblePixels()


class OtherDoor(FrozenModel):
    """Opening of a door beside the main door, and what it looks like from the camera."""

    opening: Opening
    truth: TrueDoor


def describe_door(door: Door, opening: Opening, camera: Pose, camera_height_m: float) -> TrueDoor:
    """Return a door as the camera sees it, without counts of pixels.

    Args:
        door: door.
        opening: how far it is open.
        camera: position and heading in the door's frame.
        camera_height_m: height above the floor.
    """
    cos, sin = math.cos(camera.yaw_rad), math.sin(camera.yaw_rad)
    state, ambiguous = state_of(door, opening)
    return TrueDoor(
        # The camera's own frame has the door at R(-heading) (door - camera).
        x_m=-camera.x_m * cos - camera.y_m * sin,
        y_m=camera.x_m * sin - camera.y_m * cos,
        yaw_deg=math.degrees(math.remainder(-camera.yaw_rad, 2 * math.pi)),
        floor_z_m=-camera_height_m,
        width_m=door.opening_width_m,
        height_m=door.opening_height_m,
        kind=door.kind,
        hinge="" if door.opens_by_share else door.hinge,
        swing=door.swing,
        state=state,
        ambiguous=ambiguous,
        opening_angle_deg=None if door.opens_by_share else opening.angle_deg,
        passive_angle_deg=opening.passive_angle_deg if door.is_double else None,
        opening_share=opening.share if door.opens_by_share else None,
        passable_width_m=round(passable_width_m(door, opening), 4),
    )

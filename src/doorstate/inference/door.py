# SPDX-License-Identifier: Apache-2.0
"""Door of a prediction: its pose, its state or the reason why there is none, and its geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from doorstate.doorways.remoteness import remoteness_m
from doorstate.inference.abstention import Abstention
from doorstate.inference.answer import StateAnswer
from doorstate.inference.seen_through import Opening
from doorstate.types import DoorState, Hinge


class DoorFrame(NamedTuple):
    """Pose of the door frame in the sensor frame: the middle of the opening and the direction of the wall.

    The yaw is that of the wall towards its left; a wall straight ahead has 90 degrees.
    """

    x_m: float
    y_m: float
    yaw_deg: float


@dataclass(frozen=True)
class Door(StateAnswer):
    """One door in a cloud, in the level sensor frame, or a candidate that is refused.

    Numbers that the method does not estimate are None. Without a state there is no angle, hinge and passage; place and
    width are given in any case.

    Attributes:
        x_m, y_m: middle of the opening.
        yaw_deg: direction of the wall towards its left; a wall straight ahead has 90.
        width_m: of the opening.
        floor_z_m: height of the floor before the door.
        abstention: set exactly where `state` is None.
        raw_probabilities: of the network by state, even where its state is refused.
        door_probability: probability of a door at this place.
        hinge: side of the hinge as seen from the camera.
        hinge_probability: that the hinge is on this side.
        passable_width_m: free width between leaf and jamb.
        leaf_seen: False if no leaf was seen at an open door, so that a pane of glass cannot be excluded.
        position_error_m, yaw_error_deg, angle_error_deg: standard errors.
        score: of the candidate, by the search for doorways.
    """

    x_m: float
    y_m: float
    yaw_deg: float
    width_m: float
    state: DoorState | None
    abstention: Abstention | None = None
    raw_probabilities: Mapping[str, float] | None = None
    door_probability: float | None = None
    opening_angle_deg: float | None = None
    angle_error_deg: float | None = None
    hinge: Hinge | None = None
    hinge_probability: float | None = None
    passable_width_m: float | None = None
    leaf_seen: bool | None = None
    position_error_m: float | None = None
    yaw_error_deg: float | None = None
    floor_z_m: float | None = None
    score: float | None = None

    @property
    def frame(self) -> DoorFrame:
        """Pose of the door frame."""
        return DoorFrame(self.x_m, self.y_m, self.yaw_deg)

    @property
    def opening(self) -> Opening:
        """Ends of the opening in plan view."""
        return Opening.in_frame(self.x_m, self.y_m, self.yaw_deg, self.width_m)

    @property
    def distance_m(self) -> float:
        """Distance from the camera to the middle of the opening in plan view."""
        return math.hypot(self.x_m, self.y_m)

    @property
    def bearing_deg(self) -> float:
        """Direction from the camera to the middle of the opening; positive to the left."""
        return math.degrees(math.atan2(self.y_m, self.x_m))

    @property
    def remoteness_m(self) -> float:
        """Distance, longer for doors beside the view's axis (`doorways.remoteness`)."""
        return remoteness_m(self.x_m, self.y_m)

    def refuse(self, abstention: Abstention) -> Door:
        """Return the door without its state, leaf and passage; place and width stay."""
        return replace(
            self,
            state=None,
            abstention=abstention,
            opening_angle_deg=None,
            angle_error_deg=None,
            hinge=None,
            hinge_probability=None,
            passable_width_m=None,
            leaf_seen=None,
        )

# SPDX-License-Identifier: Apache-2.0
"""A door with a name and a place in a map, and the list of all doors of a map."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.doors.plane_pose import PlanePose
from doorstate.types import Hinge, Swing

NamedDoorKind = Literal["single", "double", "sliding", "folding", "revolving"]
KINDS_WITHOUT_STATE = ("folding", "revolving")
MAX_DOORS = 1000  # of a list
DEFAULT_FRAME = "map"
_ID = re.compile(r"\w(?:[\w .-]{0,62}[\w.-])?")


def _check_id(text: str) -> str:
    # Topics of MQTT and ROS, and columns of tables, are made of it.
    if _ID.fullmatch(text) is None:
        raise ValueError(
            "is no name of a door: 1 to 64 letters, digits, blanks and _ . -, not beginning with these"
        )
    return text


def _lower(value: object) -> object:
    return value.strip().lower() if isinstance(value, str) else value


DoorId = Annotated[str, AfterValidator(_check_id)]
MapFrame = Annotated[str, Field(min_length=1, max_length=200)]
"""Name of the frame of a map."""


class DoorPlace(FrozenModel):
    """Place of a door in its map: the middle of its opening on the front face of the wall, and the wall's direction.

    `yaw_deg` is the direction of the wall towards its left as seen from the front: a door seen straight ahead by a
    camera that looks along the map's x has 90.
    """

    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees


class NamedDoor(FrozenModel):
    """A door of a list. Hinge and swing are as seen from the front; None where they are not known."""

    id: DoorId
    frame: MapFrame = DEFAULT_FRAME
    pose: DoorPlace
    width_m: float = Field(ge=0.4, le=6.0)  # of the opening
    hinge: Annotated[Hinge, BeforeValidator(_lower)] | None = None
    swing: Annotated[Swing, BeforeValidator(_lower)] | None = None
    kind: Annotated[NamedDoorKind, BeforeValidator(_lower)] | None = None
    wall_m: Annotated[float, Field(ge=0.02, le=1.0)] = (
        0.15  # thickness, for the place of the door as seen from behind
    )
    position_error_m: Annotated[float, Field(ge=0.0, le=1.0)] = 0.05  # standard error of the place in the map

    @property
    def place(self) -> PlanePose:
        """Pose of the front in the map."""
        return PlanePose(self.pose.x_m, self.pose.y_m, self.pose.yaw_deg)

    def face_towards(self, x_m: float, y_m: float) -> PlanePose:
        """Return the pose of the face that a camera at a place of the map sees, with its yaw as the camera sees it."""
        is_front = self.is_front(x_m, y_m)
        return self.place if is_front else self.place.after(PlanePose(0.0, -self.wall_m, 180.0))

    def is_front(self, x_m: float, y_m: float) -> bool:
        """Return True for a place of the map before the front of the wall."""
        return self.place.inverse().after(PlanePose(x_m, y_m, 0.0)).y_m >= 0


class DoorList(FrozenModel):
    """Doors of one or several maps, as in a file; `frame` is that of doors that name none."""

    version: Literal["1"] = "1"
    frame: MapFrame = DEFAULT_FRAME
    doors: Annotated[tuple[NamedDoor, ...], Field(max_length=MAX_DOORS)] = ()

    def find(self, door_id: str) -> NamedDoor | None:
        """Return the door of this name."""
        return next((door for door in self.doors if door.id == door_id), None)

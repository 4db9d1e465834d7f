# SPDX-License-Identifier: Apache-2.0
"""Facts about a cloud that its points do not show: tilt, height of the camera, and a door that is known to be there."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import NamedTuple, Self

from doorstate.errors import ConfigError

MAX_DISTANCE_M = 20.0  # of a rough pose; depth cameras see no farther
USUAL_WIDTH_M = 0.9  # of a door whose width is not given
_MIN_WIDTH_M, _MAX_WIDTH_M = 0.4, 3.0


class ImageBox(NamedTuple):
    """Box in an image, in pixels; right and bottom are excluded."""

    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True)
class DoorHint:
    """Rough place of a door that is known to be in view: a pose, as from a map, or a box, as from a detector.

    Args:
        x_m, y_m: middle of the opening in the level sensor frame.
        yaw_deg: direction of the wall towards its left; None: the door faces the camera.
        width_m: width of the opening.
        box: box around the door in the image of an organized cloud, in place of a pose.

    Raises:
        ConfigError: neither a pose nor a box, or both, or impossible numbers.
    """

    x_m: float | None = None
    y_m: float | None = None
    yaw_deg: float | None = None
    width_m: float = USUAL_WIDTH_M
    box: ImageBox | None = None

    def __post_init__(self) -> None:
        if (self.x_m is None) != (self.y_m is None) or (self.x_m is None) == (self.box is None):
            raise ConfigError("give either x and y of the door or a box", field="door_known")
        if self.box is not None:
            left, top, right, bottom = self.box
            if not (0 <= left < right and 0 <= top < bottom):
                raise ConfigError(
                    f"no box: {left} {top} {right} {bottom}",
                    field="door_box",
                    expected="left < right and top < bottom in pixels",
                )
            return
        numbers = (self.x_m, self.y_m, self.yaw_deg or 0.0, self.width_m)
        finite = all(math.isfinite(number) for number in numbers if number is not None)
        if not finite or not 0 < self.distance_m <= MAX_DISTANCE_M:
            raise ConfigError(
                f"no place of a door: {self.x_m} {self.y_m} {self.yaw_deg}",
                field="door_pose",
                expected=f"metres and degrees, up to {MAX_DISTANCE_M:g} m away",
            )
        if not _MIN_WIDTH_M <= self.width_m <= _MAX_WIDTH_M:
            raise ConfigError(
                f"no width of a door: {self.width_m} m",
                field="door_pose",
                expected=f"{_MIN_WIDTH_M:g} to {_MAX_WIDTH_M:g}",
            )

    @property
    def distance_m(self) -> float:
        """Distance of a rough pose in plan view."""
        return math.hypot(self.x_m or 0.0, self.y_m or 0.0)

    @classmethod
    def parse(cls, pose: str | None = None, box: str | None = None) -> Self:
        """Return the hint of a text: `x y`, `x y yaw` or `x y yaw width`, or a box `left top right bottom`.

        Raises:
            ConfigError: another number of numbers, both texts or none, or as for the class.
        """
        if (pose is None) == (box is None):
            raise ConfigError("give either a pose or a box of the door", field="door_pose")
        if box is not None:
            numbers = _numbers(box, "door_box", (4,), "left top right bottom in pixels")
            return cls(box=ImageBox(*map(round, numbers)))
        numbers = _numbers(pose or "", "door_pose", (2, 3, 4), "x y, x y yaw, or x y yaw width")
        x_m, y_m, *rest = numbers
        return cls(x_m, y_m, rest[0] if rest else None, rest[1] if len(rest) > 1 else USUAL_WIDTH_M)


DoorKnown = bool | DoorHint
"""True, or a rough place, where a door is known to be in view."""


def door_known(is_known: bool, pose: str | None = None, box: str | None = None) -> DoorKnown:
    """Return what a user says of a door: a rough place as text (`DoorHint.parse`) says that it is known, too.

    Raises:
        ConfigError: as in `DoorHint.parse`.
    """
    return is_known if pose is None and box is None else DoorHint.parse(pose, box)


@dataclass(frozen=True)
class Known:
    """Facts about one cloud.

    Args:
        door: a door is known to be in view, so that "no door" is no answer.
        is_level: z of the cloud points up; False leaves it to be found where the method can.
        camera_height_m: height of the camera above the floor; None leaves it to be found.
    """

    door: DoorKnown = False
    is_level: bool = False
    camera_height_m: float | None = None

    @property
    def hint(self) -> DoorHint | None:
        """Rough place of the door."""
        return self.door if isinstance(self.door, DoorHint) else None

    @property
    def has_door(self) -> bool:
        """True if a door is known to be in view."""
        return self.door is not False


def _numbers(text: str, field: str, counts: tuple[int, ...], expected: str) -> list[float]:
    try:
        numbers = [float(number) for number in re.split(r"[\s,]+", text.strip(" \t[](),"))]
        if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
            raise ValueError
    except ValueError as error:
        raise ConfigError(f"{text!r} is not a place", field=field, expected=expected) from error
    return numbers

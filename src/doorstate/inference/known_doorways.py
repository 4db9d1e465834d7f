# SPDX-License-Identifier: Apache-2.0
"""Candidates of a door whose rough place is known, from a map or from a detector in images."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.doorways.doorway import Doorway, gap
from doorstate.errors import ConfigError
from doorstate.inference.known import USUAL_WIDTH_M, DoorHint, ImageBox
from doorstate.inference.seen_through import Opening
from doorstate.types import Points

Place = tuple[float, float]
"""x and y in plan view, metres."""

# Chosen: a robot knows its place on a map to half a metre and ten degrees.
_NEAR_M, _NEAR_DEG = 0.75, 30.0
_MIN_SHARED_VIEW = 0.3  # of the angles of box and opening together; boxes hold casings, or a part of the door
_SIDE_SHARE = 0.12  # of a box's width: columns on both sides of its edge, which show the jambs
_MIDDLE_ROWS = (0.2, 0.8)  # of a box's height, without lintel and floor
_MIN_SIDE_POINTS = 8
_WIDTH_M = (0.5, 2.4)  # of doors


def hinted_doorways(
    candidates: Sequence[Doorway], hint: DoorHint, cloud: Points, floor_z_m: float
) -> list[Doorway]:
    """Return the candidates at the place of a hint, the best first; the place itself if there are none.

    Args:
        candidates: candidates of the finder.
        hint: rough place of the door.
        cloud: level cloud; an image (H, W, 3) for a box.
        floor_z_m: height of the floor.

    Raises:
        ConfigError: a box for a cloud without an image, outside of the image, or without points.
    """
    if hint.box is None:
        place = _place_of_pose(hint, floor_z_m)
        near = [candidate for candidate in candidates if _is_near(candidate, place, hint.yaw_deg is not None)]
    else:
        place = _place_of_box(hint.box, cloud, floor_z_m)
        near = [candidate for candidate in candidates if _shared_view(candidate, place) >= _MIN_SHARED_VIEW]
    return sorted(near, key=lambda candidate: -candidate.score) or [place]


def _place_of_pose(hint: DoorHint, floor_z_m: float) -> Doorway:
    x_m, y_m = hint.x_m or 0.0, hint.y_m or 0.0
    yaw_deg = math.degrees(math.atan2(y_m, x_m)) + 90 if hint.yaw_deg is None else hint.yaw_deg
    return Doorway(x_m, y_m, _towards_camera(x_m, y_m, yaw_deg), hint.width_m, floor_z_m)


def _towards_camera(x_m: float, y_m: float, yaw_deg: float) -> float:
    """Return the direction of a wall, either way, as the one whose left is the camera's left."""
    yaw = math.radians(yaw_deg)
    is_turned = -x_m * math.sin(yaw) + y_m * math.cos(yaw) > 0
    return yaw_deg + 180 if is_turned else yaw_deg


def _is_near(candidate: Doorway, place: Doorway, has_yaw: bool) -> bool:
    gap_m, turn_deg = gap(candidate, place)
    return gap_m <= _NEAR_M and (not has_yaw or turn_deg <= _NEAR_DEG)


def _place_of_box(box: ImageBox, cloud: Points, floor_z_m: float) -> Doorway:
    """Return the doorway between what was measured at both sides of a box."""
    if cloud.ndim != 3:
        raise ConfigError("a box needs the image of an organized cloud", field="door_box")
    rows, columns = cloud.shape[:2]
    left, top, right, bottom = box
    if right > columns or bottom > rows:
        raise ConfigError(
            f"the box ends at {right}, {bottom}", field="door_box", expected=f"at most {columns}, {rows}"
        )
    turned = ImageBox(top, left, bottom, right)
    # The sides of a door in a turned image are at the top and the bottom of its box.
    sides = max(_sides(box, cloud), _sides(turned, cloud.swapaxes(0, 1)), key=_view_between)
    if len(sides) == 2:
        (x_right, y_right), (x_left, y_left) = sorted(sides, key=_bearing)
        yaw_deg = math.degrees(math.atan2(y_left - y_right, x_left - x_right))
        width_m = min(max(_WIDTH_M[0], math.hypot(x_left - x_right, y_left - y_right)), _WIDTH_M[1])
        return Doorway((x_left + x_right) / 2, (y_left + y_right) / 2, yaw_deg, width_m, floor_z_m)
    middle = _nearest_place(cloud[top:bottom, left:right])
    if middle is None:
        raise ConfigError("nothing was measured in the box", field="door_box")
    return _place_of_pose(DoorHint(*middle, width_m=USUAL_WIDTH_M), floor_z_m)


def _sides(box: ImageBox, cloud: Points) -> list[Place]:
    """Return the places at the left and the right edge of a box, as far as they were measured."""
    left, top, right, bottom = box
    low, high = (top + round(share * (bottom - top)) for share in _MIDDLE_ROWS)
    reach = max(1, round(_SIDE_SHARE * (right - left)))
    parts = (cloud[low : max(high, low + 1), max(0, edge - reach) : edge + reach] for edge in (left, right))
    return [place for place in map(_nearest_place, parts) if place is not None]


def _bearing(place: Place) -> float:
    return math.atan2(place[1], place[0])


def _view_between(sides: Sequence[Place]) -> float:
    """Return the angle between two places as the camera sees them; less than none for one place."""
    return abs(_bearing(sides[0]) - _bearing(sides[1])) if len(sides) == 2 else -1.0


def _nearest_place(part: Points) -> Place | None:
    """Return the place in plan view of a part of an image, by its nearer half: jambs stand before what is behind."""
    points = part[is_measured(part)].astype(np.float64)
    if len(points) < _MIN_SIDE_POINTS:
        return None
    range_m = np.hypot(points[:, 0], points[:, 1])
    near: NDArray[np.float64] = points[range_m <= np.median(range_m)]
    x_m, y_m = np.median(near[:, :2], axis=0).tolist()
    return x_m, y_m


def _shared_view(candidate: Doorway, place: Doorway) -> float:
    """Return the angle that two openings share in the view, as a share of the angle of both together."""
    (low, high), (other_low, other_high) = _view(candidate), _view(place)
    shared = min(high, other_high) - max(low, other_low)
    return max(0.0, shared) / (max(high, other_high) - min(low, other_low))


def _view(doorway: Doorway) -> tuple[float, float]:
    """Return the bearings of the ends of an opening, in radians."""
    ends = Opening.in_frame(doorway.x_m, doorway.y_m, doorway.yaw_deg, doorway.width_m)
    low, high = sorted(map(_bearing, ends))
    return low, high

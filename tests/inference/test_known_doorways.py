# SPDX-License-Identifier: Apache-2.0
"""Candidates at the rough place of a known door, and the place itself where there are none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from doorstate.errors import ConfigError
from doorstate.inference.known import DoorHint, ImageBox
from doorstate.inference.known_doorways import hinted_doorways
from doorstate.types import Points
from tests.inference.scripted_doorways import FLOOR_M, doorway

NO_CLOUD = np.empty((0, 3), np.float32)


def test_candidates_near_a_pose_are_taken_by_their_score() -> None:
    poor, good, far = (
        doorway(3.0, 5.0, score=0.2),
        doorway(2.8, 0.0, score=0.7),
        doorway(3.0, 40.0, score=0.9),
    )
    assert hinted_doorways([poor, far, good], DoorHint(3.0, 0.1), NO_CLOUD, FLOOR_M) == [good, poor]
    turned = replace(good, yaw_deg=140.0)
    assert hinted_doorways([turned], DoorHint(3.0, 0.0), NO_CLOUD, FLOOR_M) == [turned]
    (place,) = hinted_doorways([turned], DoorHint(3.0, 0.0, 90.0), NO_CLOUD, FLOOR_M)
    assert place != turned


@pytest.mark.parametrize("yaw_deg", [20.0, 20.0 - 180.0])
def test_a_place_without_candidates_is_a_doorway_itself(yaw_deg: float) -> None:
    (place,) = hinted_doorways([doorway(4.0, 50.0)], DoorHint(2.0, -1.0, yaw_deg, 1.1), NO_CLOUD, FLOOR_M)
    assert (place.x_m, place.y_m, place.width_m, place.floor_z_m) == (2.0, -1.0, 1.1, FLOOR_M)
    # Either way along the wall is taken: the camera is on the side of +y.
    assert place.yaw_deg % 360 == pytest.approx(20.0)
    assert place.to_doorway(np.zeros(3, np.float32))[1] > 0


def test_a_place_without_a_direction_faces_the_camera() -> None:
    (place,) = hinted_doorways([], DoorHint(2.0, 2.0), NO_CLOUD, FLOOR_M)
    assert place.yaw_deg == pytest.approx(135.0)
    np.testing.assert_allclose(
        place.to_doorway(np.array([0, 0, FLOOR_M], np.float32)), [0, math.sqrt(8), 0], atol=1e-5
    )


@pytest.fixture(scope="module")
def wall() -> Points:
    """Image of a wall 3 m away, turned by 20 degrees, with a doorway through which a wall 5 m away is seen."""
    across, up = np.meshgrid(np.linspace(0.58, -0.58, 320), np.linspace(0.43, -0.43, 240))
    slope = math.tan(math.radians(20.0))
    depth_m = 3.0 / (1 + slope * across)
    side_m = depth_m * across
    depth_m[np.abs(side_m - 0.4) < 0.45] = 5.0
    cloud: Points = (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(
        np.float32
    )
    return cloud


def _box(cloud: Points) -> ImageBox:
    """Box around the doorway of `wall`."""
    columns = np.flatnonzero(cloud[120, :, 0] == 5.0)
    return ImageBox(int(columns[0]), 40, int(columns[-1]) + 1, 240)


def test_a_box_finds_the_candidate_in_it(wall: Points) -> None:
    hint = DoorHint(box=_box(wall))
    inside, beside = doorway(2.9, 8.0), doorway(3.0, -20.0)
    assert hinted_doorways([beside, inside], hint, wall, FLOOR_M) == [inside]


def test_a_box_without_candidates_gives_the_doorway_between_its_sides(wall: Points) -> None:
    (place,) = hinted_doorways([], DoorHint(box=_box(wall)), wall, FLOOR_M)
    assert place.y_m == pytest.approx(0.4, abs=0.1)
    assert place.x_m == pytest.approx(3.0 - 0.4 * math.tan(math.radians(20)), abs=0.1)
    assert place.yaw_deg == pytest.approx(110.0, abs=4.0)
    assert place.width_m == pytest.approx(0.9 / math.cos(math.radians(20)), abs=0.2)


def test_a_box_in_a_turned_image_finds_the_same_place(wall: Points) -> None:
    left, top, right, bottom = _box(wall)
    turned = np.ascontiguousarray(np.rot90(wall))
    columns = wall.shape[1]
    hint = DoorHint(box=ImageBox(top, columns - right, bottom, columns - left))
    (upright,), (place,) = (
        hinted_doorways([], DoorHint(box=_box(wall)), wall, FLOOR_M),
        hinted_doorways([], hint, turned, FLOOR_M),
    )
    assert (place.x_m, place.y_m) == pytest.approx((upright.x_m, upright.y_m), abs=0.02)
    assert place.yaw_deg == pytest.approx(upright.yaw_deg, abs=1.0)


def test_boxes_that_cannot_be_used_are_errors(wall: Points) -> None:
    box = DoorHint(box=ImageBox(0, 0, 321, 100))
    empty = np.full_like(wall, np.nan)
    for hint, cloud in ((box, wall), (box, wall.reshape(-1, 3)), (DoorHint(box=_box(wall)), empty)):
        with pytest.raises(ConfigError) as caught:
            hinted_doorways([], hint, cloud, FLOOR_M)
        assert caught.value.field == "door_box"


def test_sides_without_points_leave_the_middle_of_a_box(wall: Points) -> None:
    left, top, right, bottom = _box(wall)
    holed = wall.copy()
    holed[:, : left + 20] = np.nan
    (place,) = hinted_doorways([], DoorHint(box=ImageBox(left, top, right, bottom)), holed, FLOOR_M)
    assert place.distance_m == pytest.approx(5.0, abs=0.5)

# SPDX-License-Identifier: Apache-2.0
"""Targets worked by hand, and turned, mirrored and scaled like the points of the door."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from doorstate.clouds.augmentation import Augmentation, apply_augmentation, draw_augmentation
from doorstate.clouds.preparation import SCALE_M
from doorstate.dataset.targets import Targets, augmented, door_targets, known_parts
from doorstate.simulation.generate import PRESETS, draw_pose
from doorstate.simulation.manifest import flatten

ROW = {
    "state": "open",
    "opening_angle_deg": "90.0",
    "hinge": "left",
    "door_x_m": "2.0",
    "door_y_m": "0.5",
    "door_yaw_deg": "90.0",  # x along the wall is the robot's left: the wall is straight ahead
    "opening_width_m": "0.9",
    "passable_width_m": "0.6",
}
NOBODY = {"sample_id": "a", "state": "no_door"}


def test_targets_are_in_the_units_of_the_normalised_cloud() -> None:
    found = door_targets([ROW, NOBODY], np.array([[1.4, 0.2, 0.0], [0.0, 0.0, 0.0]], dtype=np.float32))
    assert {name: values.shape for name, values in found.items()} == {
        "door": (2, 1),
        "angle": (2, 1),
        "hinge": (2, 1),
        "frame": (2, 3),
        "widths": (2, 2),
    }
    assert found["angle"][0, 0] == pytest.approx(math.pi / 2)
    assert found["hinge"][0, 0] == 1
    assert_allclose(found["frame"][0, :2], [0.6 / SCALE_M, 0.3 / SCALE_M], rtol=1e-6)
    assert abs(found["frame"][0, 2]) == pytest.approx(math.pi)  # the wall's normal comes back at the robot
    assert_allclose(found["widths"][0] * SCALE_M, [0.9, 0.6], rtol=1e-6)
    assert found.pop("door").tolist() == [[1], [0]]
    assert all(np.isnan(values[1]).all() for values in found.values())
    assert all(values.dtype == np.float32 for values in found.values())


def test_rows_of_the_first_preset_have_all_but_the_passable_width() -> None:
    row = flatten(draw_pose(PRESETS["ogurob"], 3, 700)[1])
    found = door_targets([row], np.zeros((1, 3), dtype=np.float32))
    assert found["hinge"][0, 0] == 1
    assert found["widths"][0, 0] * SCALE_M == pytest.approx(0.9)
    assert np.isnan(found["widths"][0, 1])
    x, y, normal = found["frame"][0]
    assert math.hypot(x, y) * SCALE_M == pytest.approx(float(row["distance_m"]), rel=1e-6)
    # The camera stands on the side that the normal points to.
    assert -x * math.cos(normal) - y * math.sin(normal) > 0.2


def _drawn(**changes: object) -> tuple[Targets, Targets, np.ndarray]:
    """Targets before and after, and two points of each of 50 doors after: its middle, and one before it."""
    rng = np.random.default_rng(5)
    frame = np.column_stack([rng.uniform(-1, 1, (50, 2)), rng.uniform(-3, 3, 50)])
    targets = {
        "angle": rng.uniform(0, 2, (50, 1)),
        "hinge": rng.integers(0, 2, (50, 1)).astype(float),
        "frame": frame,
        "widths": rng.uniform(0.1, 0.4, (50, 2)),
    }
    before = {name: values.astype(np.float32) for name, values in targets.items()}
    normal = np.column_stack([np.cos(frame[:, 2]), np.sin(frame[:, 2])])
    points = np.zeros((50, 2, 3))
    points[:, 0, :2], points[:, 1, :2] = frame[:, :2], frame[:, :2] + normal
    draw = draw_augmentation(Augmentation.model_validate(changes), rng, 50, 2)
    moved = apply_augmentation(points.astype(np.float32), draw)
    return before, augmented(before, draw), moved


@pytest.mark.parametrize(
    "changes",
    [
        {"yaw_deg": 180.0},
        {"mirror": 0.5},
        {"scale": (0.5, 2.0)},
        {"yaw_deg": 40.0, "mirror": 1.0, "shift": 0.3},
    ],
)
def test_frames_move_with_the_points_of_the_door(changes: dict[str, object]) -> None:
    before, after, moved = _drawn(**changes)
    assert_allclose(after["frame"][:, :2], moved[:, 0, :2], atol=1e-5)
    ahead = moved[:, 1, :2] - moved[:, 0, :2]
    turn = np.arctan2(ahead[:, 1], ahead[:, 0]) - after["frame"][:, 2]
    assert_allclose(np.cos(turn), 1, atol=1e-6)
    assert_allclose(after["angle"], before["angle"])
    scale = np.linalg.norm(ahead, axis=1)
    assert_allclose(after["widths"], before["widths"] * scale[:, None], rtol=1e-4)


def test_a_mirrored_door_is_hinged_on_the_other_side() -> None:
    before, after, _ = _drawn(mirror=1.0, yaw_deg=100.0)
    assert_allclose(after["hinge"], 1 - before["hinge"])
    before, after, _ = _drawn(yaw_deg=100.0)
    assert_allclose(after["hinge"], before["hinge"])


def test_what_is_unknown_stays_unknown() -> None:
    unknown = door_targets([NOBODY] * 50, np.zeros((50, 3), dtype=np.float32))
    draw = draw_augmentation(Augmentation(yaw_deg=90, mirror=0.5, shift=0.1), np.random.default_rng(0), 50, 2)
    moved = augmented(unknown, draw)
    assert not moved.pop("door").any()
    assert all(np.isnan(values).all() for values in moved.values())


def test_parts_that_nobody_knows_are_negative() -> None:
    assert known_parts(np.array([[0, 5, 255]], dtype=np.uint8)).tolist() == [[0, 5, -1]]

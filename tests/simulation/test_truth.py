# SPDX-License-Identifier: Apache-2.0
"""True doors of rows: pose, sizes and state are those of the scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.errors import DatasetError
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.truth import true_doors
from doorstate.types import Part
from tests.simulation.door_frame import to_door_frame


@pytest.mark.parametrize(("preset", "index"), [("ogurob", 700), ("varied", 3), ("cluttered", 5)])
def test_frame_points_lie_on_the_true_door(preset: str, index: int) -> None:
    rows, frames = simulate_rows(PRESETS[preset], 0, index)
    for row, frame in zip(rows, frames, strict=True):
        (door,) = true_doors(row)
        assert (door.state, door.hinge) == (row.state, row.hinge)
        assert door.opening_angle_deg == row.opening_angle_deg
        points = to_door_frame(frame.points, door)
        wall_y = points[..., 1][(frame.cut.part == Part.WALL) & (np.abs(points[..., 0]) < 0.8)]
        assert np.abs(wall_y).min() < 1e-3
        assert np.abs(points[..., 2][frame.cut.part == Part.FLOOR]).max(initial=0.0) < 1e-3
        above_threshold = (points[..., 2] > 0.05) & (points[..., 2] < 1.9)
        jambs = np.abs(points[..., 0][(frame.cut.part == Part.FRAME) & above_threshold])
        assert door.width_m / 2 - 0.02 < jambs.min(initial=math.inf)
        assert door.visible_px.leaf == (frame.cut.part == Part.LEAF).sum()


def test_a_scene_without_a_door_has_no_true_door() -> None:
    row = draw_rows(PRESETS["no-door"], 0, 0)[0]
    assert true_doors(row) == ()
    assert replay(row).points.shape == (480, 640, 3)


def test_a_row_without_the_pose_of_its_door_is_refused() -> None:
    row = draw_rows(PRESETS["varied"], 0, 0)[0].model_copy(update={"door_x_m": None})
    with pytest.raises(DatasetError) as refused:
        true_doors(row)
    assert refused.value.field == "door_x_m"

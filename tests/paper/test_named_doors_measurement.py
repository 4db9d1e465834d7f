# SPDX-License-Identifier: Apache-2.0
"""Simulated drives past named doors: places of list and frame agree, and answers are counted at the right door."""

from __future__ import annotations

import math

import numpy as np
from paper.measurements.named_doors import (
    _corridor,
    _door_list,
    _in_order,
    _rows,
    measure_named_doors,
    named_doors_table,
)

from doorstate._jobs import no_progress
from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.matching import expected_door
from doorstate.doors.plane_pose import PlanePose
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.simulation.frames import replay


class Blind(Predictor):
    """Sees no door."""

    gate = None
    removes_outliers = False
    name = "blind"

    def _predict(self, clouds: object, known: Known) -> list[Prediction]:
        return [Prediction.from_doors([], [], 1000, 1.0)]


def test_doors_of_the_list_are_where_the_frames_show_them() -> None:
    corridor = _corridor(7, 0)
    list_ = _door_list(corridor, np.random.default_rng(0))
    assert len(list_) == len(corridor.layout.doors) - 1 == 6
    for number, (row, pose, _) in enumerate(_rows(corridor, 4, "none", "test")):
        truths = _in_order(row, replay(row), number % 7)
        camera = CameraPlace(PlanePose(pose.x_m, pose.y_m, math.degrees(pose.yaw_rad)))
        for door, truth in zip(list_, truths, strict=False):
            x_m, y_m, yaw_deg = expected_door(door, camera)
            assert math.hypot(x_m - truth.x_m, y_m - truth.y_m) < 0.15
            assert abs(math.remainder(yaw_deg - truth.yaw_deg, 360)) < 0.01
            assert truth.width_m == door.width_m
        assert any(truth.visible_px.total > 0 for truth in truths)


def test_doors_that_are_not_found_are_counted() -> None:
    results, unknown = measure_named_doors(Blind(), "none", 1, 2, False, no_progress, 7)
    assert len(results) == 2 * 6
    assert {result.state for result in results} == {None}
    assert sum(unknown[0]) == 0
    table = named_doors_table(results, unknown, 2)
    assert "| all |" in table.to_markdown()

# SPDX-License-Identifier: Apache-2.0
"""Lines of a predicted door."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from doorstate.inference.prediction import DoorFrame, Prediction
from doorstate.types import DoorState
from doorstate.viewer.predicted_door import DOOR_HEIGHT_M, predicted_door

FLOOR_M = -1.0


def prediction(
    hinge: Literal["left", "right"] | None = "left",
    angle_deg: float | None = 90.0,
    width_m: float | None = 0.8,
) -> Prediction:
    """Return a prediction for a wall straight ahead, three metres away."""
    return Prediction(
        DoorState.OPEN,
        num_points=1024,
        milliseconds=20.0,
        opening_angle_deg=angle_deg,
        hinge=hinge,
        frame=DoorFrame(3.0, 0.0, 90.0),
        opening_width_m=width_m,
    )


@pytest.mark.parametrize(("hinge", "y_m"), [("left", 0.4), ("right", -0.4)])
def test_leaf_hangs_on_the_hinge_and_opens_towards_the_robot(
    hinge: Literal["left", "right"], y_m: float
) -> None:
    lines = {line.name: line for line in predicted_door(prediction(hinge), FLOOR_M)}
    assert list(lines) == ["door frame", "leaf", "angle", "hinge"]
    frame = lines["door frame"].points_m
    np.testing.assert_allclose(frame[[0, 3]], [[3.0, 0.4, FLOOR_M], [3.0, -0.4, FLOOR_M]], atol=1e-12)
    np.testing.assert_allclose(frame[1, 2], FLOOR_M + DOOR_HEIGHT_M)
    np.testing.assert_allclose(lines["hinge"].points_m[0], [3.0, y_m, FLOOR_M], atol=1e-12)
    leaf = lines["leaf"].points_m
    np.testing.assert_allclose(leaf[[0, 3]], [[3.0, y_m, FLOOR_M], [2.2, y_m, FLOOR_M]], atol=1e-12)
    assert lines["angle"].label == "90°"


def test_closed_leaf_lies_in_the_frame() -> None:
    lines = {line.name: line.points_m for line in predicted_door(prediction(angle_deg=0.0), FLOOR_M)}
    np.testing.assert_allclose(lines["leaf"][:4], lines["door frame"], atol=1e-12)


def test_lines_without_their_heads_are_left_out() -> None:
    assert predicted_door(prediction(width_m=None), FLOOR_M) == []
    names = [line.name for line in predicted_door(prediction(hinge=None), FLOOR_M)]
    assert names == ["door frame"]
    names = [line.name for line in predicted_door(prediction(angle_deg=None), FLOOR_M)]
    assert names == ["door frame", "hinge"]

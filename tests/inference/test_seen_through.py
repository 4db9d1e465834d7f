# SPDX-License-Identifier: Apache-2.0
"""Rays to the floor behind an opening come back through open doors, and not through leaves that are not measured."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate import Predictor
from doorstate.clouds.measured import is_measured
from doorstate.inference.abstention import Abstention
from doorstate.inference.gate import Gate
from doorstate.inference.prediction import DoorFrame, Prediction
from doorstate.inference.seen_through import Opening, seen_share
from doorstate.rules.base import Detection
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.types import DoorState, Part, Points

HEIGHT, WIDTH = 240, 320
CAMERA_M = 1.0


def doorway(distance_m: float, yaw_deg: float = 90.0, *, dark: bool = False, pane: bool = False) -> Points:
    """A wall with an opening 0.9 m wide, its middle straight ahead, and floor on both sides, (240, 320, 3)."""
    across, up = np.meshgrid(np.linspace(0.58, -0.58, WIDTH), np.linspace(0.43, -0.43, HEIGHT))
    normal = np.array([np.sin(np.radians(yaw_deg)), -np.cos(np.radians(yaw_deg))])
    wall_m = distance_m * normal[0] / np.maximum(normal[0] + normal[1] * across, 1e-9)
    along_m = wall_m * across / normal[0]
    height_m = CAMERA_M + wall_m * up
    to_floor_m = np.where(up < 0, CAMERA_M / np.maximum(-up, 1e-9), np.inf)
    in_opening = (np.abs(along_m) < 0.45) & (height_m < 2.1)
    depth_m = np.where(in_opening, np.minimum(to_floor_m, 8.0), wall_m)
    if dark:
        in_pane = pane & (np.abs(along_m) < 0.3) & (height_m > 0.3)
        depth_m[in_opening & ~in_pane] = np.nan
    depth_m = np.where(to_floor_m < wall_m, to_floor_m, depth_m)
    return (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(np.float32)


def opening(distance_m: float, yaw_deg: float = 90.0, width_m: float = 0.9) -> Opening:
    direction = width_m / 2 * np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
    x_m, y_m = direction.tolist()
    return Opening((distance_m + x_m, y_m), (distance_m - x_m, -y_m))


def share_of(cloud: Points, where: Opening) -> float | None:
    return seen_share(cloud, is_measured(cloud), where, 4.0)


@pytest.mark.parametrize("distance_m", [2.0, 3.5, 4.5])
@pytest.mark.parametrize("yaw_deg", [60.0, 90.0, 130.0])
def test_open_doors_are_seen_through_and_dark_leaves_are_not(distance_m: float, yaw_deg: float) -> None:
    where = opening(distance_m, yaw_deg)
    free, dark, glazed = (
        doorway(distance_m, yaw_deg),
        doorway(distance_m, yaw_deg, dark=True),
        doorway(distance_m, yaw_deg, dark=True, pane=True),
    )
    for step in (1, 2):
        for cloud, low, high in ((free, 0.98, 1.0), (dark, 0.0, 0.5), (glazed, 0.0, 0.6)):
            thinned = cloud[::step, ::step]
            for form in (thinned, thinned[is_measured(thinned)]):
                share = share_of(form, where)
                assert share is not None
                assert low <= share <= high
    assert Gate().check_opening(free, where) is None
    abstention = Gate().check_opening(glazed, where)
    assert abstention is not None
    assert abstention.code == "opening_not_seen"
    assert 0 <= float(abstention.values["share"]) < float(abstention.values["min_share"])


def test_the_leaf_of_a_near_door_is_missed_where_the_floor_is() -> None:
    """The floor comes into view 1.1 m behind the opening."""
    assert share_of(doorway(1.2), opening(1.2)) == 1.0
    assert share_of(doorway(1.2, dark=True), opening(1.2)) == 0.0


def test_openings_out_of_view_or_behind_things_are_not_judged() -> None:
    cloud = doorway(3.0, dark=True)
    assert share_of(cloud, Opening((-3.0, 0.45), (-3.0, -0.45))) is None
    assert share_of(cloud, Opening((1.0, 9.0), (1.0, 8.0))) is None
    board = doorway(3.0)
    board *= 1.5 / board[..., :1]
    assert share_of(board, opening(3.0)) is None
    assert share_of(np.full((HEIGHT, WIDTH, 3), np.nan, np.float32), opening(3.0)) is None


def test_openings_come_from_heads_or_outlines() -> None:
    framed = Prediction(DoorState.OPEN, 1, 0.0, frame=DoorFrame(3.0, 0.0, 90.0), opening_width_m=0.8)
    assert framed.opening is not None
    np.testing.assert_allclose(framed.opening, ((3.0, 0.4), (3.0, -0.4)), atol=1e-9)
    outline = np.array([[3.0, -0.4, 0.0], [3.0, -0.4, 2.0], [2.5, 0.4, 2.0], [2.5, 0.4, 0.0]])
    detected = Prediction(
        DoorState.OPEN, 1, 0.0, detections=(Detection("wall", outline + 1), Detection("opening", outline))
    )
    assert detected.opening == Opening((2.5, 0.4), (3.0, -0.4))
    assert Prediction(DoorState.OPEN, 1, 0.0).opening is None
    refused = framed.refuse(Abstention("opening_not_seen", {"share": 0.1, "min_share": 0.95}))
    assert refused.state is None
    assert refused.opening is None
    assert refused.reason


def test_a_wall_and_a_leaf_leave_both_sides_of_the_hinge() -> None:
    wall = np.array([[3.0, 2.0, 0.0], [3.0, 2.0, 2.0], [3.0, -2.0, 2.0], [3.0, -2.0, 0.0]])
    leaf = np.array([[2.2, 0.4, 0.0], [2.2, 0.4, 2.0], [2.95, 0.4, 2.0], [2.95, 0.4, 0.0]])
    shapes = (Detection("wall", wall), Detection("leaf", leaf))
    openings = Prediction(DoorState.OPEN, 1, 0.0, detections=shapes).possible_openings
    expected = {((3.0, 0.4), (3.0, -0.35)), ((3.0, 1.15), (3.0, 0.4))}
    assert {tuple(tuple(np.round(end, 6)) for end in found) for found in openings} == expected
    assert Prediction(DoorState.OPEN, 1, 0.0, detections=shapes[:1]).possible_openings == ()


def test_a_glazed_dark_door_is_not_open() -> None:
    """The pane shows the room behind, so that neither the gate nor the network sees a closed door."""
    rows, frames = simulate_rows(PRESETS["varied"], 77, 2, "d435")
    row, frame = next(pair for pair in zip(rows, frames, strict=True) if pair[0].state == "closed")
    assert row.door_kind == "glazed"
    cloud = frame.points.copy()
    cloud[frame.cut.part == Part.LEAF] = np.nan
    assert Gate()(cloud) is None
    ungated = Predictor.load(gate=None)(cloud).raw_probabilities
    assert max(ungated, key=lambda state: ungated[state]) == "open"
    for form in (cloud, cloud[is_measured(cloud)]):
        prediction = Predictor.load()(form)
        assert prediction.label == "abstained"
        assert prediction.frame is None
    assert prediction.abstention is not None
    assert prediction.abstention.code in ("opening_not_seen", "door_glass")

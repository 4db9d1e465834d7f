# SPDX-License-Identifier: Apache-2.0
"""Heads: targets, losses and metrics worked by hand; targets move with the points; columns invert targets."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from doorstate.clouds.augmentation import Augmentation, apply_augmentation, draw_augmentation
from doorstate.clouds.normalization import SCALE_M, Placement
from doorstate.dataset.store import PreparedDataset
from doorstate.networks.heads import (
    HEADS,
    POINT_HEADS,
    augment_targets,
    head_columns,
    head_metrics,
    head_targets,
)
from doorstate.simulation.manifest import flatten
from doorstate.simulation.presets import PRESETS, draw_rows

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
UNKNOWN_STATE = ROW | {"state": "unknown", "opening_angle_deg": "", "hinge": "", "passable_width_m": "0.0"}
WITHOUT_DOOR = {"sample_id": "a", "state": "no_door"}


def at_origin(clouds: int) -> Placement:
    return Placement(np.zeros((clouds, 3), np.float32), SCALE_M)


def test_targets_are_in_the_units_of_the_normalised_cloud() -> None:
    centroids = np.array([[1.4, 0.2, 0.0], [0.0, 0.0, 0.0]], dtype=np.float32)
    targets = head_targets([ROW, WITHOUT_DOOR], Placement(centroids, SCALE_M))
    assert {name: values.shape for name, values in targets.items()} == {
        name: (2, head.num_values) for name, head in HEADS.items()
    }
    assert {name: head.num_values for name, head in HEADS.items()} == {
        "door": 1,
        "angle": 1,
        "hinge": 1,
        "frame": 3,
        "widths": 2,
    }
    assert targets["angle"][0, 0] == pytest.approx(math.pi / 2)
    assert targets["hinge"][0, 0] == 1
    assert_allclose(targets["frame"][0, :2], [0.6 / SCALE_M, 0.3 / SCALE_M], rtol=1e-6)
    assert abs(targets["frame"][0, 2]) == pytest.approx(math.pi)  # the wall's normal points back at the robot
    assert_allclose(targets["widths"][0] * SCALE_M, [0.9, 0.6], rtol=1e-6)
    assert targets.pop("door").tolist() == [[1], [0]]
    assert all(np.isnan(values[1]).all() for values in targets.values())
    assert all(values.dtype == np.float32 for values in targets.values())


def test_a_door_of_unknown_state_has_a_place_but_neither_angle_nor_hinge() -> None:
    targets = head_targets([ROW, UNKNOWN_STATE], at_origin(2))
    assert targets["door"][:, 0].tolist() == [1, 1]
    assert np.isnan(targets["angle"][1]).all()
    assert np.isnan(targets["hinge"][1]).all()
    assert_allclose(targets["frame"][1], targets["frame"][0])
    assert targets["widths"][1] * SCALE_M == pytest.approx([0.9, 0.0])


def test_only_the_named_heads_have_targets() -> None:
    assert list(head_targets([ROW], at_origin(1), ["widths", "parts"])) == ["widths"]


def test_targets_of_a_drawn_row() -> None:
    row = flatten(draw_rows(PRESETS["ogurob"], 3, 700)[1])
    targets = head_targets([row], at_origin(1))
    assert targets["hinge"][0, 0] == 1
    assert targets["widths"][0, 0] * SCALE_M == pytest.approx(0.9)
    assert targets["widths"][0, 1] * SCALE_M == pytest.approx(float(row["passable_width_m"]))
    x, y, normal = targets["frame"][0]
    assert math.hypot(x, y) * SCALE_M == pytest.approx(float(row["distance_m"]), rel=1e-6)
    # The camera stands on the side that the normal points to.
    assert -x * math.cos(normal) - y * math.sin(normal) > 0.2


def _augmented(
    **changes: object,
) -> tuple[Mapping[str, NDArray[np.float32]], Mapping[str, NDArray[np.float32]], NDArray[np.float32]]:
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
    return before, augment_targets(before, draw), moved


@pytest.mark.parametrize(
    "changes",
    [
        {"yaw_deg": 180.0},
        {"mirror": 0.5},
        {"scale": (0.5, 2.0)},
        {"yaw_deg": 40.0, "mirror": 1.0, "shift": 0.3},
    ],
)
def test_targets_move_with_the_points_of_the_door(changes: dict[str, object]) -> None:
    before, after, moved = _augmented(**changes)
    assert_allclose(after["frame"][:, :2], moved[:, 0, :2], atol=1e-5)
    ahead = moved[:, 1, :2] - moved[:, 0, :2]
    turn = np.arctan2(ahead[:, 1], ahead[:, 0]) - after["frame"][:, 2]
    assert_allclose(np.cos(turn), 1, atol=1e-6)
    assert_allclose(after["angle"], before["angle"])
    scale = np.linalg.norm(ahead, axis=1)
    assert_allclose(after["widths"], before["widths"] * scale[:, None], rtol=1e-4)


def test_a_mirrored_door_is_hinged_on_the_other_side() -> None:
    before, after, _ = _augmented(mirror=1.0, yaw_deg=100.0)
    assert_allclose(after["hinge"], 1 - before["hinge"])
    before, after, _ = _augmented(yaw_deg=100.0)
    assert_allclose(after["hinge"], before["hinge"])


def test_missing_targets_stay_missing_under_augmentation() -> None:
    missing = head_targets([WITHOUT_DOOR] * 50, at_origin(50))
    draw = draw_augmentation(Augmentation(yaw_deg=90, mirror=0.5, shift=0.1), np.random.default_rng(0), 50, 2)
    moved = augment_targets(missing, draw)
    assert not moved.pop("door").any()
    assert all(np.isnan(values).all() for values in moved.values())


@pytest.mark.parametrize("scale_m", [SCALE_M, 1.5])
def test_columns_of_targets_equal_the_manifest(scene_dataset: PreparedDataset, scale_m: float) -> None:
    rows = scene_dataset.rows
    centroids = np.random.default_rng(0).uniform(-1, 3, (len(rows), 3)).astype(np.float32)
    placement = Placement(centroids, scale_m)
    columns = head_columns(head_targets(rows, placement), placement)
    for name in ("opening_angle_deg", "door_x_m", "door_y_m", "opening_width_m", "passable_width_m"):
        expected = [float(row[name] or math.nan) for row in rows]
        assert np.isfinite(expected).any()
        assert_allclose(columns[name], expected, atol=2e-5)
    turn = columns["door_yaw_deg"] - [float(row["door_yaw_deg"] or math.nan) for row in rows]
    assert_allclose(np.cos(np.radians(turn[~np.isnan(turn)])), 1, atol=1e-6)
    assert_allclose(columns["p_door"], [float(row["state"] != "no_door") for row in rows])
    left = [row["hinge"] == "left" for row in rows if row["hinge"]]
    assert_allclose(columns["p_hinge_left"][~np.isnan(columns["p_hinge_left"])], left)


def test_impossible_opening_angles_become_the_nearest_possible_one() -> None:
    values = np.radians(np.array([[-5.0], [-89.0], [-91.0], [-179.0], [0.0], [75.0], [180.0], [np.nan]]))
    columns = head_columns({"angle": values.astype(np.float32)}, at_origin(8))
    assert_allclose(columns["opening_angle_deg"], [0, 0, 180, 180, 0, 75, 180, np.nan], atol=1e-4)


def test_outputs_are_decoded_to_columns() -> None:
    angle, yaw = torch.tensor([[1.1]]), 2.5
    values = {
        "angle": HEADS["angle"].decode(torch.cat([angle.cos(), angle.sin()], dim=1)).numpy(),
        "frame": HEADS["frame"].decode(torch.tensor([[0.1, -0.2, math.cos(yaw), math.sin(yaw)]])).numpy(),
    }
    columns = head_columns(values, Placement(np.array([[1.0, 0.5, 0.0]], dtype=np.float32), SCALE_M))
    assert_allclose(columns["opening_angle_deg"], math.degrees(1.1), rtol=1e-6)
    assert_allclose([columns["door_x_m"][0], columns["door_y_m"][0]], [1.3, -0.1], atol=1e-6)
    assert_allclose(columns["door_yaw_deg"], math.degrees(2.5) - 90, rtol=1e-6)


def test_losses_worked_by_hand() -> None:
    quarter = torch.tensor([[math.pi / 2]])
    angle, hinge, widths, frame = (HEADS[name].loss for name in ("angle", "hinge", "widths", "frame"))
    assert float(angle(torch.tensor([[0.0, 1.0]]), quarter)) == pytest.approx(0, abs=1e-6)
    assert float(angle(torch.tensor([[1.0, 0.0]]), quarter)) == pytest.approx(math.sqrt(2))
    assert float(hinge(torch.zeros(1, 1), torch.ones(1, 1))) == pytest.approx(math.log(2))
    assert float(widths(torch.tensor([[0.5, 0.25]]), torch.tensor([[0.25, 0.5]]))) == pytest.approx(1.5)
    outputs = torch.tensor([[0.3, 0.4, 1.0, 0.0]])
    assert float(frame(outputs, torch.zeros(1, 3))) == pytest.approx(3 * 0.5)


def test_yaw_loss_is_small_across_a_full_turn() -> None:
    head = HEADS["frame"]
    outputs = torch.tensor([[0.0, 0.0, math.cos(3.14), math.sin(3.14)]])
    assert float(head.loss(outputs, torch.tensor([[0.0, 0.0, -3.14]]))) < 0.01
    assert float(head.decode(outputs)[0, 2]) == pytest.approx(3.14)


@pytest.mark.parametrize("angle", [0.0, 0.5, math.pi / 2, 2.9])
def test_angle_is_decoded_from_a_direction_of_any_length(angle: float) -> None:
    outputs = 3 * torch.tensor([[math.cos(angle), math.sin(angle)]])
    assert float(HEADS["angle"].decode(outputs)) == pytest.approx(angle)


def test_metrics_worked_by_hand() -> None:
    rows = [
        ROW,
        ROW | {"state": "semi_open", "opening_angle_deg": "40", "hinge": "right"},
        ROW | {"state": "closed", "opening_angle_deg": "0", "hinge": ""},
        WITHOUT_DOOR,
    ]
    nan = math.nan
    columns = {
        "p_door": [0.9, 0.4, 0.8, 0.5],
        "opening_angle_deg": [80.0, 45.0, 3.0, 9.0],
        "p_hinge_left": [0.9, 0.6, 0.5, 0.5],
        "door_x_m": [2.3, 2.0, 2.0, 1.0],
        "door_y_m": [0.9, 0.5, 0.5, 1.0],
        "door_yaw_deg": [-90.0, 90.0, 89.0, 1.0],
        "opening_width_m": [1.0, 0.9, nan, 1.0],
    }
    metrics = head_metrics({name: np.array(values) for name, values in columns.items()}, rows)
    assert metrics["door_auroc"] == pytest.approx(2 / 3)
    assert metrics["angle_error_open_deg"] == 10
    assert metrics["angle_error_semi_open_deg"] == 5
    assert metrics["hinge_accuracy"] == metrics["hinge_accuracy_not_closed"] == 0.5
    assert metrics["frame_position_error_median_m"] == 0
    assert metrics["frame_position_error_p90_m"] == pytest.approx(0.4)
    assert metrics["frame_yaw_error_median_deg"] == 1
    # A head without all of its columns has no metrics.
    assert math.isnan(metrics["opening_width_error_m"])
    columns["passable_width_m"] = [0.6, 0.7, 0.6, 0.0]
    metrics = head_metrics({name: np.array(values) for name, values in columns.items()}, rows)
    assert metrics["opening_width_error_m"] == pytest.approx(0.05)
    assert metrics["passable_width_error_m"] == pytest.approx(0.1 / 3)
    assert set(metrics) == {metric.name for head in HEADS.values() for metric in head.metrics}


def test_parts_without_a_label_are_skipped() -> None:
    head = POINT_HEADS["parts"]
    target = head.target(np.array([[0, 5, 255, 1]], dtype=np.uint8))
    assert target.tolist() == [[0, 5, -1, 1]]
    counts = head.confusion(target, np.array([[0, 5, 3, 5]]))
    assert counts.sum() == 3
    assert counts[1, 5] == 1
    assert_allclose(head.metric(counts), [1, 0, np.nan, np.nan, np.nan, 0.5])
    logits = torch.zeros(1, 4, len(head.classes))
    assert float(head.loss(logits, torch.from_numpy(target))) == pytest.approx(math.log(6))

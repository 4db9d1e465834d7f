# SPDX-License-Identifier: Apache-2.0
"""Targets that go through a head's units and back are what the manifest says."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.testing import assert_allclose

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.targets import door_targets
from doorstate.networks.decoding import in_metres
from doorstate.networks.heads import FramePose, OpeningAngle


def test_targets_come_back_as_the_manifest_has_them(scene_dataset: PreparedDataset) -> None:
    rows = scene_dataset.rows
    centroids = np.random.default_rng(0).uniform(-1, 3, (len(rows), 3)).astype(np.float32)
    targets = door_targets(rows, centroids)
    columns = in_metres(targets, centroids)
    for name in ("opening_angle_deg", "door_x_m", "door_y_m", "opening_width_m", "passable_width_m"):
        expected = [float(row[name] or math.nan) for row in rows]
        assert np.isfinite(expected).any()
        assert_allclose(columns[name], expected, atol=2e-5)
    turn = columns["door_yaw_deg"] - [float(row["door_yaw_deg"] or math.nan) for row in rows]
    assert_allclose(np.cos(np.radians(turn[~np.isnan(turn)])), 1, atol=1e-6)
    assert_allclose(columns["p_door"], [float(row["state"] != "no_door") for row in rows])
    left = [row["hinge"] == "left" for row in rows if row["hinge"]]
    assert_allclose(columns["p_hinge_left"][~np.isnan(columns["p_hinge_left"])], left)


def test_an_angle_that_no_door_has_becomes_the_nearest_that_one_has() -> None:
    said = np.radians(np.array([[-5.0], [-89.0], [-91.0], [-179.0], [0.0], [75.0], [180.0], [np.nan]]))
    columns = in_metres({"angle": said.astype(np.float32)}, np.zeros((8, 3), np.float32))
    assert_allclose(columns["opening_angle_deg"], [0, 0, 180, 180, 0, 75, 180, np.nan], atol=1e-4)


def test_heads_that_say_the_target_are_decoded_to_it() -> None:
    angle, yaw = torch.tensor([[1.1]]), 2.5
    outputs = torch.cat([angle.cos(), angle.sin()], dim=1)
    found = {
        "angle": OpeningAngle(8).decode(outputs).detach().numpy(),
        "frame": FramePose(8)
        .decode(torch.tensor([[0.1, -0.2, math.cos(yaw), math.sin(yaw)]]))
        .detach()
        .numpy(),
    }
    columns = in_metres(found, np.array([[1.0, 0.5, 0.0]], dtype=np.float32))
    assert_allclose(columns["opening_angle_deg"], math.degrees(1.1), rtol=1e-6)
    assert_allclose([columns["door_x_m"][0], columns["door_y_m"][0]], [1.3, -0.1], atol=1e-6)
    assert_allclose(columns["door_yaw_deg"], math.degrees(2.5) - 90, rtol=1e-6)

# SPDX-License-Identifier: Apache-2.0
"""Two methods on a few recorded frames, by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.frame_comparison import changed_label, compare_methods
from doorstate.evaluation.frame_tables import frame_tables
from doorstate.evaluation.frames import FrameResults, default_group
from doorstate.evaluation.intervals import bootstrap_mean, grouped_interval
from doorstate.inference.abstention import Abstention
from doorstate.inference.prediction import Prediction
from doorstate.io.sensor_pose import PosedCloud, camera_pose
from doorstate.types import ABSTAINED, DoorState
from doorstate.viewer.frame_page import choose_frames

LABELS = ["closed", "closed", "open", "open", "semi_open", "open", "closed", "no_door"]
BEFORE = ["closed", "open", ABSTAINED, ABSTAINED, "open", "open", "closed", ABSTAINED]
AFTER = ["closed", "closed", "open", "open", ABSTAINED, "closed", "closed", "open"]
DOORS = ["a", "a", "b", "b", "c", "d", "e", ""]
MOMENTS = ["1", "1", "2", "3", "4", "5", "6", "7"]


def prediction(label: str) -> Prediction:
    return (
        Prediction.abstain(Abstention("no_door", {"probability": 0.1}))
        if label == ABSTAINED
        else Prediction(DoorState(label), 9, 1.0)
    )


@pytest.fixture
def results() -> FrameResults:
    frames = tuple(
        LabelledFrame(
            f"{k}.npy",
            label,
            {"door": DOORS[k], "moment": MOMENTS[k]},
            Path(),
            lambda: PosedCloud(np.ones((9, 3), np.float32), camera_pose("ros", tilt_from="assumed")),
        )
        for k, label in enumerate(LABELS)
    )
    outputs = {name: tuple(map(prediction, labels)) for name, labels in (("base", BEFORE), ("site", AFTER))}
    return FrameResults(frames, outputs, ())


def test_changes_are_counted_and_bounded(results: FrameResults) -> None:
    (row,) = results.compare("door").changes.to_dict("records")
    assert (row["before"], row["after"], row["frames"]) == ("base", "site", 7)
    assert (row["correct_before"], row["correct_after"]) == (3, 5)
    assert (row["corrected"], row["broken"]) == (3, 1)
    assert row["wrong_share_before"] == pytest.approx(2 / 5)
    assert row["wrong_share_after"] == pytest.approx(1 / 6)
    assert row["difference"] == pytest.approx(2 / 7)
    assert row["difference_low"] < 2 / 7 < row["difference_high"]
    assert row["difference_grouped_low"] <= row["difference_low"] + 0.1


def test_accuracy_of_each_unit(results: FrameResults) -> None:
    comparison = results.compare("door")
    rows = comparison.units.set_index(["method", "unit"])
    assert rows.loc["base", "units"].to_dict() == {"frame": 7, "moment": 6, "door": 5}
    by_door = grouped_interval(np.array([1, 0, 0, 0, 0, 1, 1], bool), DOORS[:7])
    assert rows.loc[("base", "door"), ["accuracy_low", "accuracy_high"]].tolist() == pytest.approx(by_door)
    widths = (rows["accuracy_high"] - rows["accuracy_low"]).loc["base"]
    assert widths["frame"] < widths["moment"] < widths["door"]
    assert set(comparison.tables()) == {"changes", "units"}
    assert comparison.tables()["changes"].rows[0][3] == "3 → 5"
    assert json.loads(json.dumps(comparison.to_json()))["changes"][0]["corrected"] == 3


def test_within_a_door_frames_of_one_moment_are_one(results: FrameResults) -> None:
    scores = results.score("door", ["door"])
    first = scores.strata["door"].iloc[0]
    assert (first["value"], first["frames"], first["groups"]) == ("a", 2, 1)
    assert (first["accuracy_grouped_low"], first["accuracy_grouped_high"]) == grouped_interval(
        np.array([True, False]), ["1", "1"]
    )
    assert "95 %, a moment as one" in frame_tables(scores, "door")["by_door"].columns
    assert "95 %, a door as one" in frame_tables(scores, "door")["scores"].columns


def test_frames_that_changed(results: FrameResults) -> None:
    kinds = [results.change_of(number) for number in range(len(LABELS))]
    assert kinds == ["", "corrected", "corrected", "corrected", "changed", "broken", "", "changed"]
    assert choose_frames(results, "changed") == [5, 1, 2, 3, 4, 7]
    assert choose_frames(results, "changed", limit=1) == [5]
    assert changed_label("open", "open", "closed") == ""


def test_default_group(results: FrameResults) -> None:
    assert default_group(results.frames) == "door"
    assert default_group(results.frames[-1:]) == "moment"
    assert default_group([]) is None


def test_few_groups_and_one_method_have_no_interval_and_no_change() -> None:
    rows = pd.DataFrame(
        {
            "method": ["a"] * 2 + ["b"] * 2,
            "sample_id": ["1", "2"] * 2,
            "state": "open",
            "predicted": ["open", "closed", "open", "open"],
            "correct": [True, False, True, True],
        }
    )
    frame = rows["sample_id"]
    (change,) = compare_methods(rows, {"frame": frame}, "frame").changes.to_dict("records")
    assert math.isnan(change["difference_low"])
    alone = compare_methods(rows.iloc[:2], {"frame": frame.iloc[:2]}, "frame")
    assert set(alone.tables()) == {"units"}
    nothing = compare_methods(rows.iloc[:0], {"frame": frame.iloc[:0]}, "frame")
    assert nothing.tables() == {}


def test_bootstrap_of_a_mean() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(1, 2, 400)
    low, high = bootstrap_mean(values, pd.Series(range(400)), np.random.default_rng(0))
    assert (low, high) == pytest.approx((values.mean() - 0.196, values.mean() + 0.196), abs=0.03)
    wide = bootstrap_mean(np.repeat(values[:40], 10), np.repeat(np.arange(40), 10), np.random.default_rng(0))
    assert wide[1] - wide[0] > 2 * (high - low)
    assert all(map(math.isnan, bootstrap_mean(np.zeros(0), [], rng)))

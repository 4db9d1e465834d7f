# SPDX-License-Identifier: Apache-2.0
"""Scores of a few recorded frames, by hand."""

from __future__ import annotations

import json
import math

import pandas as pd
import pytest

from doorstate.evaluation.frame_scores import FrameScores, score_frames
from doorstate.evaluation.frame_tables import frame_notes, frame_tables
from doorstate.types import ABSTAINED, STATES

LABELS = ["closed", "closed", "closed", "closed", "semi_open", "open", "no_door", "no_door", "openings"]
DOORS = ["a", "a", "b", "c", "d", "e", "/1", "/2", "/3"]
SENSORS = ["xtion"] * 5 + ["d435"] * 4
PREDICTED = ["closed", "closed", "open", ABSTAINED, "semi_open", "open", "closed", "semi_open", ABSTAINED]
PROBABILITIES = [0.9, 0.8, 0.6, 0.0, 0.7, 0.5, 0.9, 0.5, 0.0]


def predictions(labels: list[str] = LABELS, predicted: list[str] = PREDICTED) -> pd.DataFrame:
    """Return the predictions of one method."""
    frame = pd.DataFrame({"method": "net", "state": labels, "predicted": predicted})
    frame["correct"] = frame["predicted"] == frame["state"].where(frame["state"].isin(STATES), ABSTAINED)
    for state in STATES:
        frame[f"p_{state}"] = [
            probability if label == state else 0.0
            for label, probability in zip(predicted, PROBABILITIES, strict=False)
        ]
    return frame


@pytest.fixture
def scores() -> FrameScores:
    return score_frames(predictions(), pd.Series(DOORS), {"sensor": pd.Series(SENSORS)})


def test_counts_by_hand(scores: FrameScores) -> None:
    assert (scores.frames, scores.groups) == (6, 5)
    assert scores.states == {"closed": 4, "semi_open": 1, "open": 1}
    net = scores.scores.iloc[0]
    assert (net["frames"], net["correct"], net["abstained"]) == (6, 4, 1)
    assert scores.confusion.drop(columns=["method", "state"]).to_numpy().tolist() == [
        [2, 0, 1, 1],
        [0, 1, 0, 0],
        [0, 0, 1, 0],
    ]
    closed = scores.recall.iloc[0]
    assert closed[["correct", "frames", "groups", "recall"]].tolist() == [2, 4, 3, 0.5]
    # F1: closed 2*2/(4+2), semi-open 1, open 2/(1+2).
    assert net["f1"] == pytest.approx((2 / 3 + 1 + 2 / 3) / 3)
    assert net["f1_low"] <= net["f1"] <= net["f1_high"]


def test_frames_without_a_door_are_counted_apart(scores: FrameScores) -> None:
    apart = scores.without_door.set_index("label")
    assert list(apart.index) == ["no_door", "openings"]
    assert apart["frames"].tolist() == [2, 1]
    assert apart["predicted_states"].tolist() == [2, 0]
    assert apart.loc["no_door", list(STATES)].tolist() == [1, 1, 0]
    assert apart.loc["no_door", ["probability_median", "probability_max"]].tolist() == [0.7, 0.9]
    assert math.isnan(apart.loc["openings", "probability_median"])


def test_strata_add_up(scores: FrameScores) -> None:
    parts = scores.strata["sensor"]
    assert parts[["value", "correct", "frames"]].to_numpy().tolist() == [["xtion", 3, 5], ["d435", 1, 1]]


def test_a_constant_method_is_the_baseline(scores: FrameScores) -> None:
    assert scores.constant == "closed"
    assert scores.scores["method"].tolist() == ["net", "always closed"]
    assert scores.scores["correct"].tolist() == [4, 4]


def test_too_few_doors_give_no_interval_of_f1() -> None:
    groups = pd.Series(["a"] * 4 + ["b"] * 5)
    net = score_frames(predictions(), groups, {}).scores.iloc[0]
    assert math.isnan(net["f1_grouped_low"])
    assert not math.isnan(net["f1_low"])
    assert net["accuracy_grouped_high"] - net["accuracy_grouped_low"] > 0.7


def test_undefined_scores_are_plain_json() -> None:
    frame = predictions(["no_door"], ["open"])
    scores = score_frames(frame, pd.Series(["x"]), {"s": pd.Series(["y"])})
    document = scores.to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert len(frame_notes(scores)) == 1
    assert list(frame_tables(scores)) == ["without_door"]


def test_scores_repeat() -> None:
    one, two = (score_frames(predictions(), pd.Series(DOORS), {}).to_json() for _ in range(2))
    assert one == two


def test_tables_have_a_cell_for_every_column(scores: FrameScores) -> None:
    columns = {}
    for group in ("door", "frame"):
        tables = frame_tables(scores, group)
        assert list(tables) == ["scores", "recall", "confusion", "by_sensor", "without_door"]
        for table in tables.values():
            assert {len(row) for row in table.rows} == {len(table.columns)}
        columns[group] = len(tables["scores"].columns)
    assert columns["door"] == columns["frame"] + 3
    assert len(frame_notes(scores, "door")) == 2

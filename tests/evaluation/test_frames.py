# SPDX-License-Identifier: Apache-2.0
"""Predictions of several methods for the same frames: one reading, one prediction each, and unreadable files."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.labelled import LabelledFrame
from doorstate.errors import CloudReadError, ConfigError
from doorstate.evaluation.frames import FrameResults, Predictors, evaluate_frames
from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import PosedCloud, camera_pose
from doorstate.simulation.frames import Frame
from doorstate.types import ABSTAINED, STATES
from doorstate.viewer.frame_page import choose_frames


@pytest.fixture(scope="module")
def predictors(weights: Path) -> Predictors:
    return {"net": Predictor.load(weights), "plane_state": Predictor.load(rule="plane_state")}


def broken() -> PosedCloud:
    raise CloudReadError("is not a PCD file", path="d.pcd")


@pytest.fixture(scope="module")
def labelled(frames: list[Frame]) -> list[LabelledFrame]:
    """Three states of one door, a scene without one, a cloud with two points, and a file that cannot be read."""
    clouds = [frame.points for frame in frames]
    tiny = np.ones((2, 3), np.float32)

    def frame(name: str, label: str, read: object, **columns: str) -> LabelledFrame:
        return LabelledFrame(name, label, columns, Path(), read)  # type: ignore[arg-type]

    doors = [
        frame(
            f"{state}.pcd",
            state,
            partial(PosedCloud, cloud, camera_pose("ros", tilt_from="assumed")),
            door="wood",
            light="dim",
        )
        for state, cloud in zip(STATES, clouds, strict=True)
    ]
    return [
        *doors,
        frame("wall.pcd", "no_door", partial(PosedCloud, clouds[0], camera_pose("ros", tilt_from="assumed"))),
        frame(
            "tiny.pcd",
            "open",
            partial(PosedCloud, tiny, camera_pose("ros", tilt_from="assumed")),
            door="wood and GLASS",
        ),
        frame("broken.pcd", "open", broken),
    ]


@pytest.fixture(scope="module")
def results(predictors: Predictors, labelled: list[LabelledFrame]) -> FrameResults:
    return evaluate_frames(predictors, labelled)


def test_every_method_predicts_every_readable_frame(
    results: FrameResults, predictors: Predictors, frames: list[Frame]
) -> None:
    files = ["closed.pcd", "semi_open.pcd", "open.pcd", "wall.pcd", "tiny.pcd"]
    assert [frame.file for frame in results.frames] == files
    assert [frame.file for frame, _ in results.unreadable] == ["broken.pcd"]
    for name, predictor in predictors.items():
        assert results.outputs[name][0].state == predictor(frames[0].points).state
        assert len(results.outputs[name]) == 5


def test_a_method_abstains_from_a_cloud_it_cannot_use(results: FrameResults) -> None:
    for predictions in results.outputs.values():
        assert predictions[4].state is None
        assert predictions[4].reason
    assert set(results.misclassified_by(4)) == {"net", "plane_state"}


def test_probabilities_are_those_of_a_network_that_ran(results: FrameResults) -> None:
    rows = results.predictions.set_index(["method", "sample_id"])[["p_closed", "p_semi_open", "p_open"]]
    assert rows.loc["plane_state"].isna().all(axis=None)
    assert rows.loc[("net", "tiny.pcd")].isna().all()
    assert rows.loc[("net", "closed.pcd")].sum() == pytest.approx(1)


def test_progress_counts_files(predictors: Predictors, labelled: list[LabelledFrame]) -> None:
    calls: list[tuple[int, int]] = []
    rule = {"plane_state": predictors["plane_state"]}
    evaluate_frames(rule, labelled[:2], lambda done, total: calls.append((done, total)))
    assert calls == [(1, 2), (2, 2)]


def test_scores_count_the_predictions(results: FrameResults) -> None:
    scores = results.score("door", ["light", "door:glass"])
    correct = sum(
        prediction.state == frame.label
        for frame, prediction in zip(results.frames, results.outputs["plane_state"], strict=True)
    )
    by_method = scores.scores.set_index("method")
    assert by_method.loc["plane_state", "correct"] == correct
    assert (scores.frames, scores.groups) == (4, 2)
    for name, expected in (
        ("light", {"dim": 3, "unknown": 1}),
        ("door:glass", {"not glass": 3, "glass": 1}),
    ):
        parts = scores.strata[name]
        parts = parts[parts["method"] == "net"]
        assert dict(zip(parts["value"], parts["frames"], strict=True)) == expected
    assert scores.without_door["label"].tolist() == ["no_door"] * 2
    assert results.score().groups == 4
    with pytest.raises(ConfigError):
        results.score("colour")


def test_predictions_are_joined_with_the_index(results: FrameResults) -> None:
    frame = results.joined
    assert len(frame) == 10
    first = frame.iloc[0]
    assert (first["sample_id"], first["method"], first["door"]) == ("closed.pcd", "net", "wood")
    assert first[[f"p_{state}" for state in STATES]].sum() == pytest.approx(1)
    assert frame["predicted"].iloc[4] == ABSTAINED
    on_wall = frame[frame["state"] == "no_door"]
    assert on_wall["correct"].tolist() == (on_wall["predicted"] == ABSTAINED).tolist()


def test_a_column_of_the_index_does_not_replace_a_prediction(
    predictors: Predictors, labelled: list[LabelledFrame]
) -> None:
    frame = replace(labelled[0], columns={"predicted": "open", "p_open": "1", "note": "kept"})
    (row,) = evaluate_frames({"plane_state": predictors["plane_state"]}, [frame]).joined.to_dict("records")
    assert (row["predicted"], row["note"]) == ("closed", "kept")
    assert math.isnan(row["p_open"])


def test_frames_that_most_methods_missed_come_first(results: FrameResults) -> None:
    chosen = choose_frames(results, "all")
    misses = [len(results.misclassified_by(number)) for number in chosen]
    assert sorted(chosen) == [0, 1, 2, 3, 4]
    assert misses == sorted(misses, reverse=True)
    wrong_only = choose_frames(results)
    assert wrong_only == [number for number in chosen if results.misclassified_by(number)]
    assert choose_frames(results, "all", limit=2) == chosen[:2]

# SPDX-License-Identifier: Apache-2.0
"""Several methods asked about the same frames: one reading, one answer each, and what nobody could read."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.labelled import LabelledFrame
from doorstate.errors import CloudReadError, ConfigError
from doorstate.evaluation.frames import Asked, Methods, ask
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.simulation.frames import Frame
from doorstate.types import ABSTAINED, STATES, Points
from doorstate.viewer.frame_page import choose_frames


@pytest.fixture(scope="module")
def methods(viewer: Predictor) -> Methods:
    return {"net": viewer, "plane_state": RulePredictor.from_name("plane_state")}


def broken() -> Points:
    raise CloudReadError("d.pcd: is no PCD file")


@pytest.fixture(scope="module")
def labelled(frames: list[Frame]) -> list[LabelledFrame]:
    """Three states of one door, a scene without one, a cloud with two points, and a file that cannot be read."""
    clouds = [frame.points for frame in frames]
    tiny = np.ones((2, 3), np.float32)

    def frame(name: str, label: str, read: object, **columns: str) -> LabelledFrame:
        return LabelledFrame(name, label, columns, Path(), read)  # type: ignore[arg-type]

    known = [
        frame(f"{state}.pcd", state, partial(np.copy, cloud), door="wood", light="dim")
        for state, cloud in zip(STATES, clouds, strict=True)
    ]
    return [
        *known,
        frame("wall.pcd", "no_door", partial(np.copy, clouds[0])),
        frame("tiny.pcd", "open", partial(np.copy, tiny), door="wood and GLASS"),
        frame("broken.pcd", "open", broken),
    ]


@pytest.fixture(scope="module")
def asked(methods: Methods, labelled: list[LabelledFrame]) -> Asked:
    return ask(methods, labelled)


def test_every_method_is_asked_about_every_frame_that_can_be_read(
    asked: Asked, methods: Methods, frames: list[Frame]
) -> None:
    assert [frame.file for frame in asked.frames] == [
        "closed.pcd",
        "semi_open.pcd",
        "open.pcd",
        "wall.pcd",
        "tiny.pcd",
    ]
    assert [(frame.file, why) for frame, why in asked.unreadable] == [("broken.pcd", "d.pcd: is no PCD file")]
    for name, method in methods.items():
        assert asked.predictions[name][0].state == method(frames[0].points).state
        assert len(asked.predictions[name]) == 5


def test_a_cloud_that_a_method_cannot_use_has_no_answer_and_a_reason(asked: Asked) -> None:
    for said in asked.predictions.values():
        assert said[4].state is None
        assert said[4].reason
    assert set(asked.wrong(4)) == {"net", "plane_state"}


def test_progress_counts_files(methods: Methods, labelled: list[LabelledFrame]) -> None:
    seen: list[tuple[int, int]] = []
    ask({"plane_state": methods["plane_state"]}, labelled[:2], lambda done, total: seen.append((done, total)))
    assert seen == [(1, 2), (2, 2)]


def test_metrics_are_of_the_answers(asked: Asked) -> None:
    metrics = asked.metrics("door", ["light", "door:glass"])
    right = sum(
        asked.predictions["plane_state"][number].state is not None
        and asked.predictions["plane_state"][number].state.label == frame.label
        for number, frame in enumerate(asked.frames)
    )
    found = metrics["methods"]["plane_state"]
    assert found["all"]["right"] == right
    assert (metrics["frames"], metrics["groups"]) == (4, 2)
    assert {name: part["frames"] for name, part in found["by"]["light"].items()} == {"dim": 3, "not said": 1}
    assert {name: part["frames"] for name, part in found["by"]["door:glass"].items()} == {
        "not glass": 3,
        "glass": 1,
    }
    assert found["without_a_door"]["no_door"]["frames"] == 1
    assert asked.metrics(None)["groups"] == 4
    with pytest.raises(ConfigError, match="no column 'colour'; there are: door, light"):
        asked.metrics("colour")


def test_rows_hold_answers_and_what_is_known(asked: Asked) -> None:
    rows = asked.rows()
    assert len(rows) == 10
    assert (rows[0]["file"], rows[0]["method"], rows[0]["door"]) == ("closed.pcd", "net", "wood")
    assert sum(float(rows[0][f"p_{state}"]) for state in STATES) == pytest.approx(1, abs=1e-4)
    assert rows[4]["predicted"] == ABSTAINED


def test_no_column_of_the_index_takes_the_place_of_an_answer(
    methods: Methods, labelled: list[LabelledFrame]
) -> None:
    told = replace(labelled[0], columns={"predicted": "open", "p_open": "1", "note": "kept"})
    (row,) = ask({"plane_state": methods["plane_state"]}, [told]).rows()
    assert (row["predicted"], row["p_closed"], row["note"]) == ("closed", "1", "kept")


def test_frames_that_most_methods_missed_come_first(asked: Asked) -> None:
    chosen = choose_frames(asked, everything=True)
    misses = [len(asked.wrong(number)) for number in chosen]
    assert sorted(chosen) == [0, 1, 2, 3, 4]
    assert misses == sorted(misses, reverse=True)
    wrong_only = choose_frames(asked, everything=False)
    assert wrong_only == [number for number in chosen if asked.wrong(number)]
    assert choose_frames(asked, everything=True, most=2) == chosen[:2]

# SPDX-License-Identifier: Apache-2.0
"""Labelling without a browser: proposals, saving, undo, and going on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doorstate._files import read_csv
from doorstate.dataset.frame_labels import LabelIndex
from doorstate.dataset.labelled import labelled_frames
from doorstate.doorways.doorway import Doorway
from doorstate.errors import ConfigError, DatasetError, DoorstateError
from doorstate.simulation.frames import Frame
from doorstate.viewer.frame_sources import FolderFrames
from doorstate.viewer.label_session import GivenBox, GivenLabels, LabelledBeforeError, LabelSession
from tests.viewer.labelling import FILES, OPTIONS, write_depth_images


@pytest.fixture
def folder(frames: list[Frame], tmp_path: Path) -> Path:
    return write_depth_images(tmp_path / "depth", frames)


def open_session(folder: Path) -> LabelSession:
    return LabelSession(FolderFrames(folder, OPTIONS), LabelIndex(folder))


def given(*labels: dict[str, Any], overwrite: bool = False) -> GivenLabels:
    return GivenLabels.model_validate_json(json.dumps({"labels": labels, "overwrite": overwrite}))


def place(shown: dict[str, Any]) -> dict[str, float]:
    return {name: value for name, value in shown["candidates"][0].items() if name != "score"}


def states(folder: Path) -> list[tuple[str, str, str]]:
    return [(row["file"], row["state"], row["moment"]) for row in read_csv(folder / "index.csv")]


def test_labels_are_proposed_while_nothing_moves(folder: Path) -> None:
    session = open_session(folder)
    shown = session.show(0)
    assert set(shown["pictures"]) == {"depth", "colour"}
    assert shown["size"] == [320, 240]
    assert shown["candidates"][0]["score"] > 0.5
    assert (shown["labels"], shown["proposed"], shown["note"]) == ([], [], "")
    session.save(0, given({"state": "closed", "door": " kitchen ", "place": place(shown)}))
    still = session.show(1)
    assert still["proposed"] == [{"state": "closed", "door": "kitchen", "place": place(shown)}]
    assert (still["labelled"], still["doors"]) == (1, ["kitchen"])
    session.save(1, given(*still["proposed"]))
    moved = session.show(2)
    assert moved["proposed"] == []
    session.save(2, given({"state": "open", "door": "kitchen", "place": place(shown)}))
    assert states(folder) == [
        (FILES[0], "closed", "1_closed"),
        (FILES[1], "closed", "1_closed"),
        (FILES[2], "open", "3_open"),
    ]
    assert session.counts() == {"closed": 2, "open": 1}


def test_words_of_others_are_not_proposed(folder: Path) -> None:
    (folder / "index.csv").write_text(f"file,state\n{FILES[0]},ambiguous\n", encoding="utf-8")
    session = open_session(folder)
    assert session.show(1)["proposed"] == []
    assert session.show(0)["labels"] == [{"state": "ambiguous", "door": "", "place": None}]


def test_a_new_session_goes_on_after_the_last_label(folder: Path) -> None:
    session = open_session(folder)
    assert session.start() == 0
    session.save(1, given({"state": "unknown"}))
    again = open_session(folder)
    assert (again.start(), again.labelled) == (2, 1)
    again.save(3, given({"state": "no_door"}))
    assert open_session(folder).start() == 3, "the last frame, when all is done"
    assert [frame.label for frame in labelled_frames(folder)] == ["unknown", "no_door"]


def test_labels_from_before_are_overwritten_only_when_asked(folder: Path) -> None:
    (folder / "index.csv").write_text(f"file,state,note\n{FILES[0]},semi-open,mine\n", encoding="utf-8")
    session = open_session(folder)
    assert session.show(0)["labelled_before"]
    with pytest.raises(LabelledBeforeError):
        session.save(0, given({"state": "open"}))
    assert read_csv(folder / "index.csv") == [{"file": FILES[0], "state": "semi-open", "note": "mine"}]
    session.save(0, given({"state": "open"}, overwrite=True))
    session.save(0, given({"state": "closed"}))
    assert read_csv(folder / "index.csv")[0]["note"] == "mine"
    assert (session.undo(), session.undo()) == (0, 0)
    assert read_csv(folder / "index.csv") == [{"file": FILES[0], "state": "semi-open", "note": "mine"}]
    with pytest.raises(LabelledBeforeError):
        session.save(0, given({"state": "open"}))


def test_undo_takes_back_one_change_after_the_other(folder: Path) -> None:
    session = open_session(folder)
    assert session.undo() is None
    session.save(0, given({"state": "open"}))
    session.save(2, given({"state": "closed"}))
    session.save(0, given({"state": "closed"}))
    assert session.undo() == 0
    assert session.show(0)["labels"][0]["state"] == "open"
    assert session.undo() == 2
    assert session.undo() == 0
    assert not (folder / "index.csv").exists()
    assert session.undo() is None


def test_a_box_around_a_door_places_it(folder: Path) -> None:
    session = open_session(folder)
    shown = session.show(2)
    found = place(shown)
    doorway = Doorway(**found)
    half_m = doorway.width_m / 2
    corners = doorway.to_sensor(np.array([[half_m, 0, 1.6], [-half_m, 0, 0.2]], np.float32))
    u, v, w = np.array(shown["projection"]).reshape(3, 3) @ corners.T
    (left, right), (top, bottom) = u / w, v / w
    drawn = session.place(2, GivenBox(box=(right, bottom, left, top)))
    assert drawn["x_m"] == pytest.approx(found["x_m"], abs=0.25)
    assert drawn["y_m"] == pytest.approx(found["y_m"], abs=0.25)
    with pytest.raises(ConfigError):
        session.place(2, GivenBox(box=(0, 0, 5000, 10)))


def test_impossible_places_and_unreadable_frames_are_refused(folder: Path) -> None:
    session = open_session(folder)
    far = {"x_m": 50, "y_m": 0, "yaw_deg": 90, "width_m": 0.9, "floor_z_m": -1}
    with pytest.raises(ConfigError):
        session.save(0, given({"state": "open", "place": far}))
    (folder / FILES[1]).write_bytes(b"garbage")
    assert "error" in session.show(1)
    with pytest.raises(DoorstateError):
        session.save(1, given({"state": "open"}))
    assert not (folder / "index.csv").exists()


def test_labels_of_another_topic_are_not_mixed(folder: Path) -> None:
    (folder / "index.csv").write_text("file,state,topic\na.npz,open,/left\n", encoding="utf-8")
    source = FolderFrames(folder, OPTIONS)
    source.topic_name = "/right"
    with pytest.raises(DatasetError) as raised:
        LabelSession(source, LabelIndex(folder))
    assert raised.value.field == "topic"

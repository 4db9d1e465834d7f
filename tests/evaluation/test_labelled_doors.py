# SPDX-License-Identifier: Apache-2.0
"""Predictions at the places of labelled doors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from doorstate.dataset.labelled import LabelledFrame
from doorstate.doorways.doorway import Doorway
from doorstate.evaluation.frames import evaluate_frames
from doorstate.evaluation.labelled_doors import prediction_at
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import PosedCloud, camera_pose
from doorstate.types import DoorState, Points

LEFT, RIGHT = Doorway(3, 1, 90, 0.9, -1), Doorway(3, -1, 90, 0.9, -1)
NO_DOOR = Abstention("no_door", {"probability": 0.1})


def door(x_m: float, y_m: float, state: str | None = None, yaw_deg: float = 90.0) -> Door:
    return Door(x_m, y_m, yaw_deg, 0.9, DoorState(state) if state else None, None if state else NO_DOOR)


def predict(doors: Sequence[Door], refused: Sequence[Door] = ()) -> Prediction:
    return Prediction.from_doors(doors, refused, 1000, 5.0)


def test_each_door_has_its_own_prediction() -> None:
    both = predict([door(3.1, 1.1, "open"), door(2.9, -0.8, "closed")])
    assert prediction_at(both, None) is both
    assert prediction_at(both, LEFT).state == "open"
    assert prediction_at(both, RIGHT).state == "closed"
    assert prediction_at(both, Doorway(3, 0.1, 90, 0.9, -1)).label == "abstained"
    assert prediction_at(both, Doorway(3, 1, 30, 0.9, -1)).label == "abstained"
    assert prediction_at(both, Doorway(3, 1, 270, 0.9, -1)).state == "open", "the other face of the wall"


@pytest.mark.parametrize(("refused", "code"), [([door(3, 1)], "no_door"), ([door(3, -1)], "no_doorway")])
def test_a_door_that_was_not_found_has_a_reason(refused: list[Door], code: str) -> None:
    prediction = prediction_at(predict([door(3, -1.1, "open")], refused), LEFT)
    assert prediction.abstention is not None
    assert prediction.abstention.code == code


def test_methods_for_whole_frames_and_refused_frames_answer_for_every_door() -> None:
    whole = Prediction(DoorState.OPEN, 1000, 5.0)
    refused = Prediction.abstain(Abstention("no_floor"))
    assert prediction_at(whole, LEFT) is whole
    assert prediction_at(refused, LEFT) is refused


def test_a_file_with_two_doors_is_read_once() -> None:
    reads = []

    def read() -> PosedCloud:
        reads.append(1)
        return PosedCloud(
            np.ones((200, 3), np.float32), replace(camera_pose("ros", tilt_from="given"), camera_height_m=0.7)
        )

    def predictor(cloud: Points, **known: object) -> Prediction:
        assert len(cloud) == 200
        assert known == {"door_known": False, "is_level": True, "camera_height_m": 0.7}
        return predict([door(3, 1, "open"), door(3, -1, "closed")])

    frames = [
        LabelledFrame("a.npy", "open", {"door": "left"}, Path(), read, LEFT),
        LabelledFrame("a.npy", "open", {"door": "right"}, Path(), read, RIGHT, 2),
    ]
    results = evaluate_frames({"net": cast(Predictor, predictor)}, frames)
    assert len(reads) == 1
    assert results.joined["sample_id"].tolist() == ["a.npy", "a.npy#2"]
    assert results.joined["predicted"].tolist() == ["open", "closed"]
    assert results.joined["door"].tolist() == ["left", "right"]
    assert [results.misclassified_by(number) for number in range(2)] == [[], ["net"]]

# SPDX-License-Identifier: Apache-2.0
"""Outputs of a network as a prediction: what is refused has neither probabilities nor geometry."""

from __future__ import annotations

import json

import numpy as np
import pytest

from doorstate.inference.abstention import Abstention, AbstentionCode
from doorstate.inference.backends import CloudOutputs
from doorstate.inference.decode import decode
from doorstate.inference.prediction import DoorFrame, Prediction
from doorstate.inference.serialization import prediction_to_dict
from doorstate.types import ABSTAINED, STATES

HEADS = {
    "p_door": 0.9,
    "opening_angle_deg": 80.0,
    "p_hinge_left": 0.3,
    "door_x_m": 2.0,
    "door_y_m": 0.1,
    "door_yaw_deg": 90.0,
    "opening_width_m": 0.9,
    "passable_width_m": 0.7,
}
GEOMETRY = ("opening_angle_deg", "hinge", "hinge_probability", "frame", "opening_width_m", "passable_width_m")


def decoded(p_open: float = 0.8, abstain_below: float = 0.0, **heads: float) -> Prediction:
    probabilities = np.array([(1 - p_open) / 2, (1 - p_open) / 2, p_open], np.float32)
    return decode(CloudOutputs(probabilities, HEADS | heads), abstain_below, 1024, 5.0)


def test_a_state_has_probabilities_and_geometry() -> None:
    prediction = decoded()
    assert (prediction.state, prediction.label, prediction.reason) == ("open", "open", "")
    assert prediction.probabilities == pytest.approx(dict(zip(STATES, (0.1, 0.1, 0.8), strict=True)))
    assert prediction.probability == pytest.approx(0.8)
    assert (prediction.hinge, prediction.hinge_probability) == ("right", pytest.approx(0.7))
    assert prediction.frame == DoorFrame(2.0, 0.1, 90.0)
    record = json.loads(json.dumps(prediction_to_dict(prediction)))
    assert (record["state"], record["hinge_probability"]) == ("open", 0.7)
    assert "raw_probabilities" not in record


def test_a_hinge_has_the_probability_of_its_side() -> None:
    prediction = decoded(p_hinge_left=0.6)
    assert (prediction.hinge, prediction.hinge_probability) == ("left", 0.6)


@pytest.mark.parametrize(
    ("prediction", "code"),
    [(decoded(p_door=0.4), "no_door"), (decoded(p_open=0.6, abstain_below=0.7), "unsure")],
)
def test_a_refused_state_has_neither(prediction: Prediction, code: AbstentionCode) -> None:
    assert prediction.abstention is not None
    assert prediction.abstention.code == code
    assert (prediction.state, prediction.label) == (None, ABSTAINED)
    assert (prediction.probabilities, prediction.probability) == (None, None)
    assert [getattr(prediction, name) for name in GEOMETRY] == [None] * len(GEOMETRY)
    assert prediction.raw_probabilities is not None
    assert sum(prediction.raw_probabilities.values()) == pytest.approx(1)
    record = prediction_to_dict(prediction)
    assert set(record) == {
        "state",
        "raw_probabilities",
        "points",
        "milliseconds",
        "reason",
        "door_probability",
    }


def test_the_door_of_a_whole_cloud_is_listed_where_its_frame_and_width_are_known() -> None:
    prediction = decoded()
    (door,) = prediction.doors
    assert (door.frame, door.width_m, door.state) == (prediction.frame, 0.9, prediction.state)
    assert (door.hinge, door.passable_width_m) == (prediction.hinge, 0.7)
    assert (door.position_error_m, door.leaf_seen) == (None, None)
    assert decoded(opening_width_m=0.0).doors == decoded(p_door=0.4).doors == ()
    refused = prediction.refuse(Abstention("opening_not_seen", {"share": 0.5, "min_share": 0.95}))
    assert (refused.doors, refused.frame) == ((), None)


def test_a_known_door_is_not_asked_whether_it_is_there() -> None:
    outputs = CloudOutputs(np.array([0.1, 0.1, 0.8], np.float32), HEADS | {"p_door": 0.1})
    assert decode(outputs, 0.0, 1024, 5.0).state is None
    known = decode(outputs, 0.0, 1024, 5.0, door_known=True)
    assert (known.state, known.door_probability) == ("open", 0.1)
    assert decode(outputs, 0.9, 1024, 5.0, door_known=True).state is None  # unsure

# SPDX-License-Identifier: Apache-2.0
"""Predictions and doors as JSON values."""

from __future__ import annotations

import json
from dataclasses import fields

from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import DOOR_FIELDS, door_to_dict, prediction_to_dict
from doorstate.inference.tilt import Tilt
from doorstate.serving.models import DoorResponse, PredictionResponse
from doorstate.types import DoorState

OPEN = Door(
    3.00049,
    0.5,
    85.04,
    0.9,
    DoorState.OPEN,
    raw_probabilities={"closed": 0.1, "semi_open": 0.1, "open": 0.8},
    door_probability=0.98,
    opening_angle_deg=91.26,
    angle_error_deg=5.0,
    hinge="left",
    hinge_probability=0.9,
    passable_width_m=0.84,
    leaf_seen=False,
    position_error_m=0.051,
    yaw_error_deg=1.2,
    floor_z_m=-1.0,
    score=0.71,
)
UNSURE = OPEN.refuse(Abstention("unsure", {"state": "open", "probability": 0.8, "min_probability": 0.9}))


def test_a_door_has_all_its_values_rounded() -> None:
    record = door_to_dict(OPEN)
    assert record["state"] == "open"
    assert (record["x_m"], record["yaw_deg"], record["opening_angle_deg"]) == (3.0, 85.0, 91.3)
    assert (record["distance_m"], record["bearing_deg"]) == (3.042, 9.5)
    assert record["leaf_seen"] is False
    assert DOOR_FIELDS.keys() <= record.keys()
    # Every value of a door is written, but for the floor, which a level frame of the camera does not need.
    own = {field.name for field in fields(Door)} - {"abstention", "raw_probabilities", "floor_z_m"}
    assert own <= record.keys()


def test_a_refused_door_has_its_place_and_its_reason() -> None:
    record = door_to_dict(UNSURE)
    assert record["state"] is None
    assert record["reason"] == UNSURE.reason
    assert record["raw_probabilities"] == {"closed": 0.1, "semi_open": 0.1, "open": 0.8}
    assert (record["x_m"], record["width_m"]) == (3.0, 0.9)
    assert record.keys().isdisjoint(
        {"probabilities", "hinge", "opening_angle_deg", "passable_width_m", "leaf_seen"}
    )


def test_a_prediction_lists_its_doors_and_its_tilt() -> None:
    tilt = Tilt(-0.001, 12.346, "floor", 0.5)
    prediction = Prediction.from_doors([OPEN, UNSURE], [], 2048, 31.0, tilt)
    record = json.loads(json.dumps(prediction_to_dict(prediction)))
    assert record["doors"] == [door_to_dict(OPEN), door_to_dict(UNSURE)]
    assert record["tilt"] == {"roll_deg": 0.0, "pitch_deg": 12.35, "tilt_from": "floor", "error_deg": 0.5}
    assert (record["door_x_m"], record["opening_width_m"], record["leaf_seen"]) == (3.0, 0.9, False)
    none = prediction_to_dict(Prediction.from_doors([], [], 300, 31.0))
    assert none.keys() == {"state", "points", "milliseconds", "reason"}


def test_the_service_describes_every_field() -> None:
    assert door_to_dict(OPEN).keys() | {"reason", "raw_probabilities"} == DoorResponse.model_fields.keys()
    prediction = prediction_to_dict(Prediction.from_doors([OPEN], [], 1, 1.0, Tilt(0, 0, "walls")))
    described = PredictionResponse.model_fields.keys() - {"reason", "raw_probabilities", "sensor_pose"}
    assert prediction.keys() == described

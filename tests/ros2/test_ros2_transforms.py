# SPDX-License-Identifier: Apache-2.0
"""Transforms on a stand-in of tf's buffer, and doors with names: a transform that is missing is a reason."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from doorstate_ros.doors_json import doors_json
from doorstate_ros.transforms import Transforms

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.live_doors import LiveDoors
from doorstate.doors.pose_file import DEFAULTS
from doorstate.errors import CameraError
from doorstate.inference.door import Door
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings
from doorstate.io.options import ReadOptions
from doorstate.io.sensor_pose import PosedCloud
from doorstate.types import DoorState, Points
from tests.cameras.scripted import FixedPredictor
from tests.doors.examples import AT_ORIGIN, named

TURNED = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))  # 90 degrees to the left
LOOK_FORWARD = (-0.5, 0.5, -0.5, 0.5)  # an optical frame (x right, y down, z forward) in a level one


class Buffer:
    """Stand-in of `tf2_ros.Buffer` with one transform, known from a time on."""

    def __init__(self, quaternion: tuple[float, float, float, float], from_ns: int = 0) -> None:
        self._rotation = SimpleNamespace(**dict(zip("xyzw", quaternion, strict=True)))
        self._from_ns = from_ns
        self.asked: list[tuple[Any, ...]] = []

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any) -> Any:
        self.asked.append((target_frame, source_frame, time, timeout))
        if time < self._from_ns:
            raise RuntimeError("Lookup would require extrapolation into the past.")
        translation = SimpleNamespace(x=1.0, y=2.0, z=0.5)
        return SimpleNamespace(transform=SimpleNamespace(translation=translation, rotation=self._rotation))


def transforms(buffer: Buffer) -> Transforms:
    return Transforms(buffer, lambda stamp_ns: stamp_ns, lambda seconds: seconds)


def test_the_place_of_a_camera_is_that_of_its_level_frame() -> None:
    buffer = Buffer(TURNED)
    place = transforms(buffer).place("camera_link", DEFAULTS, 5, 0.2)
    assert isinstance(place, CameraPlace)
    assert tuple(place.pose) == pytest.approx((1.0, 2.0, 90.0))
    assert buffer.asked == [("map", "camera_link", 5, 0.2)]


def test_optical_frames_look_along_z() -> None:
    place = transforms(Buffer(LOOK_FORWARD)).place("optical", DEFAULTS._replace(axes="optical"), 0, 0.0)
    assert isinstance(place, CameraPlace)
    assert place.pose.yaw_deg == pytest.approx(0.0, abs=1e-6)


def test_a_missing_transform_is_a_reason() -> None:
    looked_up = transforms(Buffer(TURNED, from_ns=100))
    missing = looked_up.place("camera", DEFAULTS, 50, 0.0)
    assert isinstance(missing, MissingPlace)
    assert "camera to map" in missing.reason
    with pytest.raises(CameraError, match="extrapolation"):
        looked_up.rotation("camera", "odom", 50, 0.0)
    assert looked_up.rotation("camera", "odom", 100, 0.0) == TURNED


class SeesOpenDoor(FixedPredictor):
    """Predictor that sees an open door straight ahead."""

    def _predict(self, clouds: list[Points], known: Known) -> list[Prediction]:  # type: ignore[override]
        sure = {"closed": 0.01, "semi_open": 0.01, "open": 0.98}
        door = Door(2.0, 0.0, 90.0, 0.9, DoorState.OPEN, raw_probabilities=sure, leaf_seen=True)
        return [Prediction.from_doors([door], [], 100, 1.0) for _ in clouds]


def test_without_its_place_no_door_of_the_list_has_a_state_and_a_clock_that_goes_back_forgets_all() -> None:
    predictor = SeesOpenDoor(DoorState.OPEN)
    watch = DoorWatch(WatchSettings(), predictor)
    doors = LiveDoors([named("front", 2.0, 0.0), named("lab", -3.0, 0.0)], predictor)
    points = np.random.default_rng(0).uniform((1, -1, -1), (3, 1, 1), (500, 3)).astype(np.float32)
    cloud = PosedCloud(points, ReadOptions().pose())

    def follow(
        stamp_s: float, place: CameraPlace | MissingPlace, has_cloud: bool = True
    ) -> list[dict[str, Any]]:
        report = watch.report(lambda: cloud, round(stamp_s * 1e9), "camera")
        if not has_cloud:
            report = watch.report_silence(round(stamp_s * 1e9))
        tracked = doors.follow(report, points if has_cloud else None, place)
        return json.loads(doors_json(report, tracked))  # type: ignore[no-any-return]

    for tenth in range(12):
        front, lab = follow(10 + tenth / 10, AT_ORIGIN)
    assert (front["name"], front["state"], lab["seen"]) == ("front", "open", False)
    (unknown, *hidden) = follow(11.2, MissingPlace("no transform from camera to map"))
    assert unknown["name"] == "unknown door"
    assert [(door["name"], door["state"]) for door in hidden] == [("front", None), ("lab", None)]
    assert all("no transform" in door["reason"] for door in hidden)
    silent = follow(11.5, AT_ORIGIN, has_cloud=False)
    assert all(door["state"] is None and not door["seen"] for door in silent)
    report = watch.report_silence(round(3e9))
    assert [sighting.last_state for sighting in doors.follow(report, None, AT_ORIGIN).sightings] == [None] * 2

# SPDX-License-Identifier: Apache-2.0
"""Messages about doors; `doorstate_msgs` is not built here, so that classes are made from its definitions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("std_msgs")

from builtin_interfaces.msg import Duration
from doorstate_ros import messages
from geometry_msgs.msg import PoseWithCovariance
from std_msgs.msg import Header

from doorstate.doors.tracker import DoorTracker, TrackedFrame
from doorstate.inference.door import Door
from doorstate.inference.door_report import DoorReport
from doorstate.inference.prediction import Prediction
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings
from doorstate.io.options import ReadOptions
from doorstate.io.sensor_pose import PosedCloud
from doorstate.types import DoorState
from tests.cameras.scripted import FixedPredictor
from tests.doors.examples import AT_ORIGIN, named
from tests.ros2.doors import CONSTANTS, DoorMessage

WARNING = "module 'sre_"  # of the parser of lark-parser, which message types import
pytestmark = pytest.mark.filterwarnings(f"ignore:{WARNING}:DeprecationWarning")


def message(**values: Any) -> DoorMessage:
    return DoorMessage(**{"pose": PoseWithCovariance()} | values)


SURE = {"closed": 0.01, "semi_open": 0.01, "open": 0.98}
OPEN = Door(
    2.0,
    0.0,
    90.0,
    0.9,
    DoorState.OPEN,
    raw_probabilities=SURE,
    opening_angle_deg=90.0,
    hinge="left",
    passable_width_m=0.8,
    position_error_m=0.1,
    yaw_error_deg=2.0,
    leaf_seen=True,
    floor_z_m=-1.0,
)


def report_of(door: Door) -> DoorReport:
    class Sees(FixedPredictor):
        def _predict(self, clouds: Any, known: Any) -> list[Prediction]:
            return [Prediction.from_doors([door], [], 100, 1.0) for _ in clouds]

    points = np.random.default_rng(0).uniform((1, -1, -1), (3, 1, 1), (500, 3)).astype(np.float32)
    watch = DoorWatch(WatchSettings(), Sees(DoorState.OPEN))
    return watch.report(lambda: PosedCloud(points, ReadOptions().pose()), 10**9, "camera")


def tracked_by(report: DoorReport) -> TrackedFrame:
    tracker = DoorTracker([named("front", 2.0, 0.0), named("lab", -3.0, 0.0)])
    return tracker.update(report.prediction, AT_ORIGIN, 1.0)


def test_a_door_has_its_state_place_and_errors_and_others_of_the_list_a_reason() -> None:
    report = report_of(OPEN)
    front, lab = messages.door_messages(message, report, tracked_by(report))
    assert (front.id, front.seen, front.state, front.reason) == ("front", True, CONSTANTS["OPEN"], "")
    assert front.probabilities == [0.01, 0.01, 0.98]
    assert (front.pose.pose.position.x, front.pose.pose.position.z) == pytest.approx((2.0, -1.0))
    assert front.pose.covariance[0] == pytest.approx(0.01)
    assert front.pose.covariance[35] == pytest.approx(math.radians(2.0) ** 2)
    assert (front.passable_width_m, front.last_seen.sec) == (0.8, 1)
    assert (lab.id, lab.seen, lab.state) == ("lab", False, None)
    assert lab.reason
    assert math.isnan(lab.opening_angle_deg)


def test_a_door_without_a_list_has_no_name() -> None:
    (door,) = messages.door_messages(message, report_of(OPEN), None)
    assert (door.id, door.state, door.last_state) == (None, CONSTANTS["OPEN"], None)


def test_states_are_the_constants_of_the_definition() -> None:
    numbers = {name: messages._number(name.lower()) for name in CONSTANTS if name != "UNKNOWN"}
    assert numbers | {"UNKNOWN": 0} == CONSTANTS
    assert messages._number(None) == CONSTANTS["UNKNOWN"]


@pytest.mark.parametrize(("hinge", "from_m", "to_m"), [("left", -0.45, 0.35), ("right", 0.45, -0.35)])
def test_the_passable_width_is_drawn_beside_the_jamb_without_hinge(
    hinge: str, from_m: float, to_m: float
) -> None:
    report = report_of(replace(OPEN, hinge=hinge))  # type: ignore[arg-type]
    drawn = messages.markers(Header(frame_id="camera"), report, Duration(sec=1))
    (line,) = [marker for marker in drawn if marker.ns == "doors/passage"]
    # Left of the camera is y in the level frame, and x along the wall.
    assert [point.y for point in line.points] == pytest.approx([from_m, to_m])
    assert [point.x for point in line.points] == pytest.approx([2.0, 2.0])

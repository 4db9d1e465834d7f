# SPDX-License-Identifier: Apache-2.0
"""Doors over time: what is not seen has no state, changes are events, and a clock that goes back begins anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from doorstate.doors.camera_place import MissingPlace
from doorstate.doors.plane_pose import PlanePose
from doorstate.doors.sighting import UNKNOWN_DOOR, View, names_of_doors, why_hidden
from doorstate.doors.tracker import DoorEvent, DoorTracker, TrackedFrame
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.known import DoorHint
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import prediction_to_dict
from doorstate.inference.tilt import Tilt
from doorstate.types import DoorState
from tests.doors.examples import AT_ORIGIN, named, seen

LEFT, RIGHT = named("left", 3.0, 0.6), named("right", 3.0, -0.6)
BEHIND = named("behind", -3.0, 0.0)
DOORS = (LEFT, RIGHT, BEHIND)


def show(tracker: DoorTracker, stamp_s: float, doors: Sequence[Door] = (), **options: object) -> TrackedFrame:
    """One cloud; doors are given in the level sensor frame of a camera at the origin."""
    prediction = Prediction.from_doors(doors, [], 4096, 40.0)
    return tracker.update(prediction, AT_ORIGIN, stamp_s, frame=f"frame {stamp_s:g}", **options)  # type: ignore[arg-type]


def test_each_door_has_its_own_state_or_a_reason() -> None:
    frame = show(DoorTracker(DOORS), 1.0, [seen(3.0, -0.58, state="open"), seen(3.02, 0.6), seen(1.0, 0.3)])
    left, right, behind = frame.sightings
    assert frame.names == ("right", "left", None)
    assert (left.state, right.state, behind.state) == ("closed", "open", None)
    assert (left.code, behind.code, behind.is_seen) == (None, "out_of_view", False)
    assert (left.is_front, behind.is_front) == (True, False)
    assert left.to_dict()["probability"] == 0.98
    assert behind.to_dict() == {
        "id": "behind",
        "seen": False,
        "state": None,
        "reason": behind.reason(),
        "side": "back",
    }


def test_an_old_state_is_never_given_as_a_new_one() -> None:
    tracker = DoorTracker(DOORS)
    for tenth in range(12):
        show(tracker, tenth / 10, [seen(3.0, 0.6, state="open")])
    sighting = show(tracker, 1.2).sightings[0]
    assert (sighting.code, sighting.state, sighting.filtered) == ("not_found", None, None)
    assert (sighting.last_state, sighting.last_seen_s) == ("open", 1.1)
    record = sighting.to_dict()
    assert (record["state"], record["last_state"]) == (None, "open")
    assert "filtered_state" not in record
    abstained = show(
        tracker, 1.3, [seen(3.0, 0.6, state=None, abstention=Abstention("door_dark", {"share": 0.5}))]
    )
    assert abstained.sightings[0].is_seen
    assert (abstained.sightings[0].state, abstained.sightings[0].last_seen_s) == (None, 1.1)


def test_changes_are_events_of_several_clouds() -> None:
    tracker = DoorTracker([LEFT], lost_s=5.0)
    events: list[DoorEvent] = []
    for tenth in range(40):
        state = "closed" if tenth < 20 else "open"
        events += show(tracker, tenth / 10, [seen(3.0, 0.6, state=state)]).events
    (closed, opened) = events
    assert closed[:3] == ("left", "not_seen", "closed")
    assert opened[:3] == ("left", "closed", "open")
    assert 2.1 < opened.time_s < 3.0, "one cloud is no change"
    assert opened.certainty is not None
    assert 0.8 <= opened.certainty <= 1.0
    assert opened.frame == f"frame {opened.time_s:g}"
    assert tracker.last_seen == {"left": ("open", 3.9)}
    assert show(tracker, 8.0).events == ()
    assert show(tracker, 9.0).events == (DoorEvent("left", "open", "not_seen", 3.9),)
    assert show(tracker, 10.0).events == ()
    assert tracker.last_seen == {}


def test_a_clock_that_goes_back_begins_anew() -> None:
    tracker = DoorTracker([LEFT])
    for tenth in range(12):
        show(tracker, 100 + tenth / 10, [seen(3.0, 0.6)])
    frame = show(tracker, 7.0)
    assert frame.events == (DoorEvent("left", "closed", "not_seen", 101.1),)
    assert frame.sightings[0].last_state is None


def test_the_end_of_a_stream_leaves_no_state() -> None:
    tracker = DoorTracker([LEFT, RIGHT])
    for tenth in range(12):
        show(tracker, tenth / 10, [seen(3.0, 0.6)])
    assert tracker.end() == (DoorEvent("left", "closed", "not_seen", 1.1),)
    assert tracker.end() == ()


def test_no_pose_is_a_reason_of_every_door() -> None:
    prediction = Prediction.from_doors([seen(3.0, 0.6)], [], 4096, 40.0)
    frame = DoorTracker(DOORS).update(prediction, MissingPlace("no transform"), 1.0)
    assert {sighting.code for sighting in frame.sightings} == {"no_pose"}
    assert "no transform" in frame.sightings[0].reason()
    assert frame.names == (None,)


def test_other_reasons_for_doors_that_are_not_seen() -> None:
    upstairs = named("upstairs", 3.0, 0.6, frame="attic")
    far, along = named("far", 8.0, 0.0), named("along", 3.0, 0.0, yaw_deg=5.0)
    frame = show(DoorTracker([upstairs, far, along]), 1.0)
    assert [sighting.code for sighting in frame.sightings] == ["other_map", "too_far", "along_wall"]
    refused = Prediction.abstain(Abstention("low_coverage", {"share": 0.1, "min_share": 0.2}), 100)
    sighting = DoorTracker([LEFT]).update(refused, AT_ORIGIN, 1.0).sightings[0]
    assert sighting.code == "refused"
    assert refused.reason in sighting.reason()


def test_doors_that_cannot_be_told_apart_are_neither() -> None:
    prediction = Prediction.from_doors([seen(3.0, 0.5)], [], 4096, 40.0)
    lost = AT_ORIGIN._replace(position_error_m=1.0)
    frame = DoorTracker([LEFT, RIGHT]).update(prediction, lost, 1.0)
    assert frame.names == (None,)
    assert [(sighting.code, sighting.detail) for sighting in frame.sightings] == [
        ("not_told_apart", "right"),
        ("not_told_apart", "left"),
    ]


def test_kinds_without_a_state_have_none() -> None:
    door = named("drum", 3.0, 0.6, kind="revolving")
    sighting = show(DoorTracker([door]), 1.0, [seen(3.0, 0.6, state="open")]).sightings[0]
    assert (sighting.is_seen, sighting.state) == (True, None)


def test_doors_that_were_not_found_are_asked_for_at_their_places() -> None:
    hints: list[DoorHint] = []

    def ask(hint: DoorHint) -> Door | None:
        hints.append(hint)
        return seen(hint.x_m or 0.0, (hint.y_m or 0.0) + 0.05, state="semi_open")

    frame = show(DoorTracker(DOORS), 1.0, [seen(3.0, 0.6)], ask=ask)
    assert [(hint.x_m, hint.y_m, hint.yaw_deg) for hint in hints] == [(3.0, -0.6, 90.0)]
    left, right, _ = frame.sightings
    assert (left.asked, right.asked, right.state) == (False, True, "semi_open")
    assert frame.names == ("left",), "an asked door is none of the prediction's"


@pytest.mark.parametrize("y_m", [0.6, -2.0])
def test_the_answer_for_another_place_is_not_taken(y_m: float) -> None:
    frame = show(DoorTracker(DOORS), 1.0, [seen(3.0, 0.6)], ask=lambda hint: seen(3.0, y_m, state="open"))
    assert [sighting.state for sighting in frame.sightings] == ["closed", None, None]
    assert show(DoorTracker(DOORS), 1.0, ask=lambda hint: None).sightings[0].code == "not_found"


def test_records_of_doors_carry_their_names() -> None:
    prediction = Prediction.from_doors([seen(3.0, 0.6), seen(1.0, 0.0)], [], 4096, 40.0)
    record = names_of_doors(prediction_to_dict(prediction), ("left", None))
    assert [door["name"] for door in record["doors"]] == ["left", UNKNOWN_DOOR]
    assert names_of_doors({"state": None}, ()) == {"state": None}


def test_the_view_is_that_of_the_measured_points() -> None:
    bearing = np.radians(np.linspace(-20.0, 30.0, 5000))
    points = np.stack([3 * np.cos(bearing), 3 * np.sin(bearing), np.zeros(5000)], axis=-1).astype(np.float32)
    points[::7] = np.nan
    view = View.of(points.reshape(50, 100, 3))
    assert (view.right_deg, view.left_deg) == (pytest.approx(-20, abs=0.6), pytest.approx(30, abs=0.6))
    tilt = Tilt(0.0, 40.0, "floor")
    down = tilt.from_level(points).astype(np.float32)
    assert View.of(down, tilt).left_deg == pytest.approx(view.left_deg, abs=0.01)
    assert why_hidden((3.0, 0.0, 90.0), view) is None
    assert why_hidden((3.0, -2.0, 90.0), view) == ("out_of_view", "")
    assert why_hidden((0.1, 3.0, 90.0), View.of(points[:0])) == ("out_of_view", "")


def test_a_door_is_seen_while_the_robot_drives_past_it() -> None:
    """Side doors of a corridor, from front and back of the drive."""
    side = named("side", 5.0, 1.0, yaw_deg=180.0)  # in the left wall: seen by a camera that looks along +x
    tracker = DoorTracker([side])
    for x_m, heading_deg in ((2.5, 30.0), (4.0, 70.0)):
        camera = AT_ORIGIN._replace(pose=PlanePose(x_m, 0.0, heading_deg))
        local = camera.pose.inverse().after(side.place)
        prediction = Prediction.from_doors([seen(*local)], [], 1, 1.0)
        assert tracker.update(prediction, camera, x_m).sightings[0].state == DoorState.CLOSED


def test_without_a_cloud_no_door_is_seen_and_old_ones_are_lost_in_time() -> None:
    tracker = DoorTracker(DOORS, lost_s=2.0)
    for tenth in range(12):
        show(tracker, tenth / 10, [seen(3.0, 0.6, state="open")])
    missed = tracker.miss("no camera", 1.3)
    assert [sighting.code for sighting in missed.sightings] == ["refused"] * 3
    assert all("no camera" in sighting.reason() for sighting in missed.sightings)
    assert all(sighting.state is sighting.filtered is None for sighting in missed.sightings)
    assert (missed.names, missed.events) == ((), ())
    assert missed.sightings[0].last_state == "open"
    assert [event.to_state for event in tracker.miss("no camera", 3.2).events] == ["not_seen"]

# SPDX-License-Identifier: Apache-2.0
"""A door of a list at one moment: as it is seen now, or the reason why it is not, and when it was seen last."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from doorstate.clouds.measured import is_measured
from doorstate.errors import WriteParameter, python_parameter
from doorstate.inference.door import Door
from doorstate.inference.serialization import door_to_dict
from doorstate.inference.state_filter import FilteredState
from doorstate.inference.tilt import Tilt
from doorstate.types import DoorState, Points

NOT_SEEN = "not_seen"  # in place of a state
UNKNOWN_DOOR = "unknown door"  # in place of a name: it is not in the list

NotSeenCode = Literal[
    "no_pose",
    "other_map",
    "out_of_view",
    "too_far",
    "along_wall",  # at so flat an angle that no door is found
    "not_told_apart",
    "not_found",  # in view, and no door was found there
    "refused",  # the cloud as a whole
]
NOT_SEEN_SENTENCES: dict[NotSeenCode, str] = {
    "no_pose": "not seen: the pose of the camera is not known ({detail})",
    "other_map": "not seen: the camera is in another map ({detail})",
    "out_of_view": "not seen: out of view",
    "too_far": "not seen: {detail} m away",
    "along_wall": "not seen: its wall is seen along",
    "not_told_apart": "not told apart from {detail}",
    "not_found": "not seen: no door was found at its place, {detail} m away",
    "refused": "not seen: {detail}",
}
_MAX_BESIDE_DEG = 78.0  # of the normal of a wall
_SAMPLE_POINTS = 4096
_REACH_M = 5.0  # chosen: doors farther away are seldom found
_EDGE = 0.005  # of the points of a cloud: at the edges of the view, and astray


class View(NamedTuple):
    """Part of the plan that a camera sees, in the level sensor frame."""

    right_deg: float = -35.0
    left_deg: float = 35.0
    reach_m: float = _REACH_M

    @classmethod
    def of(cls, points: Points, tilt: Tilt | None = None) -> Self:
        """Return the view of the measured points (..., 3) of a cloud; of nothing without any.

        Args:
            points: points; level ones without a tilt.
            tilt: tilt that was found in them.
        """
        flat = points.reshape(-1, 3)
        sample = flat[:: max(1, len(flat) // _SAMPLE_POINTS) | 1]
        sample = sample[is_measured(sample)]
        sample = sample if tilt is None else tilt.to_level(sample)
        if len(sample) == 0:
            return cls(0.0, 0.0, 0.0)
        bearing_deg = np.degrees(np.arctan2(sample[:, 1], sample[:, 0]))
        right_deg, left_deg = np.quantile(bearing_deg, [_EDGE, 1 - _EDGE]).tolist()
        return cls(right_deg, left_deg)


USUAL_VIEW = View()


@dataclass(frozen=True)
class Sighting:
    """A door of the list after one cloud.

    Attributes:
        id: name of the door.
        door: the door as this cloud shows it; None where it was not seen.
        code: reason why it was not seen; None where it was.
        detail: value for the sentence of the reason.
        is_front: the camera is before the front of the wall; None where its pose is not known.
        filtered: state after all clouds so far; None where it was not seen.
        asked: its state was asked at its place, because no door was found in the cloud there.
        last_state: state of the last cloud that had one, however long ago; no answer of now.
        last_seen_s: stamp of that cloud.
    """

    id: str
    door: Door | None = None
    code: NotSeenCode | None = None
    detail: str = ""
    is_front: bool | None = None
    filtered: FilteredState | None = None
    asked: bool = False
    last_state: DoorState | None = None
    last_seen_s: float | None = None

    @property
    def is_seen(self) -> bool:
        """True if this cloud shows the door, with a state or without one."""
        return self.door is not None

    @property
    def state(self) -> DoorState | None:
        """State that this cloud shows; None if it shows none."""
        return None if self.door is None else self.door.state

    @property
    def label(self) -> str:
        """Name of the state, `abstained`, or `not_seen`."""
        return NOT_SEEN if self.door is None else self.door.label

    def reason(self, parameter: WriteParameter = python_parameter) -> str:
        """Return the sentence of why there is no state; empty with one."""
        if self.code is not None:
            return NOT_SEEN_SENTENCES[self.code].format(detail=self.detail)
        abstention = None if self.door is None else self.door.abstention
        return "" if abstention is None else abstention.describe(parameter)

    def to_dict(
        self, parameter: WriteParameter = python_parameter, *, has_time: bool = True
    ) -> dict[str, Any]:
        """Return the sighting as JSON values; those of the door are given only where it is seen.

        Args:
            parameter: writes a parameter that a reason suggests as the surface spells it.
            has_time: False leaves out what earlier clouds showed.
        """
        values: dict[str, Any] = {"id": self.id, "seen": self.is_seen, "state": None}
        if self.door is not None:
            values |= door_to_dict(self.door, parameter)
            values["probability"] = None if self.door.probability is None else round(self.door.probability, 4)
        if reason := self.reason(parameter):
            values["reason"] = reason
        if self.is_front is not None:
            values["side"] = "front" if self.is_front else "back"
        if self.asked:
            values["asked"] = True
        if has_time and self.filtered is not None and self.filtered.state is not None:
            values["filtered_state"] = str(self.filtered.state)
            values["filtered_since_s"] = round(self.filtered.since_s, 6)
        if has_time and self.last_seen_s is not None:
            values |= {"last_state": str(self.last_state), "last_seen_s": round(self.last_seen_s, 6)}
        return {name: value for name, value in values.items() if value is not None or name == "state"}


def why_hidden(place: tuple[float, float, float], view: View) -> tuple[NotSeenCode, str] | None:
    """Return why a door at a place of the level sensor frame is out of the view, or None if it is in it.

    Args:
        place: x, y and yaw.
        view: part of the plan that the camera sees.
    """
    x_m, y_m, yaw_deg = place
    distance_m = math.hypot(x_m, y_m)
    bearing_deg = math.degrees(math.atan2(y_m, x_m))
    if not view.right_deg <= bearing_deg <= view.left_deg:
        return "out_of_view", ""
    if distance_m > view.reach_m:
        return "too_far", f"{distance_m:.1f}"
    # The wall runs across the line of sight where both are at right angles.
    beside_deg = abs(math.remainder(yaw_deg - 90 - bearing_deg, 180.0))
    return ("along_wall", "") if beside_deg > _MAX_BESIDE_DEG else None


def names_of_doors(record: Mapping[str, Any], names: Sequence[str | None]) -> dict[str, Any]:
    """Return a record of a prediction with the name of each of its doors, as `prediction_values` lists them."""
    if not record.get("doors"):
        return dict(record)
    doors = [{"name": name or UNKNOWN_DOOR} | door for door, name in zip(record["doors"], names, strict=True)]
    return dict(record) | {"doors": doors}

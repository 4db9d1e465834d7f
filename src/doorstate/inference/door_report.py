# SPDX-License-Identifier: Apache-2.0
"""Report about a door after one message of a camera, for the topics and markers of a robot."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.door import Door
from doorstate.inference.door_lines import Line
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import door_to_dict, prediction_to_dict
from doorstate.inference.state_filter import FilteredState
from doorstate.io.rotations import Quaternion, heading_matrix
from doorstate.io.sensor_pose import SensorPose
from doorstate.rules.base import Detection

UNKNOWN = "unknown"


class DoorPose(NamedTuple):
    """Pose of a door in the frame of a message: the middle of its opening on the floor, and the doorway's axes."""

    position_m: NDArray[np.float64]  # (3,)
    quaternion: Quaternion  # x, y, z, w of the frame with x along the wall, y towards the camera, z up

    @classmethod
    def of(cls, door: Door, floor_z_m: float, to_message: Callable[[NDArray[Any]], NDArray[Any]]) -> Self:
        """Return the pose of a door.

        Args:
            door: door in the level sensor frame.
            floor_z_m: height of the floor, for a door without its own.
            to_message: turns points (..., 3) of the level sensor frame into the frame of the message.
        """
        from scipy.spatial.transform import Rotation  # takes a tenth of a second, and few predictions need it

        floor_z_m = floor_z_m if door.floor_z_m is None else door.floor_z_m
        middle = np.array([door.x_m, door.y_m, floor_z_m])
        position, *tips = to_message(
            middle + np.vstack([np.zeros(3), np.array(heading_matrix(door.yaw_deg)).T])
        )
        axes = np.stack(tips, axis=1) - position[:, None]
        x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
        return cls(position, (x, y, z, w))


@dataclass(frozen=True, eq=False)
class DoorReport:
    """State of a door at one moment, and all doors of the message."""

    stamp_ns: int
    frame_id: str  # of the message
    prediction: Prediction  # of this message alone
    filtered: FilteredState  # of all messages so far
    held_s: float | None  # for which filter and messages have agreed; None: this message differs
    is_open: bool  # open now, and for long enough
    centre_m: NDArray[np.float64]  # (3,) median of the measured points, in the frame of the message
    detections: tuple[Detection, ...] = ()  # of a rule, in the frame of the message
    lines: tuple[Line, ...] = ()  # of the doors, in the frame of the message
    poses: tuple[DoorPose, ...] = ()  # of the doors, in their order
    pose: SensorPose | None = None  # of the camera; None without a readable message

    @property
    def state(self) -> str:
        """Name of the filter's state, or `unknown`."""
        return str(self.filtered.state or UNKNOWN)

    @property
    def values(self) -> dict[str, str]:
        """All values by name, as text: of this message, without probabilities where it has none, and `filtered_*`."""
        record = prediction_to_dict(self.prediction)
        values = {"state": self.state, "raw_state": record.pop("state") or UNKNOWN, "reason": ""}
        record.pop("raw_probabilities", None)
        tilt, doors = record.pop("tilt", {}), record.pop("doors", [])
        values |= record.pop("probabilities", {}) | record
        values |= {f"found_{name}": value for name, value in tilt.items()}
        values["doors"] = len(doors)
        values |= {f"filtered_{name}": round(p, 6) for name, p in self.filtered.probabilities.items()}
        values["held_s"] = 0.0 if self.held_s is None else round(self.held_s, 3)
        values |= {} if self.pose is None else self.pose.to_dict()
        return {name: str(value) for name, value in values.items()}

    @property
    def doors(self) -> str:
        """JSON list of the doors, as `doorstate predict --json` prints it, in the level sensor frame."""
        return json.dumps([door_to_dict(door) for door in self.prediction.doors])

    @property
    def text(self) -> str:
        """Label to draw beside the door: the state, and the reason under it if this message has none."""
        state = self.filtered.state
        probability = "" if state is None else f" {self.filtered.probabilities[state]:.0%}"
        return f"{self.state}{probability}\n{self.prediction.reason}".strip()

# SPDX-License-Identifier: Apache-2.0
"""Report about a door after one message of a camera, for the topics and markers of a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import prediction_to_dict
from doorstate.inference.state_filter import FilteredState
from doorstate.io.sensor_pose import SensorPose
from doorstate.rules.base import Detection

UNKNOWN = "unknown"


@dataclass(frozen=True, eq=False)
class DoorReport:
    """State of a door at one moment."""

    stamp_ns: int
    frame_id: str  # of the message
    prediction: Prediction  # of this message alone
    filtered: FilteredState  # of all messages so far
    held_s: float | None  # for which filter and messages have agreed; None: this message differs
    is_open: bool  # open now, and for long enough
    centre_m: NDArray[np.float64]  # (3,) median of the measured points, in the frame of the message
    detections: tuple[Detection, ...] = ()  # of a rule, in the frame of the message
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
        values |= record.pop("probabilities", {}) | record
        values |= {f"filtered_{name}": round(p, 6) for name, p in self.filtered.probabilities.items()}
        values["held_s"] = 0.0 if self.held_s is None else round(self.held_s, 3)
        values |= {} if self.pose is None else self.pose.to_dict()
        return {name: str(value) for name, value in values.items()}

    @property
    def text(self) -> str:
        """Label to draw beside the door: the state, and the reason under it if this message has none."""
        state = self.filtered.state
        probability = "" if state is None else f" {self.filtered.probabilities[state]:.0%}"
        return f"{self.state}{probability}\n{self.prediction.reason}".strip()

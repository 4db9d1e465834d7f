# SPDX-License-Identifier: Apache-2.0
"""Prediction for one cloud: the state of the door, its probabilities, and where the door is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from doorstate.inference.abstention import Abstention
from doorstate.rules.base import Detection
from doorstate.types import ABSTAINED, STATES, DoorState


class DoorFrame(NamedTuple):
    """Pose of the door frame in the sensor frame: the middle of the opening and the direction of the wall.

    The yaw is that of the wall towards its left; a wall straight ahead has 90 degrees.
    """

    x_m: float
    y_m: float
    yaw_deg: float


@dataclass(frozen=True)
class Prediction:
    """State of the door in one cloud, or the reason why there is none.

    Geometry is None where the method does not estimate it.
    """

    state: DoorState | None
    probabilities: dict[str, float]  # by state; all zero without a state from a rule or from the gate
    num_points: int  # points that the method evaluated
    milliseconds: float  # from the raw cloud to this prediction
    abstention: Abstention | None = None  # set exactly where `state` is None
    opening_angle_deg: float | None = None
    door_probability: float | None = None  # that the cloud shows a door at all
    hinge: Literal["left", "right"] | None = None  # as seen from the camera
    frame: DoorFrame | None = None
    opening_width_m: float | None = None
    passable_width_m: float | None = None  # between leaf and jamb
    detections: tuple[Detection, ...] = field(default=(), compare=False, repr=False)  # of a rule

    @property
    def label(self) -> str:
        """Name of the state, or `abstained`."""
        return str(self.state or ABSTAINED)

    @property
    def reason(self) -> str:
        """Sentence of the abstention; empty with a state."""
        return "" if self.abstention is None else str(self.abstention)

    @classmethod
    def abstain(cls, abstention: Abstention, num_points: int = 0, milliseconds: float = 0.0) -> Prediction:
        """Return a prediction without a state."""
        return cls(None, dict.fromkeys(STATES, 0.0), num_points, milliseconds, abstention)

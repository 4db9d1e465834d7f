# SPDX-License-Identifier: Apache-2.0
"""Prediction for one cloud: the state of the door, its probabilities, and where the door is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.abstention import Abstention
from doorstate.inference.seen_through import Opening
from doorstate.inference.validity import are_probabilities
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

    Numbers that the method does not estimate are None. Without a state there are no probabilities and no geometry.
    """

    state: DoorState | None
    num_points: int  # points that the method evaluated
    milliseconds: float  # from the raw cloud to this prediction
    abstention: Abstention | None = None  # set exactly where `state` is None
    raw_probabilities: Mapping[str, float] | None = (
        None  # of the network by state, even where its state is refused
    )
    door_probability: float | None = (
        None  # that the cloud shows a door at all, even where the state is refused
    )
    opening_angle_deg: float | None = None
    hinge: Literal["left", "right"] | None = None  # as seen from the camera
    hinge_probability: float | None = None  # that the hinge is on this side
    frame: DoorFrame | None = None
    opening_width_m: float | None = None
    passable_width_m: float | None = None  # between leaf and jamb
    detections: tuple[Detection, ...] = field(default=(), compare=False, repr=False)  # of a rule

    @property
    def label(self) -> str:
        """Name of the state, or `abstained`."""
        return str(self.state or ABSTAINED)

    @property
    def probabilities(self) -> dict[str, float] | None:
        """Probabilities by state; None without a state, and for a rule, which does not estimate any."""
        return None if self.state is None or self.raw_probabilities is None else dict(self.raw_probabilities)

    @property
    def probability(self) -> float | None:
        """Probability of the state; None where there are no `probabilities`."""
        return None if self.state is None or self.probabilities is None else self.probabilities[self.state]

    @property
    def opening(self) -> Opening | None:
        """Ends of the door's opening in plan view; None where the method does not find any."""
        if self.frame is not None and self.opening_width_m is not None:
            yaw = math.radians(self.frame.yaw_deg)
            x_m, y_m = (self.opening_width_m / 2 * part for part in (math.cos(yaw), math.sin(yaw)))
            frame = self.frame
            return Opening((frame.x_m + x_m, frame.y_m + y_m), (frame.x_m - x_m, frame.y_m - y_m))
        outline = self._outline("opening")
        return None if outline is None else Opening.from_outline(outline)

    @property
    def possible_openings(self) -> tuple[Opening, ...]:
        """The opening, or with a wall and a leaf alone both sides of the hinge, each as wide as the leaf."""
        if self.opening is not None:
            return (self.opening,)
        wall, leaf = self._outline("wall"), self._outline("leaf")
        return () if wall is None or leaf is None else Opening.beside_hinge(wall, leaf)

    def _outline(self, name: str) -> NDArray[np.float64] | None:
        return next((shape.points_m for shape in self.detections if shape.name == name), None)

    @property
    def is_evidence(self) -> bool:
        """True with a state whose probabilities, if any, are valid: programs may make predictions of their own."""
        if self.state is None:
            return False
        given = self.raw_probabilities
        return given is None or (given.keys() == set(STATES) and are_probabilities(list(given.values())))

    @property
    def reason(self) -> str:
        """Sentence of the abstention; empty with a state."""
        return "" if self.abstention is None else str(self.abstention)

    def refuse(self, abstention: Abstention) -> Prediction:
        """Return the prediction without its state and geometry."""
        return replace(
            self,
            state=None,
            abstention=abstention,
            opening_angle_deg=None,
            hinge=None,
            hinge_probability=None,
            frame=None,
            opening_width_m=None,
            passable_width_m=None,
        )

    @classmethod
    def abstain(cls, abstention: Abstention, num_points: int = 0, milliseconds: float = 0.0) -> Prediction:
        """Return a prediction without a state, of a cloud that no method has evaluated."""
        return cls(None, num_points, milliseconds, abstention)

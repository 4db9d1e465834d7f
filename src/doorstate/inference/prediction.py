# SPDX-License-Identifier: Apache-2.0
"""Prediction for one cloud: the doors in it, and the state of the one most in front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.abstention import Abstention
from doorstate.inference.answer import StateAnswer
from doorstate.inference.door import Door, DoorFrame
from doorstate.inference.seen_through import Opening
from doorstate.inference.tilt import Tilt
from doorstate.inference.validity import are_probabilities
from doorstate.rules.base import Detection
from doorstate.types import STATES, DoorState, Hinge


@dataclass(frozen=True)
class Prediction(StateAnswer):
    """State of the door in one cloud, or the reason why there is none.

    Numbers that the method does not estimate are None. Without a state there are no probabilities and no geometry.
    Where the method finds several doors, the fields of a single door are those of the one most in front
    (`Door.remoteness_m`), or of the one that was asked for.
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
    hinge: Hinge | None = None  # as seen from the camera
    hinge_probability: float | None = None  # that the hinge is on this side
    frame: DoorFrame | None = None
    opening_width_m: float | None = None
    passable_width_m: float | None = None  # between leaf and jamb
    detections: tuple[Detection, ...] = field(default=(), compare=False, repr=False)  # of a rule
    doors: tuple[Door, ...] = ()  # in the level sensor frame, the one of the fields above first
    refused: tuple[Door, ...] = field(default=(), compare=False, repr=False)  # candidates that are no doors
    tilt: Tilt | None = None  # of a camera whose cloud was turned level; None: the cloud was taken as it is

    @property
    def opening(self) -> Opening | None:
        """Ends of the door's opening in plan view; None where the method does not find any."""
        if self.frame is not None and self.opening_width_m is not None:
            return Opening.in_frame(*self.frame, self.opening_width_m)
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
    def leaf_seen(self) -> bool | None:
        """False if no leaf was seen at an open door, so that glass cannot be excluded; None if not checked."""
        return self.doors[0].leaf_seen if self.doors else None

    def confirms(self, state: DoorState, *, require_leaf: bool = True) -> bool:
        """Return True for this state; an open door without a visible leaf may be glass, and confirms nothing.

        Args:
            state: state to confirm.
            require_leaf: False takes an open door for open although no leaf was seen.
        """
        is_glass_possible = state is DoorState.OPEN and self.leaf_seen is False
        return self.state is state and not (require_leaf and is_glass_possible)

    @property
    def is_evidence(self) -> bool:
        """True with a state whose probabilities, if any, are valid: programs may make predictions of their own."""
        if self.state is None:
            return False
        given = self.raw_probabilities
        return given is None or (given.keys() == set(STATES) and are_probabilities(list(given.values())))

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
            doors=(),
        )

    @classmethod
    def from_doors(
        cls,
        doors: Sequence[Door],
        refused: Sequence[Door],
        num_points: int,
        milliseconds: float,
        tilt: Tilt | None = None,
    ) -> Prediction:
        """Return the prediction of a cloud with doors; without any, the reason is that of the likeliest candidate.

        Args:
            doors: doors, the one to answer for first.
            refused: candidates that are no doors.
            num_points: points that the method evaluated.
            milliseconds: from the raw cloud to the doors.
            tilt: tilt that was found in the cloud.
        """
        if doors:
            single = cls._of_door(doors[0], num_points, milliseconds)
        else:
            likeliest = max(refused, key=lambda door: door.door_probability or 0.0, default=None)
            abstention = None if likeliest is None else likeliest.abstention
            single = cls.abstain(abstention or Abstention("no_doorway"), num_points, milliseconds)
            single = replace(
                single, door_probability=None if likeliest is None else likeliest.door_probability
            )
        return replace(single, doors=tuple(doors), refused=tuple(refused), tilt=tilt)

    @classmethod
    def _of_door(cls, door: Door, num_points: int, milliseconds: float) -> Prediction:
        has_state = door.state is not None
        return cls(
            door.state,
            num_points,
            milliseconds,
            door.abstention,
            raw_probabilities=door.raw_probabilities,
            door_probability=door.door_probability,
            opening_angle_deg=door.opening_angle_deg,
            hinge=door.hinge,
            hinge_probability=door.hinge_probability,
            frame=door.frame if has_state else None,
            opening_width_m=door.width_m if has_state else None,
            passable_width_m=door.passable_width_m,
        )

    @classmethod
    def abstain(cls, abstention: Abstention, num_points: int = 0, milliseconds: float = 0.0) -> Prediction:
        """Return a prediction without a state, of a cloud that no method has evaluated."""
        return cls(None, num_points, milliseconds, abstention)

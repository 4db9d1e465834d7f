# SPDX-License-Identifier: Apache-2.0
"""Shared vocabulary (docs/concepts.md): door states, parts of a scene, units, array types.

Frame of every cloud: sensor frame, gravity-aligned, x forward, y left, z up (ROS REP 103), origin at the camera,
metres.
"""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]  # (N, 3) metres
DepthImage = NDArray[np.float32]  # (H, W) z-depth in metres, NaN where nothing was measured
Indices = NDArray[np.int64]

Hinge = Literal["left", "right"]  # side of the hinge as seen from the camera
Swing = Literal["away", "towards"]  # direction in which a leaf opens, as seen from the camera

MAX_COORDINATE: Final = 1e6  # of a point, in any unit; some drivers write FLT_MAX where nothing was measured


class DoorState(StrEnum):
    """State of a door; prints, compares and serialises as its name. Spellings such as `Semi-Open` are taken too."""

    CLOSED = "closed"
    SEMI_OPEN = "semi_open"
    OPEN = "open"

    @property
    def class_index(self) -> int:
        """Class of every network: 0 closed, 1 semi_open, 2 open."""
        return STATES.index(self.value)

    @classmethod
    def from_index(cls, index: int) -> DoorState:
        """Return the state of a class.

        Raises:
            ValueError: no such class.
        """
        if not 0 <= index < len(STATES):
            raise ValueError(f"no class {index}: there are {len(STATES)}")
        return cls(STATES[index])

    @classmethod
    def _missing_(cls, value: object) -> Self | None:
        name = value.strip().lower().replace("-", "_").replace(" ", "_") if isinstance(value, str) else None
        return next((state for state in cls if state.value == name), None)


UNKNOWN_STATE: Final = "unknown"  # label of a door whose state is not asked, such as a revolving door
LabelledState = DoorState | Literal["unknown"]
STATES: tuple[str, ...] = tuple(state.value for state in DoorState)
NO_DOOR: Final = "no_door"  # label of a scene without a door; not a class of the networks
LABELS: tuple[str, ...] = (*STATES, NO_DOOR, UNKNOWN_STATE)
"""Labels of samples; a label's position is its number in data sets. States come first: they are the classes."""
DOOR, PARTS = "door", "parts"  # names of heads that several packages use
DECISION_THRESHOLD = 0.5  # a probability of at least this is a yes
ABSTAINED = "abstained"  # label of a prediction without a state
PREDICTED_LABELS: tuple[str, ...] = (*STATES, ABSTAINED)
UNITS_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "km": 1000.0}  # metres per unit, by name


class Part(IntEnum):
    """Part of the scene that a simulated point lies on."""

    WALL = 0
    FRAME = 1
    LEAF = 2
    FLOOR = 3
    CEILING = 4
    OTHER = 5
    NONE = 255  # a pixel without a measurement

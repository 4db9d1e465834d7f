# SPDX-License-Identifier: Apache-2.0
"""Shared vocabulary (docs/concepts.md): door states, parts of a scene, units, array types.

Frame of every cloud: sensor frame, gravity-aligned, x forward, y left, z up (ROS REP 103), origin at the camera,
metres.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]  # (N, 3) metres
DepthImage = NDArray[np.float32]  # (H, W) z-depth in metres, NaN where nothing was measured
Indices = NDArray[np.int64]


class DoorState(IntEnum):
    """State of a door; the value is the class label of every network."""

    CLOSED = 0
    SEMI_OPEN = 1
    OPEN = 2

    @property
    def label(self) -> str:
        """Name in files: `closed`, `semi_open` or `open`."""
        return self.name.lower()


STATES: tuple[str, ...] = tuple(state.label for state in DoorState)
NO_DOOR: Final = "no_door"  # label of a scene without a door; not a class of the networks
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

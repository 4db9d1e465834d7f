# SPDX-License-Identifier: Apache-2.0
"""The words of the library (docs/concepts.md): states, parts, array aliases.

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
    """What a door is; the value is the class label of every network."""

    CLOSED = 0
    SEMI_OPEN = 1
    OPEN = 2

    @property
    def label(self) -> str:
        """Name used in files and on the command line: `closed`, `semi_open` or `open`."""
        return self.name.lower()


STATES: tuple[str, ...] = tuple(state.label for state in DoorState)
NO_DOOR: Final = "no_door"  # the label of a scene without one; no class of the networks
DOOR, PARTS = "door", "parts"  # answers besides the state that several rooms name
DECISION_THRESHOLD = 0.5  # from here on a probability of yes is a yes
ABSTAINED = "abstained"  # of a method that says so rather than guess
PREDICTED_LABELS: tuple[str, ...] = (*STATES, ABSTAINED)


class Part(IntEnum):
    """What a simulated point belongs to."""

    WALL = 0
    FRAME = 1
    LEAF = 2
    FLOOR = 3
    CEILING = 4
    OTHER = 5
    NONE = 255  # a pixel that measured nothing

# SPDX-License-Identifier: Apache-2.0
"""Tilt of a camera that was found in its cloud, and the way from the level frame back to the cloud's own."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.leveling import Leveling
from doorstate.io.rotations import rotate, tilt_matrix


class Tilt(NamedTuple):
    """Tilt of a camera, clockwise from behind and down, with its source and standard error."""

    roll_deg: float
    pitch_deg: float
    source: str  # floor, walls or doorways
    error_deg: float | None = None

    @classmethod
    def of(cls, leveling: Leveling) -> Self:
        """Return the tilt of a cloud that was turned level."""
        return cls(leveling.roll_deg, leveling.pitch_deg, str(leveling.source), leveling.error_deg)

    def to_level(self, points: NDArray[Any]) -> NDArray[Any]:
        """Return points (..., 3) of the cloud's frame in the level sensor frame."""
        return rotate(points, np.array(tilt_matrix(self.roll_deg, self.pitch_deg)))

    def from_level(self, points: NDArray[Any]) -> NDArray[Any]:
        """Return points (..., 3) of the level sensor frame in the cloud's frame."""
        return rotate(points, np.array(tilt_matrix(self.roll_deg, self.pitch_deg)).T)

    def to_dict(self) -> dict[str, Any]:
        """Return the tilt as JSON values; the error is left out where it is not known."""
        values: dict[str, Any] = {
            "roll_deg": round(self.roll_deg, 2) + 0.0,  # no -0.0
            "pitch_deg": round(self.pitch_deg, 2) + 0.0,
            "tilt_from": self.source,
        }
        return values if self.error_deg is None else values | {"error_deg": round(self.error_deg, 2)}

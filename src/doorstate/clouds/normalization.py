# SPDX-License-Identifier: Apache-2.0
"""Prepared clouds in the units and axes of the networks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np

from doorstate.types import Points

Input = Literal["whole", "doorway"]
"""Cloud that a network gets: the whole view in the sensor frame, or a crop in the frame of its doorway."""
SCALE_M = (
    3.0  # of whole clouds, half the depth of a typical frame: networks were designed for about unit radius
)
_DOORWAY_SCALE_M = 1.5  # half the width of a crop
_DOORWAY_CENTRE_M = (0.0, 0.0, 1.05)  # half the height of a door


class Placement(NamedTuple):
    """Centres and scale of normalised clouds: a coordinate times the scale, plus the centre, is in metres."""

    centres: Points  # (..., 3) metres
    scale_m: float


@dataclass(frozen=True)
class Normalization:
    """Centre, scale and axes of the clouds of one input. No cloud is scaled by its own size, which is a cue."""

    scale_m: float
    centre_m: tuple[float, float, float] | None  # None: the centroid of each cloud
    across: Literal[0, 1]  # axis across the view, which a mirrored cloud is reversed along

    def __call__(self, points: Points) -> Points:
        """Return clouds (..., N, 3) in metres as the networks take them: the same shape, float32, without unit."""
        normalized: Points = (points - self.centres(points)[..., None, :]) / np.float32(self.scale_m)
        return normalized

    def centres(self, points: Points) -> Points:
        """Return the centres (..., 3) of clouds (..., N, 3), in metres."""
        if self.centre_m is None:
            return centroids(points)
        centre = np.array(self.centre_m, dtype=np.float32)
        return np.broadcast_to(centre, (*points.shape[:-2], 3))

    def placement(self, points: Points) -> Placement:
        """Return the centres and the scale of clouds (..., N, 3)."""
        return Placement(self.centres(points), self.scale_m)


NORMALIZATIONS: Final[dict[Input, Normalization]] = {
    "whole": Normalization(SCALE_M, centre_m=None, across=1),
    "doorway": Normalization(_DOORWAY_SCALE_M, _DOORWAY_CENTRE_M, across=0),
}


def normalize(points: Points) -> Points:
    """Centre whole clouds on their centroid and divide them by 3 m.

    Args:
        points: (..., N, 3) metres.

    Returns:
        The same shape, float32, without unit.
    """
    return NORMALIZATIONS["whole"](points)


def centroids(points: Points) -> Points:
    """Return the centroids (..., 3) of clouds (..., N, 3), in metres."""
    mean: Points = points.mean(axis=-2, dtype=np.float64).astype(np.float32)
    return mean

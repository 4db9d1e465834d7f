# SPDX-License-Identifier: Apache-2.0
"""Measured points of a level cloud, and what the checks of all its doorways share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import lowest_z_m
from doorstate.doorways.elevation import SightLines
from doorstate.doorways.reach import Reach

_RANGE_QUANTILES = (0.002, 0.995)  # without flying pixels
_RANGE_POINTS = 4096  # at least, evenly picked


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """Points (N, 3) of a level cloud, sensor frame; everything else is computed when it is first needed."""

    points: NDArray[np.float32]

    @cached_property
    def lines(self) -> SightLines:
        """Sight lines to the points."""
        return SightLines.to(self.points)

    @cached_property
    def reach(self) -> Reach:
        """Reach of the sight lines."""
        return Reach.of(self.lines.ends_m)

    @cached_property
    def lowest_z_m(self) -> float:
        """Height of the lowest points."""
        return lowest_z_m(self.points)

    @cached_property
    def range_limits_m(self) -> tuple[float, float]:
        """Least and largest range, without the outermost points."""
        some = self.points[:: max(1, len(self.points) // _RANGE_POINTS)]
        nearest_m, farthest_m = np.quantile(np.linalg.norm(some, axis=1), _RANGE_QUANTILES)
        return float(nearest_m), float(farthest_m)

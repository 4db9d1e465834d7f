# SPDX-License-Identifier: Apache-2.0
"""Where the robot stands: the half-ring of poses in front of the door."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

HEADING_JITTER_DEG = 20.0  # both jambs in view in 96 % of the frames (SIMULATION section 1.4)
_INNER_CELLS, _OUTER_CELLS = 15, 35  # 1.5 and 3.5 m
_WALL_CELLS = 6  # 0.6 m off the wall


class Position(NamedTuple):
    """A lattice point in front of the door, in cells of 0.1 m; the door frame's origin is (0, 0)."""

    column: int
    row: int

    @property
    def x_m(self) -> float:
        return self.column / 10

    @property
    def y_m(self) -> float:
        return self.row / 10


def half_ring() -> list[Position]:
    """The 1353 positions of preset `ogurob`, by row then column.

    Integers i, j with 225 <= i^2 + j^2 <= 1225 and j >= 6, without the off-axis points at exactly 3.5 m. That is what a
    grid accumulated in float32 keeps, and it gives the paper's count exactly (a hypothesis: SIMULATION section 1.4).
    """
    positions = []
    for j in range(_WALL_CELLS, _OUTER_CELLS + 1):
        for i in range(-_OUTER_CELLS, _OUTER_CELLS + 1):
            square = i * i + j * j
            on_far_edge = square == _OUTER_CELLS**2 and i != 0
            if _INNER_CELLS**2 <= square <= _OUTER_CELLS**2 and not on_far_edge:
                positions.append(Position(i, j))
    return positions


def reduced_ring(count: int) -> list[int]:
    """Indices into `half_ring()` of `count` positions, spread over bearing and distance.

    Every k-th position of the ring read sector by sector (30 degrees), near to far within each.

    Raises:
        ValueError: more positions than there are, or none.
    """
    positions = half_ring()
    if not 1 <= count <= len(positions):
        raise ValueError(f"there are {len(positions)} positions, not {count}")
    order = sorted(
        range(len(positions)),
        key=lambda k: (_sector(positions[k]), math.hypot(*positions[k]), positions[k].column),
    )
    picks = np.linspace(0, len(order) - 1, count).round().astype(int)
    return sorted(order[pick] for pick in picks)


def _sector(position: Position) -> int:
    return int(math.degrees(math.atan2(position.row, position.column)) // 30)


def draw_heading_rad(position: Position, seed: int, index: int) -> float:
    """Yaw that looks at the door's middle, turned by U(-20, 20) degrees; the same for the three states of a pose."""
    jitter_deg = np.random.default_rng([seed, index]).uniform(-HEADING_JITTER_DEG, HEADING_JITTER_DEG)
    return math.atan2(-position.row, -position.column) + math.radians(jitter_deg)

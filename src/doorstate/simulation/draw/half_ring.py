# SPDX-License-Identifier: Apache-2.0
"""The paper's half-ring of 1353 robot poses in front of the door."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from doorstate.errors import ConfigError

HEADING_JITTER_DEG = 20.0  # both jambs in view in 96 % of the frames (docs/data-card.md)
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
    """Return the 1353 positions of the paper, by row, then column.

    Integers i, j with 225 <= i^2 + j^2 <= 1225 and j >= 6, without the off-axis points at exactly 3.5 m. A grid
    accumulated in float32 leaves those out too, and the count is then exactly the paper's. The lattice is inferred from
    that count (docs/data-card.md).
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
    """Return indices into `half_ring()` of `count` positions, spread over bearing and distance.

    Every k-th position of the ring sorted by sector (30 degrees), near to far within each.

    Raises:
        ConfigError: more positions than there are, or none.
    """
    positions = half_ring()
    if not 1 <= count <= len(positions):
        raise ConfigError(
            f"there are {len(positions)} positions, not {count}",
            field="poses",
            expected=f"1 to {len(positions)}",
        )
    order = sorted(
        range(len(positions)),
        key=lambda k: (_sector(positions[k]), math.hypot(*positions[k]), positions[k].column),
    )
    picks = np.linspace(0, len(order) - 1, count).round().astype(int)
    return sorted(order[pick] for pick in picks)


def _sector(position: Position) -> int:
    return int(math.degrees(math.atan2(position.row, position.column)) // 30)


def draw_heading_offset_deg(seed: int, index: int) -> float:
    """Draw the angle, U(-20, 20) degrees, from the bearing to the door's middle; one for all states of a pose."""
    return float(np.random.default_rng([seed, index]).uniform(-HEADING_JITTER_DEG, HEADING_JITTER_DEG))

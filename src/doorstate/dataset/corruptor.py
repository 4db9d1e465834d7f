# SPDX-License-Identifier: Apache-2.0
"""Corrupted crops for training: losses, and things of a crop without a door before or beside another's doorway.

The label of a mixed crop stays true: nothing is put into the opening or the sweep of a leaf, and all things are on one
side of the opening's middle, mirrored where most of them stood on the other. Points behind a thing stay, as if seen
from elsewhere.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.corruption import (
    Corruption,
    CorruptionDraw,
    Mask,
    draw_corruption,
    first_kept,
    kept_points,
)
from doorstate.errors import ConfigError
from doorstate.types import Indices, Part, Points

Parts = NDArray[np.uint8]
_Array = TypeVar("_Array", bound=NDArray[Any])

CLEARANCE_M = 0.1  # between things and wall, opening or sweep
MOST_PASTED = 0.25  # of the points of a mixed cloud
_FEWEST_POINTS = 32  # of the things of a crop


class Openings(NamedTuple):
    """Openings of M crops in units of the clouds: width 0 without a door, NaN where unknown."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    width: NDArray[np.float32]

    def at(self, rows: Indices) -> Openings:
        """Return the openings of some crops by row number."""
        return Openings(*(values[rows] for values in self))


class Corruptor:
    """Corruption of the crops of a data set, one batch after another."""

    def __init__(
        self,
        corruption: Corruption,
        points: Points,
        parts: Parts | None,
        openings: Openings,
        has_door: Mask,
        scale_m: float,
    ) -> None:
        """Find the crops to mix others with.

        Args:
            corruption: ranges of the losses.
            points: (M, S, 3) crops in their frames, in farthest-point order; S may exceed the points of a batch, and
                points that were lost are then replaced by later ones.
            parts: (M, S) part of each point; needed to mix crops.
            openings: of the M crops.
            has_door: (M,) True for crops that show a door.
            scale_m: metres per unit.

        Raises:
            ConfigError: crops are to be mixed, but none without a door shows things.
        """
        self._corruption, self._points, self._parts = corruption, points, parts
        self._openings, self._scale_m = openings, scale_m
        self._donors = None
        if corruption.mix and parts is not None:
            self._donors = _find_donors(points, parts, has_door, scale_m)
        if corruption.mix and (self._donors is None or len(self._donors.rows) == 0):
            raise ConfigError(
                "no sample without a door shows things to mix", field="corruption", hint="set mix to 0"
            )

    def draw(self, rng: np.random.Generator, clouds: int) -> CorruptionDraw:
        """Draw the losses of a batch."""
        return draw_corruption(self._corruption, rng, clouds, self._scale_m)

    def __call__(self, rows: Indices, draw: CorruptionDraw, count: int) -> tuple[Points, Parts | None]:
        """Return corrupted crops (B, count, 3) and the part (B, count) of each point.

        Args:
            rows: (B,) row numbers.
            draw: losses of these crops.
            count: points of a corrupted crop.
        """
        points, parts = self._points[rows], None if self._parts is None else self._parts[rows]
        kept = kept_points(points, draw)
        mixed = np.flatnonzero(~np.isnan(draw.donors))
        if self._donors is not None and len(mixed):
            chosen = (draw.donors[mixed] * len(self._donors.rows)).astype(np.int64) % len(self._donors.rows)
            donors, sides = self._donors.rows[chosen], draw.sides[mixed]
            given, things = np.zeros_like(points), np.zeros_like(kept)
            given[mixed] = self._points[donors]
            given[mixed, :, 0] *= (sides * self._donors.sides[chosen])[:, None]
            things[mixed] = self._donors.things[chosen] & (donors != rows[mixed])[:, None]
            things[mixed] &= beside_opening(
                given[mixed], self._openings.at(rows[mixed]), sides, self._scale_m
            )
            things &= things.cumsum(axis=1) <= MOST_PASTED * count
            # Point k of either crop is about as far from those before it, so that both orders run side by side.
            points, kept = _in_turn(points, given), _in_turn(kept, things)
            if parts is not None:
                parts = _in_turn(parts, np.full_like(parts, Part.OTHER))
        taken = first_kept(kept, count)
        points = np.take_along_axis(points, taken[..., None], axis=1)
        return points, None if parts is None else np.take_along_axis(parts, taken, axis=1)


class _Donors(NamedTuple):
    """Crops without a door by row number, the points of things before the wall, and the side of most of these."""

    rows: Indices  # (D,)
    things: Mask  # (D, S)
    sides: NDArray[np.float32]  # (D,) 1 or -1


def _find_donors(points: Points, parts: Parts, has_door: Mask, scale_m: float) -> _Donors:
    things = (parts == Part.OTHER) & (points[..., 1] >= np.float32(CLEARANCE_M / scale_m))
    rows = np.flatnonzero(~has_door & (things.sum(axis=1) >= _FEWEST_POINTS))
    along = (points[rows, :, 0] * things[rows]).sum(axis=1)
    return _Donors(rows, things[rows], np.where(along < 0, np.float32(-1), np.float32(1)))


def beside_opening(points: Points, openings: Openings, sides: NDArray[np.float32], scale_m: float) -> Mask:
    """Return the mask (B, S) of the points that may stand before or beside an opening.

    Args:
        points: (B, S, 3) in the frame of the doorway: x along the wall, y towards the camera.
        openings: of the B crops.
        sides: (B,) 1 or -1, the side of the opening's middle.
        scale_m: metres per unit.
    """
    clearance = np.float32(CLEARANCE_M / scale_m)
    x, y, width = (values[:, None] for values in openings)
    along, ahead = sides[:, None] * (points[..., 0] - x), points[..., 1] - y
    beside = (along >= width / 2 + clearance) & (ahead >= clearance)
    allowed: Mask = beside | ((along >= 0) & (ahead >= width + clearance))
    return allowed


def _in_turn(first: _Array, second: _Array) -> _Array:
    """Return rows (B, 2 S, ...) that take from two arrays (B, S, ...) in turn."""
    return np.stack([first, second], axis=2).reshape(len(first), -1, *first.shape[2:])  # type: ignore[return-value]

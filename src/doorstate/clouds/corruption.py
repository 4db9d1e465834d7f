# SPDX-License-Identifier: Apache-2.0
"""Losses in a batch of clouds, as sensors and obstacles cause them; drawn first, then applied, so as to be replayed.

Clouds are in farthest-point order. What is left keeps its order, in which every point is still about as far from all
before it as in a sample of its own (tests/clouds/test_corruption.py). A thinned region keeps the first of its points,
which are its sample of that size. Residual tilt, mirroring and jitter are in `clouds.augmentation`.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel, Ordered
from doorstate.types import Indices, Points

Mask = NDArray[np.bool_]
_Floats = NDArray[np.float32]

LEAST_KEPT = 0.25  # of a cloud's points; a cloud that would lose more is left as it is
_WAVES = 12  # of the field of holes: more of them are slower, and their holes no more random
_RADII_M = (0.3, 1.0)  # of a thinned ball


_Length = Annotated[float, Field(ge=0.01, le=10)]
_Lengths = Annotated[tuple[_Length, _Length], Ordered]


class Corruption(FrozenModel):
    """Ranges of random losses in crops of doorways; the defaults change nothing.

    Attributes:
        cut_outs: largest number of boxes around points of a cloud that are removed.
        cut_sides_m: shortest and longest side of a box, each drawn apart.
        holes: largest share of the points that is lost in clusters.
        hole_size_m: distance at which losses in clusters become independent of each other.
        thinning: largest share of the points that a half-space or a ball of the cloud loses evenly.
        mix: probability that things of a crop without a door are put before or beside the doorway.
    """

    cut_outs: int = Field(default=0, ge=0, le=16)
    cut_sides_m: _Lengths = (0.1, 0.4)
    holes: float = Field(default=0.0, ge=0, lt=1)
    hole_size_m: _Length = 0.2
    thinning: float = Field(default=0.0, ge=0, lt=1)
    mix: float = Field(default=0.0, ge=0, le=1)

    @property
    def changes_nothing(self) -> bool:
        """True if no cloud is changed."""
        return not (self.cut_outs or self.holes or self.thinning or self.mix)


class CorruptionDraw(NamedTuple):
    """Losses drawn for a batch of B clouds, in units of the clouds; a place is a share of the points of a cloud."""

    cut_places: _Floats  # (B, K)
    cut_sides: _Floats  # (B, K, 3), 0 where fewer boxes are cut out
    hole_shares: _Floats  # (B,)
    hole_waves: _Floats  # (B, W, 3)
    hole_phases: _Floats  # (B, W)
    thin_shares: _Floats  # (B,)
    thin_places: _Floats  # (B,)
    thin_radii: _Floats  # (B,), infinite for a half-space
    thin_directions: _Floats  # (B, 3)
    donors: _Floats  # (B,) share of the clouds without a door; NaN for a cloud that is not mixed
    sides: _Floats  # (B,) side of the opening, 1 or -1, that the things of the donor are on


def draw_corruption(
    corruption: Corruption, rng: np.random.Generator, clouds: int, scale_m: float
) -> CorruptionDraw:
    """Draw the losses of one batch.

    Args:
        corruption: ranges of the losses.
        rng: random generator.
        clouds: B, number of clouds.
        scale_m: metres per unit of the clouds.
    """
    boxes = corruption.cut_outs
    used = np.arange(boxes) < rng.integers(0, boxes + 1, (clouds, 1))
    cut_sides = rng.uniform(*corruption.cut_sides_m, (clouds, boxes, 3)) * used[..., None]
    direction = rng.normal(0, 1, (clouds, 3))
    radii_m = np.where(rng.random(clouds) < 0.5, np.inf, rng.uniform(*_RADII_M, clouds))
    drawn = {
        "cut_places": rng.random((clouds, boxes)),
        "cut_sides": cut_sides / scale_m,
        "hole_shares": rng.uniform(0, corruption.holes, clouds),
        # Random waves of these lengths are a field with a Gaussian covariance (Rahimi and Recht 2007).
        "hole_waves": rng.normal(0, scale_m / corruption.hole_size_m, (clouds, _WAVES, 3)),
        "hole_phases": rng.uniform(0, 2 * np.pi, (clouds, _WAVES)),
        "thin_shares": rng.uniform(0, corruption.thinning, clouds),
        "thin_places": rng.random(clouds),
        "thin_radii": radii_m / scale_m,
        "thin_directions": direction / np.linalg.norm(direction, axis=1, keepdims=True),
        "donors": np.where(rng.random(clouds) < corruption.mix, rng.random(clouds), np.nan),
        "sides": np.where(rng.random(clouds) < 0.5, -1.0, 1.0),
    }
    return CorruptionDraw(**{name: values.astype(np.float32) for name, values in drawn.items()})


def kept_points(points: Points, draw: CorruptionDraw) -> Mask:
    """Return the mask (B, S) of the points (B, S, 3) that are left, at least a quarter of each cloud."""
    kept = ~(_in_boxes(points, draw) | _in_holes(points, draw) | _thinned(points, draw))
    kept[kept.mean(axis=1) < LEAST_KEPT] = True
    return kept


def first_kept(kept: Mask, count: int) -> Indices:
    """Return the indices (B, count) of the first points left, in their order.

    Where fewer are left, they are repeated in this order: a farthest-point order of which all points are taken may go
    on with any of them.
    """
    order = np.argsort(~kept, axis=1, kind="stable")
    turns = np.arange(count) % kept.sum(axis=1, keepdims=True)
    return np.take_along_axis(order, turns, axis=1)


def _in_boxes(points: Points, draw: CorruptionDraw) -> Mask:
    """Return the mask (B, S) of the points in boxes that stand on the axes."""
    inside = np.zeros(points.shape[:2], dtype=bool)
    for places, sides in zip(draw.cut_places.T, draw.cut_sides.swapaxes(0, 1), strict=True):
        distances = np.abs(points - _at(points, places))
        inside |= (2 * distances < sides[:, None]).all(axis=2)
    return inside


def _in_holes(points: Points, draw: CorruptionDraw) -> Mask:
    """Return the mask (B, S) of the points where a smooth random field is highest."""
    lost = np.floor(draw.hole_shares * points.shape[1]).astype(np.int64)
    if not lost.any():
        return np.zeros(points.shape[:2], dtype=bool)
    waves = points @ draw.hole_waves.swapaxes(1, 2) + draw.hole_phases[:, None]
    field = np.cos(waves, out=waves).sum(axis=2)
    ranked = np.sort(field, axis=1)
    highest_kept = np.take_along_axis(ranked, points.shape[1] - 1 - lost[:, None], axis=1)
    holes: Mask = field > highest_kept
    return holes


def _thinned(points: Points, draw: CorruptionDraw) -> Mask:
    """Return the mask (B, S) of the last points of a half-space or a ball around a point."""
    offsets = points - _at(points, draw.thin_places)
    ahead = np.matmul(offsets, draw.thin_directions[:, :, None])[..., 0] >= 0
    near = (offsets**2).sum(axis=2) <= draw.thin_radii[:, None] ** 2
    region = np.where(np.isinf(draw.thin_radii)[:, None], ahead, near)
    rank = region.cumsum(axis=1)
    kept = np.ceil((1 - draw.thin_shares[:, None]) * rank[:, -1:])
    thinned: Mask = region & (rank > kept)
    return thinned


def _at(points: Points, places: _Floats) -> Points:
    """Return the points (B, 1, 3) at places (B,)."""
    size = points.shape[1]
    rows = np.minimum((places * size).astype(np.int64), size - 1)
    chosen: Points = points[np.arange(len(points)), rows][:, None]
    return chosen

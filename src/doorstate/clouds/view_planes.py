# SPDX-License-Identifier: Apache-2.0
"""Planes in the view of a camera, whatever its tilt.

Seen from a camera, the inverse depth 1 / x of a plane is linear in the slopes y / x and z / x of the rays, and cameras
that triangulate have the same noise of inverse depth everywhere (Khoshelham and Elberink 2012, doi 10.3390/s120201437).
So a plane is a linear regression. Its sums are collected once, in cells of ray slopes; no fit touches points again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

Floats = NDArray[np.float64]

_SAMPLE_POINTS = 12_288
_MIN_X_M, _MAX_X_M = 0.1, 12.0
_MAX_SLOPE = 2.0  # rays up to 63 degrees off the axis
_CELL = 0.045  # of slopes: 2.6 degrees in the middle, 13 cm at 3 m
_MIN_CELL_POINTS = 6
_BLOCK = 1  # cells on each side that join the first fit of a plane
_MAX_PROPOSALS = 128
_MAX_PLANES = 10
_MIN_CELLS, _MIN_SHARE = 8, 0.012  # of a plane
_REFITS = 2
_TOLERANCE = 2.5  # deviations of inverse depth
_NOISE_QUANTILE = 0.4  # least share of the cells that hold a single plane
_NOISE_LIMITS = 0.0007, 0.012  # 1 / m; of a perfect and of a poor camera
_RIDGE = 1e-7
# Multiplications of a matrix product that NumPy does in one thread. The others of a larger one go on spinning for
# 20 ms, beside the network.
_ONE_THREAD = 200_000
_IDENTITY = np.eye(3)


@dataclass(frozen=True, eq=False)
class ViewPlane:
    """Plane of a view: points p with normal . p = distance_m.

    Attributes:
        normal: unit normal (3,), away from the camera.
        distance_m: from the camera, positive.
        share: of the cells of the view that it fills.
        error_deg: standard error of the normal from noise.
    """

    normal: Floats
    distance_m: float
    share: float
    error_deg: float


class _Cells(NamedTuple):
    """Sums over the points of each cell, with u = (1, y / x, z / x) and q = 1 / x, and the place of the cell."""

    uu: Floats  # (K, 3, 3)
    uq: Floats  # (K, 3)
    qq: Floats  # (K,)
    row: NDArray[np.int64]
    column: NDArray[np.int64]

    @property
    def counts(self) -> Floats:
        return self.uu[:, 0, 0]


def sample_ahead(cloud: NDArray[Any]) -> Points:
    """Return (M, 3) measured points ahead of the camera, evenly picked from (N, 3) or (H, W, 3)."""
    if cloud.ndim == 3:
        step = max(1, round(math.sqrt(cloud.shape[0] * cloud.shape[1] / _SAMPLE_POINTS)))
        sample = cloud[::step, ::step].reshape(-1, 3)
    else:
        sample = cloud[:: len(cloud) // _SAMPLE_POINTS | 1]
    sample = sample.astype(np.float32)
    x, y, z = sample.T
    with np.errstate(invalid="ignore", over="ignore"):
        reach = _MAX_SLOPE * x
        is_ahead = (x > _MIN_X_M) & (x < _MAX_X_M) & (np.abs(y) < reach) & (np.abs(z) < reach)
    ahead: Points = sample[is_ahead]
    return ahead


def find_planes(sample: Points) -> list[ViewPlane]:
    """Return the planes of a view, largest first, at most ten.

    Each is the one that explains most cells of those that the planes before it leave over.

    Args:
        sample: (M, 3) points ahead of the camera.
    """
    cells = _collect(sample)
    if cells is None:
        return []
    noise = _noise(cells)
    limit = (_TOLERANCE * noise) ** 2
    least = max(_MIN_CELLS, _MIN_SHARE * len(cells.qq))
    proposals = _proposals(cells, limit)
    fitting = (_misfits(cells, proposals) <= limit).astype(np.float32)  # (K, P)
    free = np.ones(len(cells.qq), np.bool_)
    planes: list[ViewPlane] = []
    while fitting.size and len(planes) < _MAX_PLANES:
        sizes = fitting[free].sum(axis=0)
        best = int(sizes.argmax())
        if sizes[best] < least:
            break
        members = _grow(cells, free & (fitting[:, best] > 0), free, limit)
        fitting[:, best] = 0
        if np.count_nonzero(members) >= least:
            planes.append(_plane(cells, members, noise))
            free &= ~members
    return sorted(planes, key=lambda plane: -plane.share)


def _collect(sample: Points) -> _Cells | None:
    if len(sample) == 0:
        return None
    q = 1 / sample[:, 0].astype(np.float64)
    a, b = sample[:, 1] * q, sample[:, 2] * q
    row, column = (np.floor(slope / _CELL).astype(np.int64) for slope in (b, a))
    row -= row.min()
    column -= column.min()
    width = int(column.max()) + 1
    number = row * width + column
    counts = np.bincount(number)
    used = np.flatnonzero(counts >= _MIN_CELL_POINTS)
    if len(used) == 0:
        return None
    products = (a, b, a * a, a * b, b * b, q, a * q, b * q, q * q)
    sums = [np.bincount(number, product)[used].astype(np.float64, copy=False) for product in products]
    one, (sa, sb, saa, sab, sbb, *uq, qq) = counts[used].astype(np.float64), sums
    uu = np.stack([one, sa, sb, sa, saa, sab, sb, sab, sbb], axis=-1).reshape(-1, 3, 3)
    return _Cells(uu, np.stack(uq, axis=-1), qq, used // width, used % width)


def _noise(cells: _Cells) -> float:
    """Return the deviation of inverse depth from a plane, in the cells that hold one."""
    squares = cells.qq - (_regress(cells.uu, cells.uq) * cells.uq).sum(axis=1)
    variances = np.maximum(squares, 0) / (cells.counts - 3)
    return float(np.clip(math.sqrt(np.quantile(variances, _NOISE_QUANTILE)), *_NOISE_LIMITS))


def _proposals(cells: _Cells, limit: float) -> Floats:
    """Return planes (P, 3), in inverse depth, of blocks of cells that hold one plane."""
    sums = np.concatenate([cells.uu.reshape(-1, 9), cells.uq, cells.qq[:, None]], axis=1)
    grid = np.zeros((cells.row.max() + 1 + 2 * _BLOCK, cells.column.max() + 1 + 2 * _BLOCK, 13))
    grid[cells.row + _BLOCK, cells.column + _BLOCK] = sums
    block = np.zeros_like(sums)
    for down in range(2 * _BLOCK + 1):
        for across in range(2 * _BLOCK + 1):
            block += grid[cells.row + down, cells.column + across]
    planes = _regress(block[:, :9].reshape(-1, 3, 3), block[:, 9:12])
    misfits = (block[:, 12] - (planes * block[:, 9:12]).sum(axis=1)) / block[:, 0]
    smooth = np.flatnonzero(misfits <= limit)
    return planes[smooth[:: max(1, -(-len(smooth) // _MAX_PROPOSALS))]]


def _grow(
    cells: _Cells, members: NDArray[np.bool_], free: NDArray[np.bool_], limit: float
) -> NDArray[np.bool_]:
    """Return the free cells on the plane of these members, fitted again to all that it explains."""
    for _ in range(_REFITS):
        plane = _regress(cells.uu[members].sum(axis=0), cells.uq[members].sum(axis=0))
        members = free & (_misfits(cells, plane[None])[:, 0] <= limit)
        if not members.any():
            break
    return members


def _misfits(cells: _Cells, planes: Floats) -> Floats:
    """Return the mean squared residual (K, P) of each cell from each plane (P, 3)."""
    squares = (planes[:, :, None] * planes[:, None, :]).reshape(-1, 9)
    factors = np.concatenate([squares, -2 * planes], axis=1).T  # (12, P)
    sums = np.concatenate([cells.uu.reshape(-1, 9), cells.uq], axis=1)  # (K, 12)
    misfits = np.empty((len(sums), len(planes)))
    step = max(1, _ONE_THREAD // sums.size)
    for first in range(0, len(planes), step):
        part = slice(first, first + step)
        np.matmul(sums, factors[:, part], out=misfits[:, part])
    misfits += cells.qq[:, None]
    misfits /= cells.counts[:, None]
    return misfits


def _regress(uu: Floats, uq: Floats) -> Floats:
    """Return the regression (..., 3) of inverse depth on ray slopes."""
    plane = np.asarray(np.linalg.solve(_with_ridge(uu), uq[..., None])[..., 0], np.float64)
    return plane


def _with_ridge(uu: Floats) -> Floats:
    """Return sums of squares (..., 3, 3) that are never singular."""
    trace = uu[..., 0, 0] + uu[..., 1, 1] + uu[..., 2, 2]
    with_ridge: Floats = uu + (_RIDGE * trace)[..., None, None] * _IDENTITY
    return with_ridge


def _plane(cells: _Cells, members: NDArray[np.bool_], noise: float) -> ViewPlane:
    uu, uq = cells.uu[members].sum(axis=0), cells.uq[members].sum(axis=0)
    plane = _regress(uu, uq)
    length = float(np.linalg.norm(plane))
    normal = plane / length
    across = (_IDENTITY - normal[:, None] * normal) * (noise / length)
    variance = float((across @ np.linalg.inv(_with_ridge(uu)) @ across).trace())
    return ViewPlane(normal, 1 / length, float(members.mean()), math.degrees(math.sqrt(variance)))

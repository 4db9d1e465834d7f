# SPDX-License-Identifier: Apache-2.0
"""Height of the floor in a level cloud: the lowest horizontal surface below the camera with enough area."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

_LOWEST_M, _HIGHEST_M = -2.5, -0.06  # heights of a floor below the camera
_SLICE_M = 0.02
_SLICES = round((_HIGHEST_M - _LOWEST_M) / _SLICE_M)
_LAYER = 3  # slices; a floor that is level within 1 degree spreads over 3.5 cm in 2 m
_ABOVE = range(_LAYER + 1, _LAYER + 6)  # slices above a layer; an upright surface goes on there
_CELL_M = 0.15
_AHEAD, _ACROSS = 40, 48  # cells: 6 m ahead, 3.6 m to each side
_MIN_AREA_M2 = 0.1  # chosen: the seat of a chair seen aslant is smaller, the floor before a near wall larger
_MIN_SHARE = 0.15  # of the largest layer's area; mirror images in a glossy floor are patches
_MAX_BELOW_SHARE = 0.05  # of the points below the camera; walls and legs go on below a table top
_BELOW = 5  # slices
_SAMPLE_POINTS = 12_288
_LOWEST_SHARE = 0.01
_HEIGHT_TOLERANCE_M = 0.12  # of a camera's height that is known


def find_floor_z_m(points: Points, camera_height_m: float | None = None) -> float | None:
    """Return the height of the floor in a level cloud, negative; None where no floor is measured.

    The floor is the lowest horizontal surface below the camera that covers enough area in plan view and has hardly
    any points below it. Table tops are not: legs and walls go on below them.

    Args:
        points: (..., 3) metres, level, x forward, y left, z up, camera at the origin; NaN where nothing was measured.
        camera_height_m: height of the camera above the floor, if it is known. The floor is then measured near this
            height, and taken from it where it is not in view.
    """
    low = _low_points(points)
    if camera_height_m is None:
        return _lowest_surface_z_m(low)
    near = np.abs(low[:, 2] + camera_height_m) <= _HEIGHT_TOLERANCE_M
    measured_m = _largest_surface_z_m(low[near])
    return -camera_height_m if measured_m is None else measured_m


def lowest_z_m(points: NDArray[Any]) -> float:
    """Return the height of the lowest of (N, 3) points but for a hundredth, which noise places below the floor."""
    return float(np.quantile(points[:, 2], _LOWEST_SHARE))


def _low_points(points: NDArray[Any]) -> Points:
    """Return (M, 3) points below the camera, evenly picked."""
    flat = points.reshape(-1, 3)
    # An odd step meets all columns of an image.
    sample = flat[:: len(flat) // _SAMPLE_POINTS | 1].astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        ahead, across = sample[:, 0] / _CELL_M, np.abs(sample[:, 1]) / (_CELL_M / 2)
        inside = (ahead > 0) & (ahead < _AHEAD) & (across < _ACROSS)
        return sample[inside & (sample[:, 2] > _LOWEST_M) & (sample[:, 2] < _HIGHEST_M)]


def _lowest_surface_z_m(low: Points) -> float | None:
    areas_m2, counts = _layer_areas_m2(low)
    is_large = areas_m2 >= max(_MIN_AREA_M2, _MIN_SHARE * float(areas_m2.max()))
    if not is_large.any():
        return None
    first = int(is_large.argmax())  # it may hold the lower edge of the floor only
    layer = first + int(areas_m2[first : first + _LAYER].argmax())
    if counts[: max(0, layer - _BELOW)].sum() > _MAX_BELOW_SHARE * len(low):
        return None
    return _height_m(low, layer)


def _largest_surface_z_m(low: Points) -> float | None:
    areas_m2, _ = _layer_areas_m2(low)
    layer = int(areas_m2.argmax())
    return _height_m(low, layer) if areas_m2[layer] >= _MIN_AREA_M2 else None


def _layer_areas_m2(low: Points) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the area in plan view of the layer that starts with each slice, and the points in each slice.

    Cells with points right above the layer do not count: they belong to an upright surface.
    """
    slices = _slices(low)
    ahead = (low[:, 0] / _CELL_M).astype(np.int64)
    across = (low[:, 1] / _CELL_M + _ACROSS / 2).astype(np.int64)
    across = np.minimum(across, _ACROSS - 1)  # the sum may round up to the edge
    occupied = np.zeros((_SLICES + _ABOVE.stop, _AHEAD * _ACROSS), np.bool_)
    occupied[slices, ahead * _ACROSS + across] = True
    layers = _union(occupied, range(_LAYER))
    layers &= ~_union(occupied, _ABOVE)
    areas_m2 = np.count_nonzero(layers, axis=1) * _CELL_M**2
    return areas_m2, np.bincount(slices, minlength=_SLICES)


def _union(occupied: NDArray[np.bool_], offsets: range) -> NDArray[np.bool_]:
    union = np.zeros((_SLICES, occupied.shape[1]), np.bool_)
    for offset in offsets:
        union |= occupied[offset : offset + _SLICES]
    return union


def _slices(low: Points) -> NDArray[np.int64]:
    slices: NDArray[np.int64] = np.clip((low[:, 2] - _LOWEST_M) / _SLICE_M, 0, _SLICES - 1).astype(np.int64)
    return slices


def _height_m(low: Points, layer: int) -> float:
    slices = _slices(low)
    return float(np.median(low[(slices >= layer) & (slices < layer + _LAYER), 2]))

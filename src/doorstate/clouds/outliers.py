# SPDX-License-Identifier: Apache-2.0
"""Outliers of a cloud: single pixels and small blobs that float before or behind every surface.

Stereo and structured light mismatch some pixels of every frame. Farthest-point sampling picks such points first,
because they are far from all others, so that a few in a thousand decide what a network sees. A point is an outlier if
too few points near its ray have its range: the idea of statistical removal (Rusu et al. 2008,
doi 10.1016/j.robot.2008.08.005), with counts of pixels in place of nearest neighbours. Figures are in
docs/benchmarks/ghosts.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.ray_grid import block_counts
from doorstate.types import Points

RANGE_TOLERANCE = 0.05  # ranges on one surface, some pixels apart, differ by less
# Largest blob, of an image with 480 rows: 2.6 cm at 3 m with a lens of 60 degrees. Longer things stay, however thin.
BLOB_PX, _BLOB_ROWS = 5, 480
_REACH_PX = 4  # pixels that are compared on each side, just outside the largest blob
_MIN_SUPPORT = 3  # of the 16 compared pixels; the end of a pole has 4
_SUPPORT_SHARE = 0.25  # of the upper quartile's support, in images in which every other pixel is missing
_SPARSE_SUPPORT = 4  # upper quartile of images that are evaluated as flat clouds
# Counted near a ray in a flat cloud, as a share of the upper quartile's: 0.06 on a pole of two pixels, 0.02 on a blob
# of 5 x 5.
_MIN_BLOCK_SHARE = 0.03
_MIN_FLAT_POINTS = 512  # with fewer, neighbours on a surface are as far apart as an outlier
_MAX_SHARE = 0.5  # with more the points are too far apart for a judgement
_LEVELS_PER_UNIT = 1000  # of the logarithm of a range, as 16-bit integers
_TOLERANCE = round(np.log1p(RANGE_TOLERANCE) * _LEVELS_PER_UNIT)
_MAX_REST = 0.1  # of the pixels; more are quicker all together
_MISSING = -30000


class CleanCloud(NamedTuple):
    """Cloud without its outliers."""

    points: Points  # as the raw cloud, NaN in place of outliers
    outlier_share: float  # of the measured points


def remove_outliers(cloud: Points) -> CleanCloud:
    """Return the cloud with NaN in place of its outliers; the same array if it has none.

    Args:
        cloud: (N, 3) or organized (H, W, 3), sensor frame, in any unit; NaN, infinite or (0, 0, 0) where nothing was
            measured.
    """
    levels = _range_levels(cloud)
    outliers = _outliers(cloud, levels)
    count = int(np.count_nonzero(outliers))
    if count == 0:
        return CleanCloud(cloud, 0.0)
    points = cloud.astype(np.result_type(cloud, np.float32))
    points[_places(outliers)] = np.nan
    return CleanCloud(points, count / int(np.count_nonzero(levels != _MISSING)))


def outlier_mask(cloud: Points) -> NDArray[np.bool_]:
    """Return the mask (N,) or (H, W) of the outliers of a cloud, (N, 3) or organized (H, W, 3).

    Pixels of an image are compared with 16 others, left and right, above and below, just outside the largest blob; 3
    must have the same range within 5 %. Points of a flat cloud are counted in cells of direction and range.
    """
    return _outliers(cloud, _range_levels(cloud))


def _outliers(cloud: Points, levels: NDArray[np.int16]) -> NDArray[np.bool_]:
    measured = levels != _MISSING
    outliers = _image_outliers(levels, measured) if cloud.ndim == 3 else None
    if outliers is None:
        outliers = _flat_outliers(cloud.reshape(-1, 3), measured.ravel()).reshape(measured.shape)
    if np.count_nonzero(outliers) > _MAX_SHARE * np.count_nonzero(measured):
        return np.zeros_like(measured)
    return outliers


def _range_levels(cloud: Points) -> NDArray[np.int16]:
    """Return the logarithm of each range in thousandths, `_MISSING` where nothing was measured."""
    # Missing points are NaN, infinite or so large that their squares overflow.
    with np.errstate(all="ignore"):
        squares = np.square(cloud, dtype=np.float32)
        levels = squares[..., 0] + squares[..., 1]
        levels += squares[..., 2]
        np.log(levels, out=levels)
        levels *= np.float32(_LEVELS_PER_UNIT / 2)
        out_of_range = ~(np.abs(levels) < -_MISSING / 2)
    np.putmask(levels, out_of_range, np.float32(_MISSING))
    return levels.astype(np.int16)


def _image_outliers(levels: NDArray[np.int16], measured: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    """Return the outliers of an image; None if its pixels are too sparse."""
    side = max(1, round(BLOB_PX * min(levels.shape) / _BLOB_ROWS))
    near, far = range(side, side + _REACH_PX // 2), range(side + _REACH_PX // 2, side + _REACH_PX)
    support = np.zeros(levels.shape, np.uint8)
    _add_support(support, levels, near)
    if _typical(support, measured) == 4 * len(near):
        # A dense image: hardly any pixel is left to be compared with those farther away.
        rest = _places(measured & (support < _MIN_SUPPORT))
        if len(rest[0]) < _MAX_REST * support.size:
            outliers = np.zeros_like(measured)
            outliers[rest] = support[rest] + _support_of(levels, rest, far) < _MIN_SUPPORT
            return outliers
    _add_support(support, levels, far)
    typical = _typical(support, measured)
    if typical < _SPARSE_SUPPORT:
        return None
    return measured & (support < min(_MIN_SUPPORT, int(_SUPPORT_SHARE * typical)))


def _places(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], ...]:
    """Return the indices of what a mask selects."""
    # Rows and columns of a flat index: searching a plane takes ten times as long.
    return np.unravel_index(np.flatnonzero(mask), mask.shape)


def _typical(support: NDArray[np.uint8], measured: NDArray[np.bool_]) -> int:
    """Return the upper quartile of the support of measured pixels."""
    # A quantile by sorting takes as long as four comparisons of all pixels.
    sampled = np.bincount(support[::4, ::4][measured[::4, ::4]])
    return int(np.searchsorted(np.cumsum(sampled), 0.75 * sampled.sum()))


def _add_support(support: NDArray[np.uint8], levels: NDArray[np.int16], offsets: Iterable[int]) -> None:
    """Add the number of pixels at the same range, these offsets away in four directions."""
    # Negative differences become large numbers without a sign: one comparison for both limits.
    raised = levels + np.int16(_TOLERANCE)
    for offset in offsets:
        for first, second in (
            (np.s_[offset:], np.s_[:-offset]),
            (np.s_[:, offset:], np.s_[:, :-offset]),
        ):
            apart = (raised[first] - levels[second]).view(np.uint16)
            agree = (apart <= 2 * _TOLERANCE).view(np.uint8)
            support[first] += agree
            support[second] += agree


def _support_of(
    levels: NDArray[np.int16], pixels: tuple[NDArray[np.intp], ...], offsets: Iterable[int]
) -> NDArray[np.uint8]:
    """Return the same numbers (K,) for a few pixels, their rows and columns."""
    own = levels[pixels]
    support = np.zeros(len(own), np.uint8)
    for axis, offset in itertools.product((0, 1), (step * sign for step in offsets for sign in (-1, 1))):
        place = pixels[axis] + offset
        inside = (place >= 0) & (place < levels.shape[axis])
        place = np.where(inside, place, 0)
        other = levels[place, pixels[1]] if axis == 0 else levels[pixels[0], place]
        support += inside & (np.abs(own - other) <= _TOLERANCE)
    return support


def _flat_outliers(points: Points, measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
    outliers = np.zeros(len(points), dtype=np.bool_)
    rows = np.flatnonzero(measured)
    if len(rows) < _MIN_FLAT_POINTS:
        return outliers
    # A selection costs as much as the counts.
    counts = block_counts(points if len(rows) == len(points) else points[rows])
    typical = float(np.quantile(counts[:: max(1, len(counts) // 4096)], 0.75))
    outliers[rows[counts < max(2, _MIN_BLOCK_SHARE * typical)]] = True
    return outliers

# SPDX-License-Identifier: Apache-2.0
"""The one path from raw points to a network's input: clean, check, order, normalise."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._models import FrozenModel
from doorstate.clouds.sampling import farthest_point_indices
from doorstate.errors import CloudContentError, TooFewPointsError
from doorstate.types import Indices, Points

NUM_POINTS = 4096  # the paper's cloud size
MIN_POINTS = 128  # fewer cannot fill the largest neighbourhood of a network
SCALE_M = 3.0  # half the depth of a typical frame: networks were designed for clouds of about unit radius
# No depth camera reaches farther; a cloud in millimetres has medians in the thousands.
_LARGEST_MEDIAN_M = 50.0
_SMALLEST_MEDIAN_M = 0.02
_LIKELY_MEDIAN_M = (0.8, 8.0)  # less than a factor of ten apart, so that one unit fits
_OTHER_UNITS_M = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "km": 1000.0}
_NO_RETURN = 1e6  # in any unit; some drivers write FLT_MAX where nothing returned
_PIXELS_PER_POINT = 16  # that thinning leaves to choose from
_UNITS_FROM_POINTS = 4096
_OF_DEPTH = "(integer depth: --depth-scale)"
_IMAGE_LINES, _IMAGE_PLACES, _FEWEST_PAIRS = 8, 32, 12  # looked at, to see whether it is an image


class CloudSpec(FrozenModel):
    """Preparation of a cloud: how many points, from which pixels, to which depth.

    Attributes:
        num_points: points to keep.
        thin: of an organized cloud, sample from every second, third, ... row and column only, as long as 16 times
            `num_points` pixels remain. Several times faster, and no point moves by more than a few pixels.
        max_depth_m: drop points farther ahead, along x. Farthest-point sampling spreads over space, so that surfaces
            beyond the training data, such as the end of a corridor, would take most of the points.
    """

    num_points: int = NUM_POINTS
    thin: bool = False
    max_depth_m: float | None = None


DEFAULT_SPEC = CloudSpec()


class PreparedCloud(NamedTuple):
    """Points in farthest-point order and the rows of the raw cloud they came from."""

    points: Points  # (n, 3) metres
    indices: Indices  # (n,)


def prepare_cloud(points: Points, spec: CloudSpec = DEFAULT_SPEC) -> PreparedCloud:
    """Drop unmeasured points, check the rest, and keep `spec.num_points` of them in farthest-point order.

    A cloud with fewer distinct points gives all of them, each once; points are never repeated.

    Args:
        points: (N, 3) or organized (H, W, 3) metres; NaN, infinite, (0, 0, 0) or beyond all measure where nothing
            was measured.
        spec: number of points, thinning and depth limit.

    Raises:
        CloudContentError: of another form, or units that cannot be metres.
        TooFewPointsError: empty, nothing measured, or fewer than 128 distinct points.
    """
    points = check_form(points)
    count, max_depth_m = spec.num_points, spec.max_depth_m
    if spec.thin:
        pixels = _thinned_pixels(points.shape, count)
        prepared = prepare_cloud(points.reshape(-1, 3)[pixels], spec.model_copy(update={"thin": False}))
        return PreparedCloud(prepared.points, pixels[prepared.indices])
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 3)
    if len(flat) == 0:
        raise TooFewPointsError("the cloud is empty: it holds no points")
    measured = np.flatnonzero(is_measured(flat))
    if len(measured) == 0:
        if not (np.abs(flat) < _NO_RETURN).all(axis=1).any():
            raise TooFewPointsError("nothing was measured: all points are NaN or infinite")
        raise TooFewPointsError("all measured points lie at the origin: the cloud holds no surface")
    clean = flat[measured]
    if len(clean) < MIN_POINTS:
        raise TooFewPointsError(f"too few points: {len(clean)} measured, at least {MIN_POINTS} are needed")
    _check_units(clean)
    if max_depth_m is not None:
        near = clean[:, 0] <= max_depth_m
        if near.sum() < MIN_POINTS:
            raise TooFewPointsError(
                f"too few points: {near.sum()} within {max_depth_m:g} m ahead, at least {MIN_POINTS} are needed; "
                f"half of all are more than {_median_range(clean):.1f} m away"
            )
        measured, clean = measured[near], clean[near]
    chosen = _without_repeats(farthest_point_indices(clean, min(count, len(clean))))
    if len(chosen) < min(count, MIN_POINTS):
        raise TooFewPointsError(
            f"too few points: {len(chosen)} distinct of {len(clean)} measured, at least {MIN_POINTS} are needed"
        )
    return PreparedCloud(clean[chosen], measured[chosen])


def check_form(points: Points) -> Points:
    """The points as an array, if it is one of points.

    Raises:
        CloudContentError: another form than (N, 3) or (H, W, 3), or no numbers: with a fourth value, such as an
            intensity, rows would be read across one another.
    """
    cloud = np.asarray(points)
    if cloud.dtype.kind not in "fiu" or cloud.ndim not in (2, 3) or cloud.shape[-1] != 3:
        form = f"{cloud.dtype} of {cloud.shape}"
        hint = "; take x, y, z with points[..., :3]" if cloud.ndim in (2, 3) and cloud.shape[-1] > 3 else ""
        raise CloudContentError(f"a cloud is numbers of (N, 3) or (H, W, 3), this is {form}{hint}")
    return cloud


def check_one_cloud(points: Points) -> Points:
    """The same, if it is one cloud; an image of one row or column as (N, 3).

    Raises:
        CloudContentError: as of `check_form`, or several clouds as (B, N, 3), which would be answered as one image.
    """
    cloud = check_form(points)
    if cloud.ndim == 3 and 1 in cloud.shape[:2]:
        return cloud.reshape(-1, 3)
    if cloud.ndim == 3 and not is_image(cloud):
        raise CloudContentError(
            f"{cloud.shape} is no image: neighbours in a row lie as far apart as any two points; one of several clouds "
            "is cloud[0], and all points in any order are cloud.reshape(-1, 3)"
        )
    return cloud


def is_image(cloud: NDArray[Any]) -> bool:
    """Whether points (H, W, 3) are a camera's: rays of neighbours are closer than those half an image apart.

    In rows and in columns: clouds behind one another are alike down the columns, or unlike along the rows. True where
    too little was measured to tell.
    """
    return all(_is_scanned(lines) for lines in (cloud, np.swapaxes(cloud, 0, 1)))


def _is_scanned(lines: NDArray[Any]) -> bool:
    """Whether neighbours in a line are closer than points half a line apart."""
    some = lines[:: max(1, len(lines) // _IMAGE_LINES)]
    length = some.shape[1]
    places = np.arange(0, length, max(1, length // _IMAGE_PLACES))

    def typical_turn(step: int) -> float:
        here, there = (some[:, (places + add) % length].astype(np.float64) for add in (0, step))
        both = is_measured(here) & is_measured(there)
        here, there = here[both], there[both]
        if len(here) < _FEWEST_PAIRS:
            return np.nan
        lengths = np.linalg.norm(here, axis=1) * np.linalg.norm(there, axis=1)
        return max(0.0, float(np.median(1 - (here * there).sum(axis=1) / lengths)))

    return not typical_turn(1) >= 0.5 * typical_turn(length // 2)


def is_measured(points: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Which (..., 3) points are something: not NaN, infinite, beyond all measure or (0, 0, 0)."""
    x, y, z = (np.abs(points[..., axis]) for axis in range(3))
    found: NDArray[np.bool_] = (
        (x < _NO_RETURN) & (y < _NO_RETURN) & (z < _NO_RETURN) & ((x > 0) | (y > 0) | (z > 0))
    )
    return found


def normalize(points: Points) -> Points:
    """Centre clouds on their centroid and divide by 3 m, so that the door keeps its size as a cue.

    Args:
        points: (..., N, 3) metres.

    Returns:
        The same shape, float32, without unit.
    """
    normalized: Points = (points - centroids(points)[..., None, :]) / np.float32(SCALE_M)
    return normalized


def centroids(points: Points) -> Points:
    """What `normalize` takes from every point: (..., 3) of (..., N, 3), metres."""
    mean: Points = points.mean(axis=-2, dtype=np.float64).astype(np.float32)
    return mean


def _thinned_pixels(shape: tuple[int, ...], count: int) -> Indices:
    """Row numbers of the flattened cloud that thinning keeps."""
    if len(shape) != 3:
        return np.arange(int(np.prod(shape[:-1])))
    height, width, _ = shape
    step = max(1, int(np.sqrt(height * width / (_PIXELS_PER_POINT * count))))
    return (np.arange(0, height, step)[:, None] * width + np.arange(0, width, step)).ravel()


def _without_repeats(chosen: Indices) -> Indices:
    # Sampling repeats a point only when every distinct one is taken, so the repeats are the tail.
    return chosen[: len(np.unique(chosen))]


def _median_range(points: Points) -> float:
    some = points[:: max(1, len(points) // _UNITS_FROM_POINTS)].astype(np.float64)
    return float(np.median(np.linalg.norm(some, axis=1)))


def _check_units(points: Points) -> None:
    median = _median_range(points)
    if median > _LARGEST_MEDIAN_M:
        raise CloudContentError(
            f"half of the points are more than {median:.0f} m away: {_likely_unit(median)}"
        )
    if median < _SMALLEST_MEDIAN_M:
        raise CloudContentError(
            f"half of the points are within {median * 1000:.2g} mm of the camera: {_likely_unit(median)}"
        )


def _likely_unit(median: float) -> str:
    """How far the unit is off that would bring half of the points to where doors are; one may have been said."""
    for unit, metres in _OTHER_UNITS_M.items():
        if _LIKELY_MEDIAN_M[0] <= median * metres <= _LIKELY_MEDIAN_M[1]:
            times = f"{1 / metres:g} times too far" if metres < 1 else f"{metres:g} times too near"
            return f"{times} for a door; if it was read as metres, say --units {unit} {_OF_DEPTH}"
    return f"in which unit is it? say --units {_OF_DEPTH}"

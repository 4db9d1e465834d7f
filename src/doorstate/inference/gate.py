# SPDX-License-Identifier: Apache-2.0
"""What a cloud must show before anybody is asked for the door's state: missing data are no free way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import MIN_POINTS, is_measured
from doorstate.errors import ConfigError
from doorstate.types import Points

# Cells of 8 x 8 pixels in a 640 x 480 image: hundredths of a door, tens of pixels to judge by.
_GRID_ROWS, _GRID_COLUMNS = 60, 80
_POINTS_PER_CELL = 16  # on average; a flat cloud with fewer has gaps of its own
_COARSEST = (
    1 / 16
)  # of the cells; with fewer than 15 x 20 a gap beside a leaf is no longer told from a hole in it
_CELL_MEASURED = 1 / 8  # of a cell's pixels; fewer are flying pixels
_WIDEST_TANGENT = (
    1.0  # flat clouds are looked at within 45 degrees of straight ahead: no depth camera sees more
)


@dataclass(frozen=True)
class Gate:
    """Refuses clouds that a state must not be told from; figures of every condition are in docs/deployment.md.

    A hole is a run of missing pixels down a column of the image. It is a free way only if below it something was
    measured farther away than any door that is asked for: the floor behind an open door. Behind glass, dropout and
    things before the lens no such floor is seen.

    Args:
        min_points: fewer measured points are refused; those of the largest neighbourhood of a network.
        min_measured_share: of all pixels or rows; chosen: half of the emptiest simulated frames'.
        max_behind_share: of the measured points; chosen: a camera sees none, a scan or a cloud in another frame a half.
        min_median_range_m: half of the points must be farther; chosen: nearer than any simulated frame's median,
            and an arm's length.
        max_median_range_m: half of the points must be nearer; chosen: 1.5 times the largest of simulated and
            recorded frames with a door.
        min_extent_m: of the middle nine tenths of the points, in height and across; chosen: half a door's width,
            which a floor or a hand alone does not have.
        min_view_deg: across, between the outermost rays; chosen: half an image with a lens of 60 degrees shows 30, an
            upright one of such a lens 47.
        hole_height_share: of the image's height, from which on missing pixels are a hole; chosen: 0.5 m of a door 2 to
            3 m away, more than a handle's glare or a shadow of stereo.
        free_reach_m: what must be measured below a hole, horizontally; chosen: 0.5 m behind the farthest doors that the
            packaged weights know (3.5 m).
        max_hole_share: of the columns looked at, with holes and no such floor; chosen: 0.25 m of a door 3 m away
            with a lens of 60 degrees.
        margin_share: of the columns left out on each side; chosen: stereo and registered cameras measure nothing in
            up to a tenth.
    """

    min_points: int = MIN_POINTS
    min_measured_share: float = 0.25
    max_behind_share: float = 0.05
    min_median_range_m: float = 0.6
    max_median_range_m: float = 5.4
    min_extent_m: float = 0.45
    min_view_deg: float = 40.0
    hole_height_share: float = 0.2
    free_reach_m: float = 4.0
    max_hole_share: float = 0.1
    margin_share: float = 0.1

    def __post_init__(self) -> None:
        """Refuse shares that would switch a condition off without a word.

        Raises:
            ConfigError: a share below 0 or above 1, or margins that leave no column.
        """
        for name in (
            "min_measured_share",
            "max_behind_share",
            "hole_height_share",
            "max_hole_share",
            "margin_share",
        ):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"gate: {name} {getattr(self, name)}: a share is from 0 to 1")
        if self.margin_share > 0.4:
            raise ConfigError(
                f"gate: margin_share {self.margin_share}: at most 0.4, so that columns are left"
            )

    def __call__(self, cloud: Points) -> str | None:
        """Why no state may be told from a cloud, or None if one may.

        Args:
            cloud: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, not measured as in clouds.preparation.
                Holes are looked for in organized clouds and in flat ones of 4800 points or more.
        """
        cloud = np.asarray(cloud)
        if cloud.ndim == 3 and cloud.shape[0] >= 4 * _GRID_ROWS:
            cloud = np.ascontiguousarray(cloud[::2, ::2])
            fewest = -(-self.min_points // 4)
        else:
            fewest = self.min_points
        measured = is_measured(cloud)
        points = cloud[measured]
        if len(points) < fewest:
            return f"too few points were measured: at least {self.min_points} are needed"
        share = len(points) / measured.size
        if share < self.min_measured_share:
            return f"only {share:.0%} of the cloud was measured: at least {self.min_measured_share:.0%} are needed"
        some = points[:: max(1, len(points) // 8192)].astype(np.float64)
        share = float((some[:, 0] < 0).mean())
        if share > self.max_behind_share:
            # Optical clouds look along z: all of them are ahead there.
            optical = float((some[:, 2] > 0).mean()) > 1 - self.max_behind_share
            guess = (
                "an optical frame? say --frame optical" if optical else "a scan, or a cloud in another frame"
            )
            return f"{share:.0%} of the points lie behind the camera: {guess}"
        median_m = float(np.median(np.linalg.norm(some, axis=1)))
        if median_m < self.min_median_range_m:
            return f"half of the points are within {median_m:.2f} m: something is before the camera"
        if median_m > self.max_median_range_m:
            return f"half of the points are beyond {median_m:.1f} m: too far away for a door"
        low, high = np.quantile(some, (0.05, 0.95), axis=0)
        across_m, height_m = float((high - low)[:2].max()), float((high - low)[2])
        if min(across_m, height_m) < self.min_extent_m:
            return f"the surfaces are only {across_m:.2f} m wide and {height_m:.2f} m high: too little for a door"
        view_deg = _view_deg(some)
        if view_deg < self.min_view_deg:
            return f"the view is only {view_deg:.0f} degrees wide: at least {self.min_view_deg:g} are needed"
        share = self.hole_share(cloud, measured)
        if share > self.max_hole_share:
            return (
                f"{share:.0%} of the view ahead is a hole without a floor {self.free_reach_m:g} m away: "
                "glass or missing data"
            )
        return None

    def hole_share(self, cloud: Points, measured: NDArray[np.bool_]) -> float:
        """Share of the columns that have a hole and nothing far away below it.

        Args:
            cloud: as for a call.
            measured: (N,) or (H, W), which points count.
        """
        if cloud.ndim == 3:
            filled, reach_m = _image_cells(cloud, measured)
        else:
            share = min(1.0, np.count_nonzero(measured) / (_POINTS_PER_CELL * _GRID_ROWS * _GRID_COLUMNS))
            if share < _COARSEST:
                return 0.0
            filled, reach_m = _ray_cells(cloud[measured], share)
        margin = round(self.margin_share * filled.shape[1])
        filled, reach_m = (
            filled[:, margin : filled.shape[1] - margin],
            reach_m[:, margin : filled.shape[1] - margin],
        )
        tallest = max(1, round(self.hole_height_share * len(filled)))
        # Upwards from the lowest row: how far was seen below, and how many cells in a run are missing.
        run = np.zeros(filled.shape[1], dtype=np.int64)
        below_m = np.zeros(filled.shape[1])
        unseen = np.zeros(filled.shape[1], dtype=np.bool_)
        for row_filled, row_reach_m in zip(filled[::-1], reach_m[::-1], strict=True):
            run = np.where(row_filled, 0, run + 1)
            below_m = np.where(row_filled, np.maximum(below_m, row_reach_m), below_m)
            unseen |= (run >= tallest) & (below_m < self.free_reach_m)
        return float(unseen.mean())


def _view_deg(points: NDArray[np.float64]) -> float:
    """Angle in plan view between the outermost hundredths of the rays ahead."""
    ahead = points[points[:, 0] > 0]
    if len(ahead) == 0:
        return 0.0
    right, left = np.quantile(np.arctan2(ahead[:, 1], ahead[:, 0]), (0.01, 0.99))
    return float(np.degrees(left - right))


def _image_cells(cloud: Points, measured: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which cells of an image were measured, and their mean horizontal range in metres; the lowest row last."""
    size = max(1, min(measured.shape) // _GRID_ROWS)
    rows, columns = measured.shape[0] // size * size, measured.shape[1] // size * size

    def total(values: NDArray[np.float32]) -> NDArray[np.float64]:
        parts = [values[i:rows:size, j:columns:size] for i in range(size) for j in range(size)]
        sums: NDArray[np.float64] = np.sum(parts, axis=0, dtype=np.float64)
        return sums

    x, y, z = (np.where(measured, cloud[..., axis], np.float32(0)) for axis in range(3))
    count = total(measured.astype(np.float32))
    filled = count >= max(1.0, _CELL_MEASURED * size**2)
    each = np.maximum(count, 1)
    reach_m = total(np.sqrt(x * x + y * y)) / each
    steepness = total(z) / each / np.maximum(reach_m, 1e-3)
    turns = _quarter_turns(filled, steepness)
    return np.rot90(filled, turns), np.rot90(reach_m, turns)


def _quarter_turns(filled: NDArray[np.bool_], steepness: NDArray[np.float64]) -> int:
    """Counter-clockwise quarter turns that put an image upright: its steepest rays belong to the top."""
    row, column = np.nonzero(filled)
    if len(row) < 2:
        return 0
    steep = steepness[filled] - steepness[filled].mean()
    down = float((steep * (row - row.mean())).sum()) / max(1.0, float(row.var()))
    right = float((steep * (column - column.mean())).sum()) / max(1.0, float(column.var()))
    # The top of the scene is up, right, down or left in the image.
    return int(np.argmax((-down, right, down, -right)))


def _ray_cells(points: Points, share: float) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """The same cells, or a share of so many, of points (N, 3) without an image, between the outermost rays ahead."""
    rows, columns = round(_GRID_ROWS * share**0.5), round(_GRID_COLUMNS * share**0.5)
    ahead = points[points[:, 0] > 0].astype(np.float64)
    tangents = -ahead[:, 1:] / ahead[:, :1]  # (N, 2) right, down
    near = (np.abs(tangents) <= _WIDEST_TANGENT).all(axis=1)
    ahead, tangents = ahead[near], tangents[near]
    low, high = np.quantile(tangents, (0.005, 0.995), axis=0) if len(ahead) else (np.zeros(2), np.ones(2))
    shape = np.array((columns, rows))
    cell = np.clip((tangents - low) / np.maximum(high - low, 1e-6) * shape, 0, shape - 1).astype(np.int64)
    number = cell[:, 1] * columns + cell[:, 0]
    count = np.bincount(number, minlength=rows * columns)
    reach_m = np.bincount(number, np.hypot(ahead[:, 0], ahead[:, 1]), rows * columns)
    grid = (rows, columns)
    return (count > 0).reshape(grid), (reach_m / np.maximum(count, 1)).reshape(grid)

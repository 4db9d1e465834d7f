# SPDX-License-Identifier: Apache-2.0
"""Gate around every network and rule: too much missing in a cloud means no state, because a hole is no free way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import MIN_POINTS
from doorstate.errors import ConfigError
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.doorway_check import DoorwayCheck, DoorwayLimits, check_doorways
from doorstate.inference.holes import find_holes
from doorstate.inference.seen_through import Opening, seen_share
from doorstate.types import Points

_SHARES = (
    "min_measured_share",
    "max_behind_share",
    "hole_height_share",
    "max_hole_share",
    "margin_share",
    "max_outlier_share",
    "min_seen_share",
    "max_missing_share",
    "min_floor_share",
)
_MAX_MARGIN_SHARE = 0.4
_LARGE_IMAGE_ROWS = 240  # from here on every other row and column is enough
_STATISTICS_POINTS = 8192


@dataclass(frozen=True)
class Gate:
    """Reject clouds that do not show enough to tell a state; docs/gate.md has the measured figures.

    Args:
        min_points: least number of measured points; the largest neighbourhood of a network.
        min_measured_share: least share of all pixels or rows; chosen: half of the emptiest simulated frame's.
        max_behind_share: largest share of the measured points behind the camera; chosen: a camera sees none, a scan
            or a cloud in another frame half.
        min_median_range_m: half of the points must be farther; chosen: nearer than any simulated frame's median,
            and an arm's length.
        max_median_range_m: half of the points must be nearer; chosen: 1.5 times the largest of simulated and
            recorded frames with a door.
        min_extent_m: least extent of the middle nine tenths of the points, in height and across; chosen: half a door's
            width, which a floor or a hand alone does not have.
        min_view_deg: least angle across, between the outermost rays; chosen: half an image with a lens of 60 degrees
            shows 30, an upright one of such a lens 47.
        hole_height_share: least height of a hole, as a share of the image's; chosen: 0.5 m of a door 2 to 3 m away,
            more than a handle's glare or a shadow of stereo.
        free_reach_m: horizontal range that must be measured below a hole; chosen: 0.5 m behind the farthest doors
            that the packaged weights were trained on (3.5 m).
        max_hole_share: largest share of the columns with holes and no such floor; chosen: 0.25 m of a door 3 m away
            with a lens of 60 degrees.
        min_seen_share: after a network or rule: least share of the rays to the floor behind the opening of an open
            door that came back; chosen: nearly all simulated open doors have 0.98 or more.
        max_outlier_share: largest share of outliers among the measured points; chosen: recorded frames have up to
            0.063, simulated ones fewer.
        margin_share: columns ignored on each side; chosen: stereo and registered cameras measure nothing in up to a
            tenth.

        max_missing_share: of one doorway (`check_doorways`): largest share of its opening from which nothing came back;
            chosen: a tenth of the image may be lost on a door that fills a quarter of it.
        min_floor_share: of one doorway: least share of the rays to the floor behind an opening without a visible leaf
            that came back; chosen: none come back from dark leaves, and half may be lost.

    Raises:
        ConfigError: a share below 0 or above 1, or margins that leave no column.
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
    max_outlier_share: float = 0.1
    min_seen_share: float = 0.95
    max_missing_share: float = 0.4
    min_floor_share: float = 0.5

    def __post_init__(self) -> None:
        # A share out of range would switch its check off silently.
        for name in _SHARES:
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"not a share: {getattr(self, name)}", field=name, expected="0 to 1")
        if self.margin_share > _MAX_MARGIN_SHARE:
            raise ConfigError(
                f"margins of {self.margin_share} leave no columns",
                field="margin_share",
                expected=f"at most {_MAX_MARGIN_SHARE}",
            )

    def __call__(self, cloud: Points, outlier_share: float = 0.0) -> Abstention | None:
        """Return the reason why a cloud cannot be used, or None if it can.

        Args:
            cloud: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing
                was measured. Holes are searched in organized clouds and in flat ones.
            outlier_share: share of its measured points that was removed before (`clouds.outliers`).
        """
        checks = (
            self._enough_points,
            self._enough_measured,
            self._in_front_of_the_camera,
            self._near_enough_and_not_covered,
            self._large_enough,
            self._wide_enough,
            self._without_holes,
        )
        return self._first_reason(cloud, outlier_share, checks)

    def check_view(self, cloud: Points, outlier_share: float = 0.0) -> Abstention | None:
        """Return the reason why no doorway can be searched for in a cloud, or None if one can; arguments as for a call.

        Doorways are checked one by one (`check_doorways`), so that a hole beside them is no reason.
        """
        checks = (
            self._enough_points,
            self._in_front_of_the_camera,
            self._near_enough_and_not_covered,
        )
        return self._first_reason(cloud, outlier_share, checks)

    def check_doorways(self, cloud: Points, doors: Sequence[Door]) -> list[DoorwayCheck]:
        """Return what a level cloud shows of doors that a network has given states: a reason against each, or none.

        Args:
            cloud: as for a call, level.
            doors: doors in the frame of the cloud.
        """
        limits = DoorwayLimits(self.max_missing_share, self.min_floor_share, self.free_reach_m)
        return check_doorways(np.asarray(cloud), doors, limits)

    def check_opening(self, cloud: Points, opening: Opening) -> Abstention | None:
        """Return the reason why an opening that a network or rule calls open is none, or None if it may be one.

        Args:
            cloud: as for a call.
            opening: opening of the door.
        """
        view = _View.from_cloud(np.asarray(cloud))
        share = seen_share(view.cloud, view.measured, opening, self.free_reach_m)
        if share is None or share >= self.min_seen_share:
            return None
        return Abstention("opening_not_seen", {"share": share, "min_share": self.min_seen_share})

    def _first_reason(
        self, cloud: Points, outlier_share: float, checks: Sequence[Callable[[_View], Abstention | None]]
    ) -> Abstention | None:
        if outlier_share > self.max_outlier_share:
            values = {"share": outlier_share, "max_share": self.max_outlier_share}
            return Abstention("outliers", values)
        view = _View.from_cloud(np.asarray(cloud))
        return next((abstention for check in checks if (abstention := check(view))), None)

    def _enough_points(self, view: _View) -> Abstention | None:
        if view.num_points >= -(-self.min_points // view.pixels_per_reading):
            return None
        return Abstention("too_few_points", {"min_points": self.min_points})

    def _enough_measured(self, view: _View) -> Abstention | None:
        share = view.num_points / view.measured.size
        if share >= self.min_measured_share:
            return None
        return Abstention("low_coverage", {"share": share, "min_share": self.min_measured_share})

    def _in_front_of_the_camera(self, view: _View) -> Abstention | None:
        share = float((view.sample[:, 0] < 0).mean())
        if share <= self.max_behind_share:
            return None
        # In an optical frame all points are ahead along z, in that of OpenGL against z.
        above = float((view.sample[:, 2] > 0).mean())
        names = {"optical": above, "opengl": 1 - above}
        axes = next((name for name, ahead in names.items() if ahead > 1 - self.max_behind_share), None)
        suggestions = {} if axes is None else {"axes": axes}
        return Abstention("points_behind_camera", {"share": share}, suggestions=suggestions)

    def _near_enough_and_not_covered(self, view: _View) -> Abstention | None:
        median_m = float(np.median(np.linalg.norm(view.sample, axis=1)))
        if median_m < self.min_median_range_m:
            return Abstention("too_near", {"median_m": median_m})
        if median_m > self.max_median_range_m:
            return Abstention("too_far", {"median_m": median_m})
        return None

    def _large_enough(self, view: _View) -> Abstention | None:
        low, high = np.quantile(view.sample, (0.05, 0.95), axis=0)
        width_m, height_m = float((high - low)[:2].max()), float((high - low)[2])
        if min(width_m, height_m) >= self.min_extent_m:
            return None
        return Abstention("too_small", {"width_m": width_m, "height_m": height_m})

    def _wide_enough(self, view: _View) -> Abstention | None:
        view_deg = _view_deg(view.sample)
        if view_deg >= self.min_view_deg:
            return None
        return Abstention("narrow_view", {"view_deg": view_deg, "min_view_deg": self.min_view_deg})

    def _without_holes(self, view: _View) -> Abstention | None:
        holes = find_holes(
            view.cloud,
            view.measured,
            min_height_share=self.hole_height_share,
            free_reach_m=self.free_reach_m,
            margin_share=self.margin_share,
        )
        # A door seen along its wall is narrow in the view.
        if holes.door is not None:
            return Abstention("door_hole", {**holes.door._asdict(), "share": holes.share})
        if holes.share <= self.max_hole_share:
            return None
        return Abstention("hole", {"share": holes.share, "free_reach_m": self.free_reach_m})


DEFAULT_GATE = Gate()


@dataclass(frozen=True, eq=False)
class _View:
    """Cloud with the measured points that the checks share."""

    cloud: Points  # (N, 3) or (H, W, 3), of large images every other row and column
    measured: NDArray[np.bool_]  # (N,) or (H, W)
    pixels_per_reading: int

    @classmethod
    def from_cloud(cls, cloud: NDArray[Any]) -> _View:
        if cloud.ndim == 3 and cloud.shape[0] >= _LARGE_IMAGE_ROWS:
            cloud = np.ascontiguousarray(cloud[::2, ::2])
            return cls(cloud, is_measured(cloud), pixels_per_reading=4)
        return cls(cloud, is_measured(cloud), pixels_per_reading=1)

    @cached_property
    def num_points(self) -> int:
        """Number of measured points."""
        return int(np.count_nonzero(self.measured))

    @cached_property
    def sample(self) -> NDArray[np.float64]:
        """(K, 3) measured points, evenly picked, for statistics."""
        rows = np.flatnonzero(self.measured)[:: max(1, self.num_points // _STATISTICS_POINTS)]
        return self.cloud.reshape(-1, 3).take(rows, axis=0).astype(np.float64)


def _view_deg(points: NDArray[np.float64]) -> float:
    """Return the angle in plan view between the outermost hundredths of the rays ahead."""
    ahead = points[points[:, 0] > 0]
    if len(ahead) == 0:
        return 0.0
    right, left = np.quantile(np.arctan2(ahead[:, 1], ahead[:, 0]), (0.01, 0.99))
    return float(np.degrees(left - right))

# SPDX-License-Identifier: Apache-2.0
"""One frame to be labelled: level cloud, candidate doorways, and what the page shows of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import lowest_z_m
from doorstate.clouds.outliers import remove_outliers
from doorstate.clouds.stillness import Rays, coarse_rays
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.upright import find_upright_doorways
from doorstate.errors import DoorstateError, WriteParameter, python_parameter
from doorstate.inference.abstention import Abstention
from doorstate.inference.known import DoorHint, ImageBox
from doorstate.inference.known_doorways import hinted_doorways
from doorstate.io.sensor_pose import PosedCloud
from doorstate.pages.encoding import encode_cloud, picture_uri
from doorstate.types import Points
from doorstate.viewer.cloud_page import thin_for_display
from doorstate.viewer.depth_picture import colour_picture, relief_picture
from doorstate.viewer.picture_projection import fit_projection

_PICTURE_PX = (960, 960)
_SHOWN_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class LabelFrame:
    """Frame that was read and searched for doorways."""

    points: Points  # level, (N, 3) or (H, W, 3)
    floor_z_m: float
    rays: Rays  # of the points as measured
    rotation: NDArray[np.float64]  # R_level_sensor
    doorways: tuple[Doorway, ...]  # the likeliest first
    page: Mapping[str, Any]  # pictures, cloud and candidates, as JSON values

    def place(self, hint: DoorHint) -> Doorway:
        """Return the doorway at a place, or between the jambs at both sides of a box in the image.

        Raises:
            ConfigError: no such place, no image, or nothing was measured there.
        """
        return hinted_doorways([], hint, self.points, self.floor_z_m)[0]


def open_frame(
    cloud: PosedCloud, colour: Path | None = None, parameter: WriteParameter = python_parameter
) -> LabelFrame:
    """Level a cloud, find its doorways and encode it.

    Args:
        cloud: points, and the pose of their camera; a tilt that is only assumed is found.
        colour: image of the same view.
        parameter: how errors write parameters.
    """
    points, pose = cloud
    clean = remove_outliers(points).points
    level, doorways = find_upright_doorways(
        clean, is_level=pose.is_tilt_known, camera_height_m=pose.camera_height_m
    )
    shown = thin_for_display(level.points, _SHOWN_POINTS)
    floor_z_m = lowest_z_m(shown) if level.floor_z_m is None and len(shown) else level.floor_z_m or 0.0
    note = ""
    if level.refusal is not None:
        abstention = Abstention(
            level.refusal.code, level.refusal.values, suggestions={"pitch_deg": None, "roll_deg": None}
        )
        note = abstention.describe(parameter)
    page: dict[str, Any] = {
        "pictures": _pictures(points, colour),
        "projection": None,
        "cloud": encode_cloud(shown),
        "floor_z_m": round(floor_z_m, 3),
        "candidates": [encode_doorway(doorway) | {"score": round(doorway.score, 3)} for doorway in doorways],
        "note": note,
    }
    if points.ndim == 3 and (matrix := fit_projection(level.points)) is not None:
        page |= {"projection": matrix.reshape(-1).tolist(), "size": [points.shape[1], points.shape[0]]}
    return LabelFrame(level.points, floor_z_m, coarse_rays(points), level.rotation, tuple(doorways), page)


def encode_doorway(doorway: Doorway) -> dict[str, float]:
    """Return the place of a doorway as JSON values."""
    names = ("x_m", "y_m", "yaw_deg", "width_m", "floor_z_m")
    return {name: round(getattr(doorway, name), 4) for name in names}


def hint_of_box(left: float, top: float, right: float, bottom: float) -> DoorHint:
    """Return the hint of a box in pixels, in any order of its corners."""
    columns, rows = sorted((round(left), round(right))), sorted((round(top), round(bottom)))
    return DoorHint(box=ImageBox(columns[0], rows[0], columns[1], rows[1]))


def unreadable(error: DoorstateError, parameter: WriteParameter = python_parameter) -> dict[str, str]:
    """Return what the page shows of a frame that cannot be read."""
    return {"error": error.describe(parameter, with_path=False)}


def _pictures(points: Points, colour: Path | None) -> dict[str, str]:
    pictures = {}
    if points.ndim == 3:
        pictures["depth"] = picture_uri(relief_picture(points), _PICTURE_PX)
    if colour is not None and (pixels := colour_picture(colour)) is not None:
        pictures["colour"] = picture_uri(pixels, _PICTURE_PX)
    return pictures

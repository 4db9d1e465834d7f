# SPDX-License-Identifier: Apache-2.0
"""VIEWPOINT of PCD files: the pose of the sensor in the frame of the points."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from doorstate.errors import CameraError
from doorstate.io.rotations import Quaternion

_LINE = re.compile(rb"^[ \t]*VIEWPOINT[ \t]+([^\r\n#]*)", re.MULTILINE)
_DATA = re.compile(rb"^[ \t]*DATA\b", re.MULTILINE)
_MAX_HEADER_BYTES = 1 << 20


class Viewpoint(NamedTuple):
    """Pose of a sensor in the frame of its points."""

    position: tuple[float, float, float]  # in the unit of the points
    quaternion: Quaternion  # x, y, z, w: R_points_sensor


def parse_viewpoint(data: bytes) -> Viewpoint | None:
    """Return the viewpoint of a PCD file; None if the header has none, the identity, or zeros only.

    Source: PCL, "The PCD file format": VIEWPOINT is tx ty tz qw qx qy qz, identity by default.

    Raises:
        CameraError: it is not seven finite numbers.
    """
    header = data[:_MAX_HEADER_BYTES]
    if end := _DATA.search(header):
        header = header[: end.start()]
    if (line := _LINE.search(header)) is None:
        return None
    try:
        x, y, z, qw, qx, qy, qz = (float(word) for word in line[1].split())
    except ValueError:
        x = math.nan
    if not math.isfinite(x) or not all(map(math.isfinite, (y, z, qw, qx, qy, qz))):
        raise CameraError(
            "VIEWPOINT is not seven numbers: tx ty tz qw qx qy qz", suggestions={"ignore_viewpoint": True}
        )
    # Zeros only: written by tools that do not know the pose.
    if (x, y, z) == (0, 0, 0) and (qx, qy, qz) == (0, 0, 0):
        return None
    return Viewpoint((x, y, z), (qx, qy, qz, qw))

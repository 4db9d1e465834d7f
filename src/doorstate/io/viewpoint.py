# SPDX-License-Identifier: Apache-2.0
"""VIEWPOINT of PCD files: the pose of the sensor in the frame of the points."""

from __future__ import annotations

from typing import NamedTuple

from doorstate.io.pcd_header import IDENTITY, read_pcd_header
from doorstate.io.rotations import Quaternion


class Viewpoint(NamedTuple):
    """Pose of a sensor in the frame of its points."""

    position: tuple[float, float, float]  # in the unit of the points
    quaternion: Quaternion  # x, y, z, w: R_points_sensor


def read_viewpoint(data: bytes) -> Viewpoint | None:
    """Return the viewpoint of a PCD file; None if it is the identity or zeros only, as tools without a pose write.

    Source: PCL, "The PCD file format": VIEWPOINT is the acquisition viewpoint of the points, a translation and a
    quaternion, by default the identity.

    Raises:
        CloudReadError: as in `read_pcd_header`.
    """
    pose = read_pcd_header(data).viewpoint
    if pose == IDENTITY or not any(pose):
        return None
    x, y, z, qw, qx, qy, qz = pose
    return Viewpoint((x, y, z), (qx, qy, qz, qw))

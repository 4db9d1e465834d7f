# SPDX-License-Identifier: Apache-2.0
"""What the manifest knows of a door, in the units and axes that a network sees; NaN where it does not know.

The same answers as `networks.heads`: whether there is a door, its opening angle, hinge side, frame pose and widths, and
the parts of the points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.clouds.preparation import SCALE_M
from doorstate.simulation.manifest import numbers
from doorstate.types import DOOR, NO_DOOR, Part, Points

Targets = dict[str, NDArray[np.float32]]
"""By answer: "door" (M, 1) 1 or 0, "angle" (M, 1) radians, "hinge" (M, 1) 1 left and 0 right, "frame" (M, 3), "widths"
(M, 2)."""

IGNORE_INDEX = -100  # label of a sample without a door: torch's cross entropy passes it over
_HINGE = {"left": 1.0, "right": 0.0}


def door_targets(rows: Sequence[Mapping[str, str]], centroids: Points) -> Targets:
    """Targets of samples whose clouds were centred and divided by 3 m.

    A frame's yaw is that of its outward normal, which points to the robot's side of the wall.

    Args:
        rows: M of the manifest.
        centroids: (M, 3) metres, which the clouds were centred on.
    """
    angle = np.radians(numbers(rows, "opening_angle_deg"))
    hinge = [_HINGE.get(row.get("hinge") or row.get("door.hinge", ""), math.nan) for row in rows]
    normal = np.radians(numbers(rows, "door_yaw_deg") + 90)
    place = np.stack([numbers(rows, name) for name in ("door_x_m", "door_y_m")], axis=1) - centroids[:, :2]
    widths = np.stack(
        [
            numbers(rows, "opening_width_m", "door.opening_width_m"),
            numbers(rows, "passable_width_m"),
        ],
        axis=1,
    )
    found = {
        DOOR: np.array([[float(row["state"] != NO_DOOR)] for row in rows]),
        "angle": angle[:, None],
        "hinge": np.array(hinge)[:, None],
        "frame": np.column_stack([place / SCALE_M, np.arctan2(np.sin(normal), np.cos(normal))]),
        "widths": widths / SCALE_M,
    }
    return {name: values.astype(np.float32) for name, values in found.items()}


def known_parts(parts: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Parts of points as a network's targets: -1 where nobody knows."""
    return np.where(parts == Part.NONE, -1, parts.astype(np.int64))


def augmented(targets: Targets, draw: AugmentationDraw | None) -> Targets:
    """Targets of clouds that were changed by a draw: turned, mirrored, scaled and moved with them.

    Args:
        targets: all or some, of B clouds.
        draw: of the same clouds; None changes nothing.
    """
    if draw is None or not targets:
        return targets
    # A tilt of a few degrees moves a door by less than its leaf.
    plan = draw.linear[:, :2, :2].astype(np.float64)
    determinant = np.linalg.det(plan)
    scale = np.sqrt(np.abs(determinant))[:, None]
    changed = dict(targets)
    if "hinge" in targets:
        changed["hinge"] = np.where(determinant[:, None] < 0, 1 - targets["hinge"], targets["hinge"])
    if "widths" in targets:
        changed["widths"] = targets["widths"] * scale
    if "frame" in targets:
        frame = targets["frame"]
        normal = np.stack([np.cos(frame[:, 2]), np.sin(frame[:, 2])], axis=1)
        place, normal = ((plan @ vector[:, :, None])[:, :, 0] for vector in (frame[:, :2], normal))
        yaw = np.arctan2(normal[:, 1], normal[:, 0])
        changed["frame"] = np.column_stack([place + draw.shift[:, 0, :2], yaw])
    return {name: values.astype(np.float32) for name, values in changed.items()}

# SPDX-License-Identifier: Apache-2.0
"""Scenes with known geometry, without the simulator: upright rectangles and a floor before a pinhole camera."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Rectangle = tuple[
    tuple[float, float], tuple[float, float], float, float
]  # from, to in plan view; lowest, highest


def see(rectangles: list[Rectangle], floor_m: float = -1.0, farthest_m: float = 5.0) -> NDArray[np.float32]:
    """(240, 320, 3) metres, camera at the origin, 60 degrees wide, NaN where nothing is nearer than the farthest."""
    height, width = 240, 320
    focal = width / 2 / math.tan(math.radians(30))
    rows, columns = np.mgrid[0:height, 0:width]
    rays = np.stack(
        [np.ones((height, width)), (width / 2 - columns) / focal, (height / 2 - rows) / focal], axis=-1
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.where(rays[..., 2] < 0, floor_m / rays[..., 2], np.inf)
        for start, end, low, high in rectangles:
            (ax, ay), (dx, dy) = start, np.subtract(end, start)
            # x (1, ray) = start + share (d): the ray meets the line in plan view.
            x_hit = (ax * dy - ay * dx) / (dy - rays[..., 1] * dx)
            share = ((x_hit - ax) * dx + (x_hit * rays[..., 1] - ay) * dy) / (dx * dx + dy * dy)
            z = x_hit * rays[..., 2]
            hit = (x_hit > 0) & (share >= 0) & (share <= 1) & (z >= low) & (z <= high)
            x = np.where(hit, np.minimum(x, x_hit), x)
        return np.where((x < farthest_m)[..., None], rays * x[..., None], np.nan).astype(np.float32)


def door(
    angle_deg: float,
    *,
    wall_deg: float = 0.0,
    distance_m: float = 2.5,
    hinge: str = "left",
    away: bool = False,
) -> list[Rectangle]:
    """A wall with a door 0.9 m wide and 2.1 m high whose middle is ahead; its leaf stands at an angle.

    Args:
        angle_deg: of the leaf, 0 is closed.
        wall_deg: how far the wall is turned about the door's middle; 0 is square to the view.
        distance_m: to the door's middle.
        hinge: side of the hinge as the camera sees it.
        away: the leaf swings away from the camera.
    """
    turn = math.radians(wall_deg)
    along = np.array([-math.sin(turn), math.cos(turn)])  # to the left
    front = np.array([-math.cos(turn), -math.sin(turn)])  # to the camera
    middle = np.array([distance_m, 0.0])
    side = 1.0 if hinge == "left" else -1.0
    at = middle + side * 0.45 * along
    swing = math.radians(angle_deg)
    tip = at + 0.89 * (-side * along * math.cos(swing) + (-front if away else front) * math.sin(swing))

    def place(metres: float) -> tuple[float, float]:
        x, y = middle + metres * along
        return float(x), float(y)

    return [
        (place(-4), place(-0.45), -1.0, 1.6),
        (place(0.45), place(4), -1.0, 1.6),
        (place(-0.45), place(0.45), 1.1, 1.6),
        ((float(at[0]), float(at[1])), (float(tip[0]), float(tip[1])), -0.99, 1.09),
    ]


def edge_on_deg(
    angle_deg: float, wall_deg: float = 0.0, distance_m: float = 2.5, hinge: str = "left"
) -> float:
    """Angle between the leaf of such a door that swings towards the camera, and the sight line to its middle."""
    (ax, ay), (bx, by), *_ = door(angle_deg, wall_deg=wall_deg, distance_m=distance_m, hinge=hinge)[-1]
    turned = math.degrees(math.atan2(by - ay, bx - ax) - math.atan2(ay + by, ax + bx)) % 180
    return min(turned, 180 - turned)

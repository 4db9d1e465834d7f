# SPDX-License-Identifier: Apache-2.0
"""Upright capsules: limbs of people, and round columns."""

from __future__ import annotations

from doorstate.simulation.scene.box import Box, Material
from doorstate.types import Part


class Capsule(Box):
    """A capsule that fills its box: an upright cylinder with a half-sphere at each end.

    The box has the same width along x and y, and is at least as high. Code that knows boxes alone sees its box, so
    collisions are those of the box.
    """

    __slots__ = ()


def capsule(
    part: Part,
    x_m: float,
    y_m: float,
    ends_m: tuple[float, float],
    radius_m: float,
    material: Material = "matte",
) -> Capsule:
    """Return a capsule between two heights.

    Raises:
        ValueError: it is lower than wide.
    """
    low, high = ends_m
    if not 0 < 2 * radius_m <= high - low:
        raise ValueError(f"a capsule {high - low} m high has a radius of up to half of that, not {radius_m}")
    return Capsule(
        part, (x_m, y_m, (low + high) / 2), (2 * radius_m, 2 * radius_m, high - low), 0.0, material
    )

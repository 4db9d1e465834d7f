# SPDX-License-Identifier: Apache-2.0
"""Augmentation of a batch of clouds that keeps the door's state; drawn first and then applied, so it can be replayed.

Scale is the same along x and y: stretching one against the other would change the opening angle, which is the label
(tan a' = s_y / s_x tan a).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel, Ordered
from doorstate.types import Points

_Scale = Annotated[float, Field(ge=0.01, le=100)]
_Range = Annotated[tuple[_Scale, _Scale], Ordered]


class Augmentation(FrozenModel):
    """Ranges of random changes; the defaults change nothing. Lengths are in units of the normalised cloud."""

    yaw_deg: float = Field(default=0.0, ge=0, le=180)  # rotated about z by U(-yaw, yaw)
    mirror: float = Field(default=0.0, ge=0, le=1)  # probability of left and right exchanged
    scale: _Range = (1.0, 1.0)  # x, y and z alike, unless scale_z is set
    scale_z: _Range | None = None
    shift: float = Field(default=0.0, ge=0, le=100)  # per axis U(-shift, shift)
    tilt_deg: float = Field(default=0.0, ge=0, le=60)  # about x and y N(0, tilt), cut at 3 sigma
    jitter: float = Field(default=0.0, ge=0, le=100)  # per coordinate N(0, jitter)
    jitter_clip: float = Field(default=0.05, ge=0, le=100)

    @property
    def is_similarity(self) -> bool:
        """True if all distances of a cloud stay in proportion, so that nearest neighbours stay nearest."""
        return self.jitter == 0 and self.scale_z is None

    @property
    def is_rigid(self) -> bool:
        """True if all distances of a cloud stay the same."""
        return self.is_similarity and self.scale == (1.0, 1.0)


class AugmentationDraw(NamedTuple):
    """Random changes drawn for a batch of B clouds of N points."""

    linear: NDArray[np.float32]  # (B, 3, 3), applied to column vectors
    shift: NDArray[np.float32]  # (B, 1, 3)
    jitter: NDArray[np.float32] | None  # (B, N, 3)

    def part(self, clouds: slice) -> AugmentationDraw:
        """Return the changes of some of the clouds."""
        jitter = None if self.jitter is None else self.jitter[clouds]
        return AugmentationDraw(self.linear[clouds], self.shift[clouds], jitter)


def draw_augmentation(
    augmentation: Augmentation, rng: np.random.Generator, clouds: int, points: int, across: int = 1
) -> AugmentationDraw:
    """Draw the changes of one batch.

    Args:
        augmentation: ranges of the changes.
        rng: random generator.
        clouds: B, number of clouds.
        points: N, points of each cloud.
        across: axis that points left, 0 or 1, which a mirrored cloud is reversed along.
    """
    yaw = rng.uniform(-1, 1, clouds) * math.radians(augmentation.yaw_deg)
    tilt_sigma = math.radians(augmentation.tilt_deg)
    tilt = np.clip(rng.normal(0, 1, (clouds, 2)), -3, 3) * tilt_sigma
    scale = rng.uniform(*augmentation.scale, clouds)
    scale_z = scale if augmentation.scale_z is None else rng.uniform(*augmentation.scale_z, clouds)
    mirror = np.where(rng.random(clouds) < augmentation.mirror, -1.0, 1.0)
    stretch = np.zeros((clouds, 3, 3))
    stretch[:, 0, 0], stretch[:, 1, 1], stretch[:, 2, 2] = scale, scale, scale_z
    stretch[:, across, across] *= mirror
    linear = _rotation(yaw, 2) @ _rotation(tilt[:, 0], 0) @ _rotation(tilt[:, 1], 1) @ stretch
    shift = rng.uniform(-1, 1, (clouds, 1, 3)) * augmentation.shift
    jitter = None
    if augmentation.jitter:
        noise = rng.standard_normal((clouds, points, 3), dtype=np.float32) * np.float32(augmentation.jitter)
        jitter = np.clip(noise, -augmentation.jitter_clip, augmentation.jitter_clip)
    return AugmentationDraw(linear.astype(np.float32), shift.astype(np.float32), jitter)


def apply_augmentation(points: Points, draw: AugmentationDraw) -> Points:
    """Apply drawn changes to (B, N, 3) points."""
    changed = points @ draw.linear.transpose(0, 2, 1) + draw.shift
    return changed if draw.jitter is None else changed + draw.jitter


def _rotation(angle_rad: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Return right-handed rotations (B, 3, 3) about x, y or z."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.zeros((len(angle_rad), 3, 3))
    rotation[:, axis, axis] = 1.0
    rotation[:, first, first] = rotation[:, second, second] = np.cos(angle_rad)
    rotation[:, second, first] = np.sin(angle_rad)
    rotation[:, first, second] = -np.sin(angle_rad)
    return rotation

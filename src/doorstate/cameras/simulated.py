# SPDX-License-Identifier: Apache-2.0
"""Simulated camera, to try everything without one: it drives towards a door in a corridor, which opens, and back.

It behaves as a camera does: images come in real time, those that nobody takes are lost, and the one with a loose cable
is gone for some seconds of each round. It tells its tilt by an accelerometer without errors.
"""

from __future__ import annotations

import math
import time
from functools import cached_property

import numpy as np

from doorstate.cameras.clock import steady_s
from doorstate.cameras.device import (
    AttachedCamera,
    CameraRequest,
    DepthCameraDevice,
    DepthFrame,
    Vector,
    no_recordings,
    not_attached,
)
from doorstate.errors import CameraGoneError
from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row

ROUND_S = 24.0
DRIVE, LOOSE_CABLE = "drive", "loose-cable"
_SEED, _POSE = 5, 3  # a single door and an open one beside it, in a corridor
_FPS = 10
_UNIT_M = 0.001
_UNPLUGGED_S = (6.0, 10.0)  # of each round, with the loose cable
_OPEN_DEG = 95.0
_START_M, _START_TURN_DEG = -1.2, -8.0  # before and beside the nearest point of the drive


class SimulatedCamera(DepthCameraDevice):
    """Two cameras on the same drive; one has a loose cable."""

    kind = "simulated"

    def __init__(self) -> None:
        self._serial = DRIVE
        self._fps = _FPS
        self._camera = DepthCamera()
        self._started_s: float | None = None  # of the first image; the drive goes on while the camera is gone
        self._number = -1

    @cached_property
    def _row(self) -> Row:
        return draw_rows(PRESETS["corridor"], _SEED, _POSE)[-1]

    def list_attached(self) -> list[AttachedCamera]:
        """Return both cameras."""
        return [
            AttachedCamera(self.kind, DRIVE, "a drive past a door"),
            AttachedCamera(self.kind, LOOSE_CABLE, "the same, with a loose cable"),
        ]

    def open(self, request: CameraRequest) -> str:
        """Start the drive, or go on with it."""
        if request.recording is not None:
            raise no_recordings(self.kind)
        if request.serial not in ("", DRIVE, LOOSE_CABLE):
            raise not_attached(self.kind, request.serial)
        self._serial, self._fps = request.serial or DRIVE, request.fps or _FPS
        if request.size is not None:
            self._camera = DepthCamera(width=request.size[0], height=request.size[1])
        if self._started_s is None:
            self._started_s = steady_s()
        self._check_cable()
        return f"simulated camera {self._serial}"

    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the image of now, or None."""
        self._check_cable()
        number = max(self._number + 1, math.floor(self._elapsed_s() * self._fps + 1e-6))
        wait_s = number / self._fps - self._elapsed_s()
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(0.0, wait_s))
        self._number = number
        row = row_at(self._row, number / self._fps).model_copy(update={"camera": self._camera})
        now_s = steady_s()
        depth_m = replay(row).cut.depth_m
        depth = np.nan_to_num(np.rint(depth_m / _UNIT_M), nan=0.0).astype(np.uint16)
        return DepthFrame(depth, _UNIT_M, self._intrinsics, now_s, number, _up(row))

    def close(self) -> None:
        """Do nothing: the drive goes on."""

    @property
    def _intrinsics(self) -> Intrinsics:
        return self._camera.intrinsics()

    def _elapsed_s(self) -> float:
        return 0.0 if self._started_s is None else steady_s() - self._started_s

    def _check_cable(self) -> None:
        start_s, end_s = _UNPLUGGED_S
        if self._serial == LOOSE_CABLE and start_s <= self._elapsed_s() % ROUND_S < end_s:
            raise CameraGoneError("unplugged")


def row_at(row: Row, time_s: float) -> Row:
    """Return the sample at a time of the drive.

    Args:
        row: sample at its nearest point.
        time_s: since the start.
    """
    third = ROUND_S / 3  # forth; the door opens and closes; back
    phase_s = time_s % ROUND_S
    away = _ease(1 - phase_s / third) if phase_s < 2 * third else _ease(phase_s / third - 2)
    opening = _ease((phase_s - third) / 3) - _ease((phase_s - 2 * third + 2) / 2)
    heading_rad = math.radians(row.heading_deg)
    return row.model_copy(
        update={
            "x_m": row.x_m + _START_M * away * math.cos(heading_rad),
            "y_m": row.y_m + _START_M * away * math.sin(heading_rad),
            "heading_deg": row.heading_deg + _START_TURN_DEG * away,
            "opening_angle_deg": _OPEN_DEG * opening,
        }
    )


def _ease(share: float) -> float:
    """Return a share from 0 to 1 that starts and stops gently."""
    return (1 - math.cos(math.pi * min(1.0, max(0.0, share)))) / 2


def _up(row: Row) -> Vector:
    """Return the direction upwards in the optical frame (`io.rotations.tilt_matrix`)."""
    pitch, roll = math.radians(row.pitch_deg), math.radians(row.roll_deg)
    return -math.cos(pitch) * math.sin(roll), -math.cos(pitch) * math.cos(roll), -math.sin(pitch)

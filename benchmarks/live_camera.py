# SPDX-License-Identifier: Apache-2.0
"""Memory of a long watch by a live camera, whose time passes as fast as its images can be taken."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.store import Result
from doorstate._jobs import Progress
from doorstate.cameras.clock import DayTime
from doorstate.cameras.device import AttachedCamera, CameraRequest, DepthCameraDevice, DepthFrame
from doorstate.cameras.grabber import FrameGrabber
from doorstate.cameras.watcher import CameraWatch
from doorstate.errors import CameraGoneError
from doorstate.evaluation.table import Table
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.watch_settings import parse_settings
from doorstate.io.camera import Intrinsics
from doorstate.types import DoorState, Points

_ROWS = 8
_TURN = 20  # images for which the watch may get one answer
_CAMERA = Intrinsics(32, 24, 28.0, 28.0, 15.5, 11.5)
_NOTE = (
    "A camera of 32 x 24 pixels whose clock goes forward by one image with each that is taken; it is unplugged once an "
    "hour. *Answered* are those that the watch was in time for, by a predictor that does nothing; the others are "
    "dropped. *Resident* is the memory of the process."
)


class LongWatch(NamedTuple):
    """Length of the measurement."""

    hours: float
    fps: int


class _FastCamera(DepthCameraDevice):
    """Camera that takes an image whenever it is asked, and is its own clock."""

    kind = "fast"

    def __init__(self, plan: LongWatch) -> None:
        self._fps, self.images = plan.fps, 0
        self._depth = np.full((_CAMERA.height, _CAMERA.width), 2000, np.uint16)

    def now_s(self) -> float:
        return self.images / self._fps

    def list_attached(self) -> list[AttachedCamera]:
        return []

    def open(self, request: CameraRequest) -> str:
        return "fast"

    def read(self, timeout_s: float) -> DepthFrame | None:
        self.images += 1
        if self.images % _TURN == 0:
            time.sleep(0.001)  # the watch gets its turn
        if self.images % (3600 * self._fps) == 0:
            raise CameraGoneError("unplugged")
        return DepthFrame(self._depth.copy(), 0.001, _CAMERA, self.now_s(), self.images, (0.0, -1.0, 0.0))

    def close(self) -> None:
        return


class _Nothing(Predictor):
    """Predictor that calls every door closed."""

    gate = None
    removes_outliers = False
    name = "nothing"

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        return [Prediction(DoorState.CLOSED, 1, 0.0) for _ in clouds]


def measure_live_camera(plan: LongWatch, progress: Progress) -> list[Result]:
    """Return one row for each eighth of the time.

    Args:
        plan: length.
        progress: called with images so far and all images.
    """
    camera = _FastCamera(plan)
    total = round(plan.hours * 3600 * plan.fps)
    day_time = DayTime(camera.now_s, camera.now_s)
    watch = CameraWatch(parse_settings({}), _Nothing(), steady=camera.now_s, day_time=day_time)
    rows: list[Result] = []
    answered = 0
    with FrameGrabber(camera, retry_s=0.01) as grabber:
        for report in watch.follow(grabber):
            answered += report.frame is not None
            if camera.images < total * (len(rows) + 1) / _ROWS:
                continue
            counts = grabber.counts
            rows.append(
                {
                    "hours": round(camera.now_s() / 3600, 2),
                    "grabbed": counts.grabbed,
                    "answered": answered,
                    "losses": counts.losses,
                    "resident_mib": round(_resident_mib(), 1),
                }
            )
            progress(min(camera.images, total), total)
            if len(rows) == _ROWS:
                return rows
    return rows


def live_camera_table(rows: Sequence[Result]) -> Table:
    """Return the table of the rows."""
    cells = [
        (f"{row['hours']:g}", *(f"{row[name]}" for name in ("grabbed", "answered", "losses", "resident_mib")))
        for row in rows
    ]
    columns = ("hours", "images", "answered", "unplugged", "resident (MiB)")
    return Table("Memory of a long watch", columns, tuple(cells), _NOTE)


def _resident_mib() -> float:
    """Return the memory of this process now (Linux)."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    kib = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS:"))
    return int(kib) / 1024

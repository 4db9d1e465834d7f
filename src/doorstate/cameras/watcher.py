# SPDX-License-Identifier: Apache-2.0
"""Watch over a door by the frames of an attached camera.

States follow from the steady clock alone, so that a machine whose clock is set neither forgets nor repeats one. A
camera that is gone, silent or late is reported as unknown, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from doorstate.cameras.clock import DayTime, steady_s
from doorstate.cameras.device import DepthFrame
from doorstate.cameras.grabber import Counts, Ended, FrameGrabber, Gone, Opened
from doorstate.cameras.gravity import tilt_of
from doorstate.doors.tracker import TrackedFrame
from doorstate.errors import CameraError
from doorstate.inference.abstention import Abstention
from doorstate.inference.door_report import DoorReport
from doorstate.inference.predictor import Predictor
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings
from doorstate.io.body_frame import points_from_depth
from doorstate.io.sensor_pose import PosedCloud
from doorstate.types import Points

FRAME_ID = "camera_depth_optical_frame"
MAX_AGE_S = 3.0  # of an image when it is answered; a machine that slept has older ones
_WAIT_S = 0.1  # Ctrl-C is noticed within this time

NoticeCode = Literal["camera_opened", "camera_gone", "clock_jumped", "tilt_not_used"]


@dataclass(frozen=True)
class Notice:
    """Something that happened besides an answer."""

    code: NoticeCode
    text: str


@dataclass(frozen=True, eq=False)
class CameraReport:
    """Answer to a frame, or to its absence.

    Attributes:
        door: state over time, doors of this frame, and the reason where there is none.
        frame: the frame; None where none came.
        points: (H, W, 3) its points in the body frame; None without a frame or where they cannot be computed.
        latency_s: from the image to the answer.
        counts: frames so far.
        notices: what happened since the last report.
        named: doors of a list; None without one.
    """

    door: DoorReport
    frame: DepthFrame | None
    points: Points | None
    latency_s: float
    counts: Counts
    notices: tuple[Notice, ...] = ()
    named: TrackedFrame | None = None


class CameraWatch:
    """Answers to the frames of one camera. Not for several threads.

    Args:
        settings: tilt and height of the camera, and when the way is free; its input is not used.
        predictor: network or rule; None loads the one that the settings name.
        accelerometer: take the tilt from the camera's accelerometer, where it has one and the settings give none.
        steady: seconds of a clock that never jumps.
        day_time: time of day of the reports.

    Raises:
        DoorstateError: as in `DoorWatch`.
    """

    def __init__(
        self,
        settings: WatchSettings,
        predictor: Predictor | None = None,
        *,
        accelerometer: bool = True,
        steady: Callable[[], float] = steady_s,
        day_time: DayTime | None = None,
    ) -> None:
        self.day_time = day_time or DayTime()
        self._watch = DoorWatch(settings, predictor)
        self._options = settings.read_options()
        self._silence_s = settings.silence_s
        self._accelerometer = accelerometer and not self._options.pose(is_depth=True).is_tilt_known
        self._steady = steady
        self._notices: list[Notice] = []
        self._gone_because = ""  # of a camera that is gone
        self._told_tilt = False
        self._last_s = -math.inf

    @property
    def predictor_name(self) -> str:
        """Description of the network or rule."""
        return self._watch.predictor_name

    def follow(self, grabber: FrameGrabber) -> Iterator[CameraReport]:
        """Yield a report for each frame that is answered, and one a `silence_s` while none comes, until the end."""
        last_s = self._steady()
        while True:
            event = grabber.wait(_WAIT_S)
            now_s = self._steady()
            counts = replace(grabber.counts)
            if isinstance(event, Ended):
                return
            if isinstance(event, DepthFrame):
                yield self.answer(event, counts)
                last_s = self._steady()
            elif isinstance(event, Gone):
                yield self.report_gone(event.reason, counts)
                last_s = self._steady()
            elif isinstance(event, Opened):
                self._opened(event.name)
            elif now_s - last_s >= self._silence_s:
                yield self.report_gone(self._gone_because or f"no frame for {now_s - last_s:.1f} s", counts)
                last_s = self._steady()

    def answer(self, frame: DepthFrame, counts: Counts) -> CameraReport:
        """Return the report after a frame; one that is too old when it is answered is unknown."""
        self._check_clock()
        self._gone_because = ""
        # The times that cameras tell tremble; the filter forgets all when one goes back.
        self._last_s = max(self._last_s, frame.captured_s)
        seen: list[Points] = []

        def read() -> PosedCloud:
            cloud = self._cloud(frame)
            seen.append(cloud.points)
            return cloud

        stamp_ns = self.day_time.stamp_ns(frame.captured_s)
        door = None
        if self._steady() - frame.captured_s <= MAX_AGE_S:
            door = self._watch.report(read, stamp_ns, FRAME_ID, self._last_s)
        latency_s = self._steady() - frame.captured_s
        if door is None or latency_s > MAX_AGE_S:
            abstention = Abstention("stale_frame", {"age_s": latency_s, "max_age_s": MAX_AGE_S})
            door = self._watch.report_silence(stamp_ns, abstention)
        return CameraReport(door, frame, seen[0] if seen else None, latency_s, counts, self._take_notices())

    def report_gone(self, reason: str, counts: Counts) -> CameraReport:
        """Return the report of a camera that sends nothing: unknown; its earlier frames are forgotten."""
        self._check_clock()
        if not self._gone_because:
            self._notices.append(Notice("camera_gone", reason))
        self._gone_because = reason
        now_ns = self.day_time.stamp_ns(self._steady())
        door = self._watch.report_silence(now_ns, Abstention("camera_gone", {"cause": reason}))
        return CameraReport(door, None, None, 0.0, counts, self._take_notices())

    def _opened(self, name: str) -> None:
        self._gone_because = ""
        self._notices.append(Notice("camera_opened", name))

    def _cloud(self, frame: DepthFrame) -> PosedCloud:
        is_float = np.issubdtype(frame.depth.dtype, np.floating)
        options = replace(
            self._options,
            intrinsics=frame.intrinsics,
            depth_scale_m=0.001 if is_float else frame.depth_scale_m,
            units_m=frame.depth_scale_m if is_float else 1.0,
        )
        tilt = self._tilt(frame)
        if tilt is None:
            return points_from_depth(frame.depth, options)
        cloud = points_from_depth(frame.depth, replace(options, roll_deg=tilt[0], pitch_deg=tilt[1]))
        return PosedCloud(cloud.points, replace(cloud.pose, tilt_from="accelerometer"))

    def _tilt(self, frame: DepthFrame) -> tuple[float, float] | None:
        """Return roll and pitch by the accelerometer; None leaves them to be found in the cloud."""
        if not self._accelerometer or frame.up is None:
            return None
        try:
            return tilt_of(frame.up)
        except CameraError as error:
            if not self._told_tilt:
                self._notices.append(Notice("tilt_not_used", str(error)))
                self._told_tilt = True
            return None

    def _check_clock(self) -> None:
        if jump_s := self.day_time.jump_s():
            self._notices.append(Notice("clock_jumped", f"{jump_s:+.1f} s"))

    def _take_notices(self) -> tuple[Notice, ...]:
        notices, self._notices = tuple(self._notices), []
        return notices

# SPDX-License-Identifier: Apache-2.0
"""Frames of a camera, read in a thread: the newest one is kept, and a camera that is gone is opened again."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from doorstate.cameras.clock import steady_s
from doorstate.cameras.device import CameraRequest, DepthCameraDevice, DepthFrame
from doorstate.errors import CameraError

_READ_S = 0.2  # a thread that is told to stop does so within this time


@dataclass(frozen=True)
class Opened:
    """The camera delivers from now on."""

    name: str


@dataclass(frozen=True)
class Gone:
    """The camera is gone, and is looked for."""

    reason: str


@dataclass(frozen=True)
class Ended:
    """No frame will come any more: the recording has ended."""


Event = Opened | Gone | Ended


@dataclass
class Counts:
    """Frames so far."""

    grabbed: int = 0
    dropped: int = 0  # replaced by a newer one before somebody took it
    repeated: int = 0  # sent again by the camera, and left out
    losses: int = 0  # of the camera


class FrameGrabber:
    """Reader of a camera, as a context manager.

    Args:
        device: camera; the grabber opens and closes it.
        request: what to open.
        on_frame: called with each frame in the thread, such as to record it; its errors are raised by `wait`.
        silence_s: time without a frame after which the camera is closed and opened again.
        retry_s: time between two attempts to open it.

    Raises:
        CameraError: the camera cannot be opened at the start.
    """

    def __init__(
        self,
        device: DepthCameraDevice,
        request: CameraRequest = CameraRequest(),  # noqa: B008 (frozen)
        *,
        on_frame: Callable[[DepthFrame], None] | None = None,
        silence_s: float = 5.0,
        retry_s: float = 1.0,
    ) -> None:
        self.counts = Counts()
        self._device, self._request, self._on_frame = device, request, on_frame
        self._silence_s, self._retry_s = silence_s, retry_s
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        self._events: deque[Event] = deque()
        self._frame: DepthFrame | None = None
        self._failure: BaseException | None = None
        # A daemon: the software of a vendor that hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def __enter__(self) -> Self:
        try:
            self._events.append(Opened(self._device.open(self._request)))
        except BaseException:
            self._device.close()  # it may have been opened in part
            raise
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopped.set()
        self._thread.join(timeout=5.0)

    def wait(self, timeout_s: float) -> Event | DepthFrame | None:
        """Return the next event, else the newest frame, else None if nothing comes in time.

        Raises:
            BaseException: what `on_frame` raised.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._events or self._frame or self._failure, timeout_s)
            if self._failure is not None:
                raise self._failure
            is_last = bool(self._events) and isinstance(self._events[0], Ended)
            if self._events and not (is_last and self._frame):
                return self._events.popleft()
            frame, self._frame = self._frame, None
            return frame

    def _run(self) -> None:
        try:
            while True:
                reason = self._read_until_gone()
                self._device.close()
                if self._stopped.is_set():
                    return
                if self._request.recording is not None:
                    self._publish(Ended())
                    return
                self.counts.losses += 1
                self._publish(Gone(reason))
                if not self._reopen():
                    return
        except BaseException as error:
            self._device.close()
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _read_until_gone(self) -> str:
        """Read until the camera is gone, and return the reason; "" when told to stop."""
        last_s, last_number = steady_s(), None
        while not self._stopped.is_set():
            try:
                frame = self._device.read(_READ_S)
            except CameraError as error:
                return error.message
            if frame is not None and frame.number == last_number:
                self.counts.repeated += 1
            elif frame is not None:
                last_s, last_number = steady_s(), frame.number
                self._put(frame)
            if steady_s() - last_s > self._silence_s:
                return f"no frame for {self._silence_s:g} s"
        return ""

    def _put(self, frame: DepthFrame) -> None:
        if self._on_frame is not None:
            self._on_frame(frame)
        with self._changed:
            self.counts.grabbed += 1
            self.counts.dropped += self._frame is not None
            self._frame = frame
            self._changed.notify_all()

    def _publish(self, event: Event) -> None:
        with self._changed:
            self._events.append(event)
            if isinstance(event, Gone):
                self._frame = None  # a frame of a camera that is gone must not be answered as the newest
            self._changed.notify_all()

    def _reopen(self) -> bool:
        """Open the camera as soon as it is there; False when told to stop."""
        while not self._stopped.wait(self._retry_s):
            try:
                name = self._device.open(self._request)
            except CameraError:
                self._device.close()
                continue
            self._publish(Opened(name))
            return True
        return False

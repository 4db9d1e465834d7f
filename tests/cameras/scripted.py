# SPDX-License-Identifier: Apache-2.0
"""Camera that follows a script, a clock that is set by hand, and a predictor of known answers."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from doorstate.cameras.clock import steady_s
from doorstate.cameras.device import AttachedCamera, CameraRequest, DepthCameraDevice, DepthFrame, Vector
from doorstate.errors import CameraGoneError
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.io.camera import Intrinsics
from doorstate.types import DoorState, Points
from tests.inference.streams import predict

CAMERA = Intrinsics(8, 6, 7.0, 7.0, 3.5, 2.5)
LEVEL: Vector = (0.0, -1.0, 0.0)
GONE, NOTHING, ABSENT = "gone", "nothing", "absent"


def frame(
    number: int, captured_s: float | None = None, up: Vector | None = LEVEL, depth: int = 2000
) -> DepthFrame:
    """Image of a wall, 8 x 6 pixels."""
    pixels = np.full((6, 8), depth, np.uint16)
    return DepthFrame(pixels, 0.001, CAMERA, steady_s() if captured_s is None else captured_s, number, up)


class ScriptedCamera(DepthCameraDevice):
    """Camera whose reads give the items of a script: frames, `GONE`, or `NOTHING` for a read without a frame.

    `ABSENT` before the next item is an attempt to open it that fails. At the end it is silent. Frames of the script
    without a time are captured when they are read.
    """

    kind = "scripted"

    def __init__(self, script: Iterable[DepthFrame | str], pause_s: float = 0.001) -> None:
        self._script: Iterator[DepthFrame | str] = iter(script)
        self._next: DepthFrame | str | None = None
        self._pause_s = pause_s
        self.opened, self.closed = 0, 0

    def list_attached(self) -> list[AttachedCamera]:
        return [AttachedCamera(self.kind, "1", "script")]

    def open(self, request: CameraRequest) -> str:
        item = self._peek()
        if item == ABSENT:
            self._next = None
            raise CameraGoneError("not attached")
        self.opened += 1
        return f"script {self.opened}"

    def read(self, timeout_s: float) -> DepthFrame | None:
        time.sleep(self._pause_s)
        item, self._next = self._peek(), None
        if item == GONE:
            raise CameraGoneError("unplugged")
        return item if isinstance(item, DepthFrame) else None

    def close(self) -> None:
        self.closed += 1

    def _peek(self) -> DepthFrame | str:
        if self._next is None:
            self._next = next(self._script, NOTHING)
        return self._next


class SetClock:
    """Clock that stands still until it is set."""

    def __init__(self, now_s: float = 1000.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s


class FixedPredictor(Predictor):
    """Predictor whose answers take turns; the last one stays.

    Args:
        states: answers.
        clock: clock that a prediction sets forward by `takes_s`.
    """

    gate = None
    removes_outliers = False
    name = "fixed"

    def __init__(
        self, *states: DoorState, clock: SetClock | None = None, takes_s: Sequence[float] = ()
    ) -> None:
        self._states, self._clock, self._takes_s = list(states), clock, list(takes_s)
        self.known: deque[Known] = deque(maxlen=100)

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        self.known.append(known)
        if self._clock is not None and self._takes_s:
            self._clock.now_s += self._takes_s.pop(0)
        state = self._states.pop(0) if len(self._states) > 1 else self._states[0]
        return [replace(predict(state), milliseconds=1.0) for _ in clouds]

# SPDX-License-Identifier: Apache-2.0
"""Time that never jumps for what follows from a camera, and the time of day for what people and recordings get."""

from __future__ import annotations

import time
from collections.abc import Callable

JUMP_S = 0.1  # a clock that is only corrected moves by 0.5 ms a second (adjtimex)
_DRIFT_S = 0.002  # is not followed, so that an image has one time in all that is told of it
_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)  # Linux: goes on while the machine sleeps


def steady_s() -> float:
    """Return seconds of a clock that nobody sets; the one clock of all frames."""
    return time.monotonic() if _BOOTTIME is None else time.clock_gettime(_BOOTTIME)


class DayTime:
    """Time of day of a steady time; a clock that was set is told, and followed from then on.

    Args:
        steady: seconds of a steady clock.
        day: seconds since 1970 of the machine's clock.
    """

    def __init__(self, steady: Callable[[], float] = steady_s, day: Callable[[], float] = time.time) -> None:
        self._steady, self._day = steady, day
        self._offset_s = day() - steady()

    def jump_s(self) -> float:
        """Return the seconds by which the clock was set since the last call, or 0."""
        offset_s = self._day() - self._steady()
        jump_s = offset_s - self._offset_s
        if abs(jump_s) >= _DRIFT_S:
            self._offset_s = offset_s
        return jump_s if abs(jump_s) >= JUMP_S else 0.0

    def stamp_ns(self, steady_s: float) -> int:
        """Return nanoseconds since 1970 of a steady time, to the microsecond."""
        return round((steady_s + self._offset_s) * 1e6) * 1000

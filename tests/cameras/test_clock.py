# SPDX-License-Identifier: Apache-2.0
"""The steady clock, and the time of day that follows it."""

from __future__ import annotations

import time

import pytest

from doorstate.cameras.clock import DayTime, steady_s
from tests.cameras.scripted import SetClock


def test_the_steady_clock_goes_with_that_of_the_process() -> None:
    started, steady = time.monotonic(), steady_s()
    time.sleep(0.02)
    assert steady_s() - steady == pytest.approx(time.monotonic() - started, abs=0.02)


def test_a_clock_that_is_set_is_told_once_and_followed() -> None:
    steady, day = SetClock(50.0), SetClock(1_700_000_000.0)
    day_time = DayTime(steady, day)
    assert day_time.jump_s() == 0
    assert day_time.stamp_ns(51.25) == 1_700_000_001_250_000_000
    steady.now_s += 1
    day.now_s += 1.01  # corrected slowly
    assert day_time.jump_s() == 0
    day.now_s -= 3600
    assert day_time.jump_s() == pytest.approx(-3600, abs=1e-6)
    assert day_time.jump_s() == 0
    assert day_time.stamp_ns(51.0) == pytest.approx((1_700_000_001.01 - 3600) * 1e9, abs=2000)

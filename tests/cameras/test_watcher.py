# SPDX-License-Identifier: Apache-2.0
"""Reports by the frames of a camera: a camera that is gone or late, a clock that jumps, tilt, and a long run."""

from __future__ import annotations

import gc
import json
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

from doorstate.cameras.clock import DayTime
from doorstate.cameras.device import DepthFrame
from doorstate.cameras.grabber import Counts, FrameGrabber
from doorstate.cameras.watcher import MAX_AGE_S, CameraReport, CameraWatch
from doorstate.inference.watch_settings import WatchSettings
from doorstate.types import DoorState
from tests.cameras.scripted import ABSENT, GONE, FixedPredictor, ScriptedCamera, SetClock, frame

OPEN, CLOSED = DoorState.OPEN, DoorState.CLOSED
SETTINGS = WatchSettings(require_leaf=False)


class Watched:
    """Watch with clocks that are set by hand."""

    def __init__(
        self, *states: DoorState, settings: WatchSettings = SETTINGS, takes_s: tuple[float, ...] = ()
    ) -> None:
        self.steady, self.day = SetClock(), SetClock(1_700_000_000.0)
        self.predictor = FixedPredictor(*states, clock=self.steady, takes_s=takes_s)
        day_time = DayTime(self.steady, self.day)
        self.watch = CameraWatch(settings, self.predictor, steady=self.steady, day_time=day_time)
        self.number = 0

    def see(self, elapsed_s: float = 0.1, age_s: float = 0.0) -> CameraReport:
        """Answer a frame that arrives after this time."""
        self.steady.now_s += elapsed_s
        self.day.now_s += elapsed_s
        self.number += 1
        return self.watch.answer(frame(self.number, self.steady.now_s - age_s), Counts())


def test_a_state_is_answered_after_a_second_or_so_and_held() -> None:
    watched = Watched(OPEN)
    reports = [watched.see() for _ in range(30)]
    assert reports[0].door.state == "unknown"
    assert reports[-1].door.state == "open"
    assert reports[-1].door.is_open
    assert reports[-1].door.stamp_ns == pytest.approx(1_700_000_003_000_000_000, abs=10_000)
    assert reports[-1].points is not None
    assert reports[-1].points.shape == (6, 8, 3)
    assert json.loads(reports[-1].door.doors) == []


def test_a_camera_that_is_gone_is_unknown_at_once_and_its_states_are_forgotten() -> None:
    watched = Watched(OPEN)
    assert [watched.see() for _ in range(30)][-1].door.state == "open"
    gone = watched.watch.report_gone("unplugged", Counts())
    assert (gone.door.state, gone.door.held_s, gone.door.is_open) == ("unknown", None, False)
    assert gone.door.prediction.abstention is not None
    assert gone.door.prediction.abstention.code == "camera_gone"
    assert [notice.code for notice in gone.notices] == ["camera_gone"]
    assert watched.watch.report_gone("unplugged", Counts()).notices == ()
    back = watched.see(elapsed_s=0.2)
    assert back.door.state == "unknown", "one frame is not enough after a gap"


def test_an_image_that_is_too_old_is_no_answer() -> None:
    watched = Watched(OPEN)
    assert [watched.see() for _ in range(30)][-1].door.state == "open"
    late = watched.see(age_s=MAX_AGE_S + 1)  # a machine that slept
    assert late.door.state == "unknown"
    assert late.door.prediction.abstention is not None
    assert late.door.prediction.abstention.code == "stale_frame"
    assert len(watched.predictor.known) == 30, "it is not evaluated"


def test_an_image_that_grows_too_old_while_it_is_answered_is_no_answer() -> None:
    watched = Watched(OPEN, takes_s=(MAX_AGE_S + 0.5,))
    report = watched.see()
    assert report.door.prediction.abstention is not None
    assert report.door.prediction.abstention.code == "stale_frame"
    assert report.latency_s == pytest.approx(MAX_AGE_S + 0.5)


@pytest.mark.parametrize("jump_s", [-3600.0, 7200.0, 2.0])
def test_a_clock_that_jumps_is_told_and_changes_no_state(jump_s: float) -> None:
    plain, watched = Watched(OPEN), Watched(OPEN)
    states = []
    for k in range(30):
        if k == 15:
            watched.day.now_s += jump_s
        report, expected = watched.see(), plain.see()
        states.append((report.door.state, expected.door.state))
        assert report.door.held_s == expected.door.held_s
        assert [notice.code for notice in report.notices] == (["clock_jumped"] if k == 15 else [])
        offset_s = jump_s if k >= 15 else 0.0
        assert report.door.stamp_ns - expected.door.stamp_ns == pytest.approx(offset_s * 1e9, abs=10_000)
    assert all(state == expected for state, expected in states)
    assert states[-1][0] == "open"


def test_the_clock_of_a_camera_that_trembles_does_not_reset_the_state() -> None:
    watched = Watched(OPEN)
    for k in range(30):
        report = watched.see(age_s=0.25 * (k % 2))
    assert report.door.state == "open"


def test_tilt_comes_from_the_accelerometer_unless_it_is_given() -> None:
    up = (0.0, -np.cos(np.radians(10)), -np.sin(np.radians(10)))
    tilted = frame(1, 1000.0, up)
    watched = Watched(OPEN)
    pose = watched.watch.answer(tilted, Counts()).door.pose
    assert pose is not None
    assert (pose.roll_deg, pose.pitch_deg, pose.tilt_from) == (
        pytest.approx(0),
        pytest.approx(10),
        "accelerometer",
    )
    assert watched.predictor.known[0].is_level
    given = Watched(OPEN, settings=WatchSettings(pitch=3.0, require_leaf=False))
    pose = given.watch.answer(tilted, Counts()).door.pose
    assert pose is not None
    assert (pose.pitch_deg, pose.tilt_from) == (3.0, "given")


def test_tilt_is_left_to_the_cloud_without_accelerometer_or_with_an_impossible_one() -> None:
    for up, codes in ((None, []), ((1.0, 0.0, 0.0), ["tilt_not_used"])):
        watched = Watched(OPEN)
        first = watched.watch.answer(frame(1, 1000.0, up), Counts())
        assert [notice.code for notice in first.notices] == codes
        assert not watched.predictor.known[0].is_level
        assert watched.watch.answer(frame(2, 1000.0, up), Counts()).notices == (), "it is told once"


def test_depth_in_metres_and_in_other_units_gives_the_same_points() -> None:
    watched = Watched(OPEN)
    plain = frame(1, 1000.0)
    metres = DepthFrame(np.full((6, 8), 2.0, np.float32), 1.0, plain.intrinsics, 1000.0, 2, plain.up)
    fine = DepthFrame(np.full((6, 8), 20000, np.uint16), 1e-4, plain.intrinsics, 1000.0, 3, plain.up)
    clouds = [watched.watch.answer(one, Counts()).points for one in (plain, metres, fine)]
    assert clouds[0] is not None
    for cloud in clouds[1:]:
        assert cloud is not None
        assert cloud == pytest.approx(clouds[0])


def test_unplugged_and_plugged_in_again_it_goes_on() -> None:
    script = [*map(frame, range(3)), GONE, ABSENT, ABSENT, *map(frame, range(3))]
    settings = WatchSettings(require_leaf=False, silence_s=0.05)
    watch = CameraWatch(settings, FixedPredictor(OPEN))
    codes: list[str] = []
    with FrameGrabber(ScriptedCamera(script, pause_s=0.02), retry_s=0.03) as grabber:
        for report in watch.follow(grabber):
            codes += [notice.code for notice in report.notices]
            if report.frame is None:
                assert report.door.state == "unknown"
            elif codes[-1] == "camera_opened" and len(codes) == 3:
                break
    assert codes == ["camera_opened", "camera_gone", "camera_opened"]


def test_a_camera_that_says_nothing_is_reported_again_and_again() -> None:
    watch = CameraWatch(WatchSettings(silence_s=0.05), FixedPredictor(OPEN))
    with FrameGrabber(ScriptedCamera([frame(1)])) as grabber:
        reports = watch.follow(grabber)
        assert next(reports).frame is not None
        for _ in range(3):
            report = next(reports)
            assert report.frame is None
            assert report.door.state == "unknown"


def endless(count: int) -> Iterator[DepthFrame]:
    for number in range(count):
        yield frame(number)


def test_memory_is_flat_over_many_frames() -> None:
    watch = CameraWatch(WatchSettings(require_leaf=False), FixedPredictor(OPEN, CLOSED, OPEN))
    with FrameGrabber(ScriptedCamera(endless(10**9), pause_s=0.001)) as grabber:
        reports = watch.follow(grabber)
        sizes = []
        tracemalloc.start()
        try:
            for k in range(1, 451):
                next(reports)
                if k % 150 == 0:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert sizes[2] - sizes[1] < 5_000

# SPDX-License-Identifier: Apache-2.0
"""Frames of a thread: the newest one, cameras that go and come, errors, and a clean end."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from doorstate.cameras.device import CameraRequest, DepthFrame
from doorstate.cameras.grabber import Ended, Event, FrameGrabber, Gone, Opened
from doorstate.errors import CameraGoneError, OutputError
from tests.cameras.scripted import ABSENT, GONE, NOTHING, ScriptedCamera, frame


def events(grabber: FrameGrabber, count: int) -> Iterator[Event | DepthFrame]:
    for _ in range(count):
        event = grabber.wait(10.0)
        assert event is not None
        yield event


def test_the_newest_frame_is_taken_and_dropped_ones_are_counted() -> None:
    seen = threading.Semaphore(0)
    camera = ScriptedCamera(frame(k) for k in range(20))
    with FrameGrabber(camera, on_frame=lambda _: seen.release()) as grabber:
        assert grabber.wait(1.0) == Opened("script 1")
        for _ in range(20):
            assert seen.acquire(timeout=10)
        while grabber.counts.grabbed < 20:
            pass
        newest = grabber.wait(1.0)
        assert isinstance(newest, DepthFrame)
        assert newest.number == 19
        assert (grabber.counts.grabbed, grabber.counts.dropped) == (20, 19)
        assert grabber.wait(0.01) is None


def test_a_frame_that_is_sent_again_is_left_out() -> None:
    camera = ScriptedCamera([frame(7), frame(7), frame(7), frame(8)], pause_s=0.02)
    with FrameGrabber(camera) as grabber:
        _, first, second = events(grabber, 3)
        assert isinstance(first, DepthFrame)
        assert isinstance(second, DepthFrame)
        assert (first.number, second.number) == (7, 8)
        assert grabber.counts.repeated == 2


def test_a_camera_that_is_plugged_in_again_goes_on() -> None:
    camera = ScriptedCamera([frame(1), NOTHING, GONE, ABSENT, ABSENT, frame(1)], pause_s=0.03)
    with FrameGrabber(camera, retry_s=0.01) as grabber:
        opened, first, gone, again, second = events(grabber, 5)
    assert (opened, gone, again) == (Opened("script 1"), Gone("unplugged"), Opened("script 2"))
    assert isinstance(first, DepthFrame)
    assert isinstance(second, DepthFrame)
    assert grabber.counts.losses == 1


def test_the_last_frame_before_a_camera_goes_is_not_left_for_later() -> None:
    camera = ScriptedCamera([frame(1), GONE, *[ABSENT] * 1000])
    with FrameGrabber(camera, retry_s=0.01) as grabber:
        while grabber.counts.losses == 0:
            pass
        assert list(events(grabber, 2)) == [Opened("script 1"), Gone("unplugged")]
        assert grabber.wait(0.05) is None


def test_a_silent_camera_is_opened_again() -> None:
    camera = ScriptedCamera([frame(1), *[NOTHING] * 1000], pause_s=0.01)
    with FrameGrabber(camera, silence_s=0.05, retry_s=0.01) as grabber:
        found = [type(event) for event in events(grabber, 4)]
    assert found == [Opened, DepthFrame, Gone, Opened]


def test_a_camera_that_is_not_there_at_the_start_is_an_error() -> None:
    camera = ScriptedCamera([ABSENT])
    with pytest.raises(CameraGoneError), FrameGrabber(camera):
        pass
    assert camera.closed == 1


def test_what_recording_raises_ends_the_waiting() -> None:
    def full(_: DepthFrame) -> None:
        raise OutputError("disk full")

    camera = ScriptedCamera([frame(1)])
    with FrameGrabber(camera, on_frame=full) as grabber, pytest.raises(OutputError):
        list(events(grabber, 2))
    assert camera.closed >= 1


def test_a_recording_ends_after_its_last_frame() -> None:
    camera = ScriptedCamera([frame(1), GONE])
    with FrameGrabber(camera, CameraRequest(recording=Path("a.db3"))) as grabber:
        found = [type(event) for event in events(grabber, 3)]
    assert found == [Opened, DepthFrame, Ended]
    assert camera.opened == 1


def test_the_end_closes_the_camera() -> None:
    camera = ScriptedCamera([frame(k) for k in range(5)])
    with FrameGrabber(camera) as grabber:
        grabber.wait(1.0)
    assert camera.closed >= 1
    assert "camera" not in {thread.name for thread in threading.enumerate()}

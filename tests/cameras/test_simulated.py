# SPDX-License-Identifier: Apache-2.0
"""Simulated camera: a drive that a predictor can follow, in real time, and a loose cable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.cameras import simulated
from doorstate.cameras.device import CameraRequest, DepthFrame
from doorstate.cameras.gravity import tilt_of
from doorstate.cameras.simulated import LOOSE_CABLE, ROUND_S, SimulatedCamera, row_at
from doorstate.errors import CameraGoneError, ConfigError
from doorstate.simulation.presets import PRESETS, draw_rows
from tests.cameras.scripted import SetClock


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SetClock:
    """Clock of the drive; sleeping sets it forward."""
    made = SetClock()
    monkeypatch.setattr(simulated, "steady_s", made)
    monkeypatch.setattr(simulated.time, "sleep", lambda seconds: setattr(made, "now_s", made.now_s + seconds))
    return made


def read(camera: SimulatedCamera) -> DepthFrame:
    frame = camera.read(1.0)
    assert frame is not None
    return frame


def test_frames_come_at_their_rate_and_are_lost_if_nobody_takes_them(clock: SetClock) -> None:
    camera = SimulatedCamera()
    camera.open(CameraRequest(size=(64, 48), fps=5))
    frames = [read(camera) for _ in range(3)]
    clock.now_s += 1.0
    frames.append(read(camera))
    assert [frame.number for frame in frames] == [0, 1, 2, 7]
    assert [frame.captured_s for frame in frames] == pytest.approx([1000.0, 1000.2, 1000.4, 1001.4])
    assert camera.read(0.05) is None
    assert frames[0].depth.shape == (48, 64)
    assert frames[0].depth.dtype == np.uint16
    assert 0.5 < np.median(frames[0].depth[frames[0].depth > 0]) * frames[0].depth_scale_m < 5


def test_it_tells_the_tilt_of_its_scene(clock: SetClock) -> None:
    camera = SimulatedCamera()
    camera.open(CameraRequest(size=(64, 48)))
    up = read(camera).up
    assert up is not None
    row = draw_rows(PRESETS["corridor"], 5, 3)[-1]
    assert tilt_of(up) == pytest.approx((row.roll_deg, row.pitch_deg))


def test_a_loose_cable_is_gone_and_comes_back(clock: SetClock) -> None:
    camera = SimulatedCamera()
    request = CameraRequest(LOOSE_CABLE, size=(32, 24))
    camera.open(request)
    before = read(camera)
    clock.now_s += 7
    with pytest.raises(CameraGoneError):
        camera.read(0.1)
    with pytest.raises(CameraGoneError):
        camera.open(request)
    clock.now_s += 4
    camera.open(request)
    assert read(camera).number > before.number + 100


def test_the_door_opens_on_the_way() -> None:
    row = draw_rows(PRESETS["corridor"], 5, 3)[-1]
    angles = [row_at(row, second).opening_angle_deg or 0.0 for second in (0, 7, 9.5, 13, 17, ROUND_S)]
    assert angles == pytest.approx([0, 0, 47.5, 95, 0, 0], abs=1e-9)
    start, near = row_at(row, 0), row_at(row, 9)
    assert np.hypot(start.x_m - near.x_m, start.y_m - near.y_m) == pytest.approx(1.2)


def test_other_cameras_and_recordings_are_not_there() -> None:
    with pytest.raises(CameraGoneError):
        SimulatedCamera().open(CameraRequest("another"))
    with pytest.raises(ConfigError):
        SimulatedCamera().open(CameraRequest(recording=Path("a.bag")))

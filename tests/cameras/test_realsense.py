# SPDX-License-Identifier: Apache-2.0
"""RealSense cameras: a recording made and played by the vendor's own software."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doorstate.cameras.device import CameraRequest, DepthCameraDevice, DepthFrame
from doorstate.cameras.grabber import Ended, FrameGrabber
from doorstate.cameras.gravity import tilt_of
from doorstate.cameras.registry import make_camera
from doorstate.cameras.watcher import CameraWatch
from doorstate.errors import CameraError, CameraGoneError
from doorstate.inference.watch_settings import WatchSettings
from doorstate.io.bags import open_bag
from doorstate.types import DoorState
from tests.cameras.scripted import FixedPredictor

try:
    import pyrealsense2 as rs
except ImportError:  # not installed, or without libusb
    pytest.skip("pyrealsense2 cannot be loaded", allow_module_level=True)

WIDTH, HEIGHT, FRAMES = 160, 120, 20
PITCH_DEG = 10.0


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of a software device: 20 images of a wall, and an accelerometer that looks down by 10 degrees."""
    path = tmp_path_factory.mktemp("realsense") / "wall.db3"
    device = rs.software_device()
    device.register_info(rs.camera_info.name, "RealSense software device")
    device.register_info(rs.camera_info.serial_number, "12345")
    stereo, motion = device.add_sensor("Stereo Module"), device.add_sensor("Motion Module")
    camera = rs.intrinsics()
    camera.width, camera.height, camera.fx, camera.fy, camera.ppx, camera.ppy = (
        WIDTH,
        HEIGHT,
        140,
        141,
        80,
        59,
    )
    camera.model, camera.coeffs = rs.distortion.brown_conrady, [0.0] * 5
    images = rs.video_stream()
    images.type, images.index, images.uid, images.fmt = rs.stream.depth, 0, 1, rs.format.z16
    images.width, images.height, images.fps, images.bpp, images.intrinsics = WIDTH, HEIGHT, 30, 2, camera
    image_profile = stereo.add_video_stream(images)
    stereo.add_read_only_option(rs.option.depth_units, 0.0005)
    readings = rs.motion_stream()
    readings.type, readings.index, readings.uid = rs.stream.accel, 0, 2
    readings.fps, readings.fmt, readings.intrinsics = (
        100,
        rs.format.motion_xyz32f,
        rs.motion_device_intrinsic(),
    )
    reading_profile = motion.add_motion_stream(readings)
    recorder = rs.recorder(str(path), device)
    sensors = recorder.query_sensors()
    queues = [rs.frame_queue(50) for _ in sensors]
    for sensor, queue in zip(sensors, queues, strict=True):
        sensor.open(sensor.get_stream_profiles()[0])
        sensor.start(queue)
    for number in range(FRAMES):
        common = {"timestamp": 1000 + number * 33.3, "domain": rs.timestamp_domain.system_time}
        stereo.on_video_frame(_image(number, image_profile, common))
        motion.on_motion_frame(_reading(number, reading_profile, common))
        time.sleep(0.01)
    for sensor in sensors:
        sensor.stop()
        sensor.close()
    return path


def _image(number: int, profile: Any, common: dict[str, Any]) -> Any:
    image = rs.software_video_frame()
    image.pixels, image.stride, image.bpp = np.full((HEIGHT, WIDTH), 4000 + number, np.uint16), WIDTH * 2, 2
    image.frame_number, image.depth_units = number + 1, 0.0005
    image.profile = profile.as_video_stream_profile()
    image.timestamp, image.domain = common["timestamp"], common["domain"]
    return image


def _reading(number: int, profile: Any, common: dict[str, Any]) -> Any:
    reading = rs.software_motion_frame()
    force = rs.vector()
    angle = np.radians(PITCH_DEG)
    force.x, force.y, force.z = 0.0, -9.81 * np.cos(angle), -9.81 * np.sin(angle)
    reading.data, reading.frame_number = force, number + 1
    reading.profile = profile.as_motion_stream_profile()
    reading.timestamp, reading.domain = common["timestamp"], common["domain"]
    return reading


def read_all(camera: DepthCameraDevice, frames: list[DepthFrame]) -> None:
    while True:
        frames += filter(None, [camera.read(0.5)])


def test_a_recording_of_the_sdk_is_played(recording: Path) -> None:
    camera = make_camera("realsense")
    assert camera.open(CameraRequest(recording=recording)) == "RealSense software device 12345"
    frames: list[DepthFrame] = []
    with pytest.raises(CameraGoneError):
        read_all(camera, frames)
    camera.close()
    camera.close()
    assert len(frames) >= FRAMES // 2, "the first ones pass while the pipeline starts"
    last = frames[-1]
    assert last.number == FRAMES
    assert (last.depth.dtype, last.depth.shape) == (np.uint16, (HEIGHT, WIDTH))
    assert (last.depth == 4000 + FRAMES - 1).all()
    assert last.depth_scale_m == pytest.approx(0.0005)
    seen = last.intrinsics
    assert (seen.width, seen.height, seen.fx, seen.fy, seen.cx, seen.cy) == (WIDTH, HEIGHT, 140, 141, 80, 59)
    assert seen.distortion is None
    assert last.up is not None
    assert tilt_of(last.up) == pytest.approx((0, PITCH_DEG), abs=0.01)


def test_a_recording_is_watched_to_its_end(recording: Path) -> None:
    watch = CameraWatch(WatchSettings(), FixedPredictor(DoorState.CLOSED))
    with FrameGrabber(make_camera("realsense"), CameraRequest(recording=recording)) as grabber:
        reports = list(watch.follow(grabber))
    answered = [report for report in reports if report.frame is not None]
    assert len(answered) >= FRAMES // 2
    assert answered[-1].points is not None
    assert np.nanmedian(answered[-1].points[..., 0]) == pytest.approx(2.0, abs=0.2)
    assert answered[-1].door.pose is not None
    assert answered[-1].door.pose.tilt_from == "accelerometer"


def test_a_recording_of_the_sdk_is_a_bag(recording: Path) -> None:
    with open_bag(recording) as bag:
        clouds = list(bag.clouds(bag.choose()))
    assert len(clouds) == FRAMES
    assert not isinstance(clouds[0].cloud, Exception)
    assert clouds[0].cloud.shape == (HEIGHT, WIDTH, 3)


def test_a_mode_that_a_camera_does_not_have(recording: Path) -> None:
    with pytest.raises(CameraError) as raised:
        make_camera("realsense").open(CameraRequest(recording=recording, size=(1, 1)))
    assert raised.value.field == "size"


def test_without_a_camera_there_is_none() -> None:
    camera = make_camera("realsense")
    if camera.list_attached():
        pytest.skip("a camera is attached")
    for serial in ("", "999"):
        with pytest.raises(CameraGoneError):
            camera.open(CameraRequest(serial))


def test_the_end_of_a_grabbed_recording_is_told(recording: Path) -> None:
    with FrameGrabber(make_camera("realsense"), CameraRequest(recording=recording)) as grabber:
        event: object = None
        while not isinstance(event, Ended):
            event = grabber.wait(2.0)

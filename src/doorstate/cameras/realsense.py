# SPDX-License-Identifier: Apache-2.0
"""RealSense cameras, and recordings of the RealSense Viewer, by pyrealsense2.

Depth images of the D400 series are rectified. Readings of the accelerometer are in the axes of the depth image
(librealsense, doc/d435i.md).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from doorstate.cameras.clock import steady_s
from doorstate.cameras.device import (
    AttachedCamera,
    CameraRequest,
    DepthCameraDevice,
    DepthFrame,
    close_all,
    load_sdk,
    no_mode,
    not_attached,
    sdk_errors,
)
from doorstate.cameras.gravity import GravityFilter
from doorstate.errors import CameraGoneError
from doorstate.io.camera import Intrinsics
from doorstate.io.distortion import parse_distortion

_MAX_AGE_S = 1.0  # of an arriving image; more is a clock that was set meanwhile


class RealSenseCamera(DepthCameraDevice):
    """Camera of the D400 series, or any other whose depth librealsense delivers."""

    kind = "realsense"

    def __init__(self) -> None:
        self._rs = load_sdk("pyrealsense2", self.kind)
        self._pipeline: Any = None
        self._device: Any = None
        self._gravity = GravityFilter()

    def list_attached(self) -> list[AttachedCamera]:
        """Return the cameras that are attached now."""
        with sdk_errors("cameras cannot be listed"):
            return [AttachedCamera(self.kind, *self._names(device)) for device in self._rs.context().devices]

    def open(self, request: CameraRequest) -> str:
        """Start the camera, or the recording, and return its name with its serial number."""
        self.close()
        if request.recording is None and request.serial not in {
            "",
            *(c.serial for c in self.list_attached()),
        }:
            raise not_attached(self.kind, request.serial)
        with sdk_errors("the camera cannot be started"):
            pipeline = self._rs.pipeline()
            config = self._config(request, pipeline)
            profile = pipeline.start(config)
            self._pipeline, self._device = pipeline, profile.get_device()
            self._gravity = GravityFilter()
            serial, name = self._names(self._device)
        return f"{name} {serial}"

    def _config(self, request: CameraRequest, pipeline: Any) -> Any:
        """Return the configuration with the accelerometer, where there is one."""
        rs = self._rs
        config = rs.config()
        if request.recording is not None:
            config.enable_device_from_file(str(request.recording), repeat_playback=False)
        elif request.serial:
            config.enable_device(request.serial)
        wrapper = rs.pipeline_wrapper(pipeline)
        width, height = request.size or (0, 0)
        config.enable_stream(rs.stream.depth, width, height, rs.format.z16, request.fps or 0)
        if not config.can_resolve(wrapper):
            if request.recording is None and not self.list_attached():
                raise not_attached(self.kind, request.serial)
            raise no_mode(request)
        config.enable_stream(rs.stream.accel)
        if not config.can_resolve(wrapper):
            config.disable_stream(rs.stream.accel)
        return config

    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the newest frame, or None."""
        rs = self._rs
        with sdk_errors("unplugged"):
            is_there, frames = self._pipeline.try_wait_for_frames(round(timeout_s * 1000))
            if not is_there:
                self._check_connection()
                return None
            now_s = steady_s()
            if motion := frames.first_or_default(rs.stream.accel):
                force = motion.as_motion_frame().get_motion_data()
                self._gravity.add(np.array([force.x, force.y, force.z]), now_s)
            depth = frames.get_depth_frame()
            if not depth:
                return None
            return DepthFrame(
                np.array(depth.get_data()),  # a copy: the buffer goes back to the camera
                float(depth.get_units()),
                _intrinsics(depth.profile.as_video_stream_profile().intrinsics),
                now_s - self._age_s(depth),
                int(depth.get_frame_number()),
                self._gravity.up(now_s),
            )

    def close(self) -> None:
        """Stop the camera."""
        pipeline, self._pipeline, self._device = self._pipeline, None, None
        close_all(pipeline and pipeline.stop)

    def _check_connection(self) -> None:
        if self._device.is_playback():
            if self._device.as_playback().current_status() == self._rs.playback_status.stopped:
                raise CameraGoneError("the recording has ended")
        elif not self._device.is_connected():
            raise CameraGoneError("unplugged")

    def _age_s(self, depth: Any) -> float:
        """Return the age of an image by its stamp, where that is on the clock of this machine."""
        domains = self._rs.timestamp_domain
        if depth.get_frame_timestamp_domain() not in (domains.global_time, domains.system_time):
            return 0.0
        age_s = time.time() - depth.get_timestamp() / 1000
        return age_s if 0 <= age_s <= _MAX_AGE_S else 0.0

    def _names(self, device: Any) -> tuple[str, str]:
        info = self._rs.camera_info
        return device.get_info(info.serial_number), device.get_info(info.name)


def _intrinsics(camera: Any) -> Intrinsics:
    """Return the camera of a depth image; only the inverse model has no lens that could be undone."""
    model = camera.model.name
    has_lens = any(camera.coeffs) and model in ("brown_conrady", "kannala_brandt4")
    return Intrinsics(
        camera.width,
        camera.height,
        camera.fx,
        camera.fy,
        camera.ppx,
        camera.ppy,
        parse_distortion(model, list(camera.coeffs)) if has_lens else None,
    )

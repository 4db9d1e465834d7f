# SPDX-License-Identifier: Apache-2.0
"""Cameras of OpenNI 2 (ASUS Xtion, PrimeSense, first Astra), by the package openni.

The package calls libOpenNI2, which it looks for in the folder that the environment variable OPENNI2_REDIST names. These
cameras have no accelerometer and tell their field of view alone.
"""

from __future__ import annotations

import math
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
    no_recordings,
    not_attached,
    sdk_errors,
)
from doorstate.errors import CameraError, CameraGoneError, summarize_exception
from doorstate.io.camera import Intrinsics


class OpenNICamera(DepthCameraDevice):
    """Camera of OpenNI 2; its address on the bus is its serial number."""

    kind = "openni"

    def __init__(self) -> None:
        load_sdk("openni", self.kind)
        self._ni = load_sdk("openni.openni2", self.kind)
        try:
            self._ni.initialize()
        except Exception as error:
            raise CameraError(
                f"libOpenNI2 cannot be loaded ({summarize_exception(error)})",
                hint="let the environment variable OPENNI2_REDIST name its folder",
            ) from error
        self._units_m = {self._ni.PIXEL_FORMAT_DEPTH_1_MM: 1e-3, self._ni.PIXEL_FORMAT_DEPTH_100_UM: 1e-4}
        self._device: Any = None
        self._stream: Any = None

    def list_attached(self) -> list[AttachedCamera]:
        """Return the cameras that are attached now."""
        with sdk_errors("cameras cannot be listed"):
            return [
                AttachedCamera(self.kind, uri.decode(), "OpenNI") for uri in self._ni.Device.enumerate_uris()
            ]

    def open(self, request: CameraRequest) -> str:
        """Start the camera, and return its name with its address."""
        if request.recording is not None:
            raise no_recordings(self.kind)
        self.close()
        with sdk_errors("the camera cannot be started"):
            cameras = self.list_attached()
            if not request.serial and not cameras:
                raise not_attached(self.kind, "")
            self._device = self._ni.Device((request.serial or cameras[0].serial).encode())
            stream = self._device.create_depth_stream()
            if stream is None:
                raise CameraError("the camera has no depth images")
            self._stream = stream
            self._choose_mode(request)
            stream.set_mirroring_enabled(False)  # a mirrored door has its hinge on the other side
            stream.start()
            info = self._device.get_device_info()
            return f"{info.vendor.decode()} {info.name.decode()} {info.uri.decode()}"

    def _choose_mode(self, request: CameraRequest) -> None:
        """Choose the mode that was asked for, with depths in a unit of length; the current one stays if it fits."""
        current = self._stream.video_mode
        size = request.size or (current.resolutionX, current.resolutionY)
        wanted = (*size, request.fps or current.fps)
        modes = [current, *self._stream.get_sensor_info().videoModes]
        for mode in modes:
            is_wanted = (mode.resolutionX, mode.resolutionY, mode.fps) == wanted
            if is_wanted and mode.pixelFormat in self._units_m:
                if mode is not current:
                    self._stream.set_video_mode(mode)
                return
        raise no_mode(request)

    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the newest frame, or None."""
        with sdk_errors("unplugged"):
            if self._ni.wait_for_any_stream([self._stream], timeout_s) is None:
                self._check_connection()
                return None
            now_s = steady_s()
            image = self._stream.read_frame()
            try:
                rows = np.frombuffer(image.get_buffer_as_uint16(), np.uint16)
                rows = rows[: image.height * image.stride // 2].reshape(image.height, -1)
                return DepthFrame(
                    rows[:, : image.width].copy(),
                    self._units_m[image.videoMode.pixelFormat],
                    self._intrinsics(image.width, image.height),
                    now_s,
                    int(image.frameIndex),
                )
            finally:
                image.close()

    def close(self) -> None:
        """Stop the camera."""
        stream, device, self._stream, self._device = self._stream, self._device, None, None
        close_all(stream and stream.close, device and device.close)

    def _check_connection(self) -> None:
        uri = self._device.get_device_info().uri
        attached = self._ni.Device.enumerate_uris()
        if attached and uri not in attached:
            raise CameraGoneError("unplugged")

    def _intrinsics(self, width: int, height: int) -> Intrinsics:
        """Return the camera as OpenNI's own conversion to points has it: the centre between the middle pixels."""
        slopes = (
            math.tan(fov / 2) for fov in (self._stream.get_horizontal_fov(), self._stream.get_vertical_fov())
        )
        focal_x, focal_y = (size / (2 * slope) for size, slope in zip((width, height), slopes, strict=True))
        return Intrinsics(width, height, focal_x, focal_y, width / 2, height / 2)

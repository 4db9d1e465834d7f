# SPDX-License-Identifier: Apache-2.0
"""Orbbec cameras, and recordings of the Orbbec Viewer, by pyorbbecsdk2.

The accelerometer is turned into the axes of the depth image by the calibration that the camera holds; some cameras
hold none, and their tilt is left to the cloud.
"""

from __future__ import annotations

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
    rotation_or_none,
    sdk_errors,
)
from doorstate.cameras.gravity import GravityFilter
from doorstate.errors import CameraGoneError
from doorstate.io.camera import Intrinsics
from doorstate.io.distortion import parse_distortion

# Models by their names in the SDK, and the order of their coefficients in ours.
_MODELS = {
    "BROWN_CONRADY": ("plumb_bob", ("k1", "k2", "p1", "p2", "k3")),
    "BROWN_CONRADY_K6": ("rational_polynomial", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "KANNALA_BRANDT4": ("equidistant", ("k1", "k2", "k3", "k4")),
}


class OrbbecCamera(DepthCameraDevice):
    """Cameras of Gemini, Femto and Astra 2 series, as Orbbec's SDK 2 supports them."""

    kind = "orbbec"

    def __init__(self) -> None:
        self._ob = load_sdk("pyorbbecsdk", self.kind)
        # Else it writes a folder Log where the program was started.
        self._ob.Context.set_logger_to_file(self._ob.OBLogLevel.NONE, "")
        self._ob.Context.set_logger_to_console(self._ob.OBLogLevel.NONE)
        self._context = self._ob.Context()
        self._pipeline: Any = None
        self._playback: Any = None
        self._serial = ""
        self._force: Any = None  # newest reading of the accelerometer
        self._gravity = GravityFilter()

    def list_attached(self) -> list[AttachedCamera]:
        """Return the cameras that are attached now."""
        with sdk_errors("cameras cannot be listed"):
            found = self._context.query_devices()
            return [
                AttachedCamera(
                    self.kind,
                    found.get_device_serial_number_by_index(k),
                    found.get_device_name_by_index(k),
                )
                for k in range(found.get_count())
            ]

    def open(self, request: CameraRequest) -> str:
        """Start the camera, or the recording, and return its name with its serial number."""
        self.close()
        with sdk_errors("the camera cannot be started"):
            device = self._find(request)
            info = device.get_device_info()
            self._serial = info.get_serial_number()
            self._force, self._gravity = None, GravityFilter()
            pipeline = self._ob.Pipeline(device)
            pipeline.start(self._config(request, pipeline, device))
            self._pipeline = pipeline
            return f"{info.get_name()} {self._serial}"

    def _find(self, request: CameraRequest) -> Any:
        if request.recording is not None:
            self._playback = self._ob.PlaybackDevice(str(request.recording))
            return self._playback
        serials = [camera.serial for camera in self.list_attached()]
        if request.serial not in serials if request.serial else not serials:
            raise not_attached(self.kind, request.serial)
        return self._context.query_devices().get_device_by_serial_number(request.serial or serials[0])

    def _config(self, request: CameraRequest, pipeline: Any, device: Any) -> Any:
        """Return the configuration with the accelerometer, where there is one."""
        ob = self._ob
        profiles = pipeline.get_stream_profile_list(ob.OBSensorType.DEPTH_SENSOR)
        width, height = request.size or (0, 0)
        if request.size is None and request.fps is None:
            profile = profiles.get_default_video_stream_profile()
        else:
            try:
                profile = profiles.get_video_stream_profile(width, height, ob.OBFormat.Y16, request.fps or 0)
            except ob.OBError as error:
                raise no_mode(request) from error
        config = ob.Config()
        config.enable_stream(profile)
        # Images come at their own pace, and readings between them.
        config.set_frame_aggregate_output_mode(ob.OBFrameAggregateOutputMode.ANY_SITUATION)
        sensors = device.get_sensor_list()
        if ob.OBSensorType.ACCEL_SENSOR in [sensors[k].get_type() for k in range(len(sensors))]:
            config.enable_accel_stream()
        return config

    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the newest frame, or None."""
        end_s = steady_s() + timeout_s
        with sdk_errors("unplugged"):
            while (left_s := end_s - steady_s()) > 0:
                frames = self._pipeline.wait_for_frames(max(1, round(left_s * 1000)))
                if frames is None:
                    break
                depth, motion = frames.get_depth_frame(), frames.get_accel_frame()
                profile = None if depth is None else depth.get_stream_profile().as_video_stream_profile()
                self._read_motion(motion, profile)
                if depth is not None:
                    return self._frame(depth, profile)
            self._check_connection()
        return None

    def close(self) -> None:
        """Stop the camera."""
        pipeline, self._pipeline, self._playback = self._pipeline, None, None
        close_all(pipeline and pipeline.stop)

    def _frame(self, depth: Any, profile: Any) -> DepthFrame:
        height, width = depth.get_height(), depth.get_width()
        pixels = np.frombuffer(depth.get_data(), np.uint16)[: height * width].reshape(height, width)
        now_s = steady_s()
        return DepthFrame(
            pixels.copy(),
            depth.get_depth_scale() / 1000,  # millimetres
            _intrinsics(profile, width, height),
            now_s,
            int(depth.get_index()),
            self._gravity.up(now_s),
        )

    def _read_motion(self, motion: Any, profile: Any) -> None:
        self._force = motion or self._force
        if self._force is None or profile is None:
            return
        rotation = rotation_or_none(self._force.get_stream_profile().get_extrinsic_to(profile).rot)
        if rotation is not None:
            force = np.array([self._force.get_x(), self._force.get_y(), self._force.get_z()])
            self._gravity.add(rotation @ force, steady_s())
        self._force = None

    def _check_connection(self) -> None:
        if self._playback is not None:
            if self._playback.get_playback_status() == self._ob.OBPlaybackStatus.STOPPED:
                raise CameraGoneError("the recording has ended")
        elif self._serial not in [camera.serial for camera in self.list_attached()]:
            raise CameraGoneError("unplugged")


def _intrinsics(profile: Any, width: int, height: int) -> Intrinsics:
    camera, lens = profile.get_intrinsic(), profile.get_distortion()
    distortion = None
    if lens.model.name in _MODELS:
        model, names = _MODELS[lens.model.name]
        distortion = parse_distortion(model, [getattr(lens, coefficient) for coefficient in names])
    return Intrinsics(width, height, camera.fx, camera.fy, camera.cx, camera.cy, distortion)

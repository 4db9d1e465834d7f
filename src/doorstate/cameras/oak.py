# SPDX-License-Identifier: Apache-2.0
"""OAK cameras of Luxonis with two lenses, by depthai 3.

Depth is computed in the camera, in millimetres, as the rectified right lens sees it. The accelerometer has axes of its
own, which the calibration of the camera turns into those of that lens; without it the tilt is left to the cloud.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.cameras.clock import steady_s
from doorstate.cameras.device import (
    AttachedCamera,
    CameraRequest,
    DepthCameraDevice,
    DepthFrame,
    close_all,
    load_sdk,
    no_recordings,
    not_attached,
    rotation_or_none,
    sdk_errors,
)
from doorstate.cameras.gravity import GravityFilter
from doorstate.errors import CameraGoneError
from doorstate.io.camera import Intrinsics

_SIZE = (640, 400)  # of all OAK cameras with two lenses
_FPS = 15.0  # a USB 2 cable carries it
_ACCELEROMETER_HZ = 100
_UNIT_M = 0.001


class OakCamera(DepthCameraDevice):
    """OAK-D and its kin."""

    kind = "oak"

    def __init__(self) -> None:
        self._dai = load_sdk("depthai", self.kind)
        self._device: Any = None
        self._pipeline: Any = None
        self._depth: Any = None
        self._motion: Any = None
        self._imu_to_image: NDArray[np.float64] | None = None
        self._gravity = GravityFilter()

    def list_attached(self) -> list[AttachedCamera]:
        """Return the cameras that are attached now."""
        with sdk_errors("cameras cannot be listed"):
            found = self._dai.Device.getAllAvailableDevices()
            return [AttachedCamera(self.kind, info.getDeviceId(), info.name) for info in found]

    def open(self, request: CameraRequest) -> str:
        """Start the camera, and return its name with its serial number."""
        dai = self._dai
        if request.recording is not None:
            raise no_recordings(self.kind)
        self.close()
        cameras = self.list_attached()
        if request.serial not in {camera.serial for camera in cameras} if request.serial else not cameras:
            raise not_attached(self.kind, request.serial)
        with sdk_errors("the camera cannot be started"):
            self._device = dai.Device(dai.DeviceInfo(request.serial or cameras[0].serial))
            self._pipeline = dai.Pipeline(self._device)
            stereo = self._pipeline.create(dai.node.StereoDepth).build(
                autoCreateCameras=True, size=request.size or _SIZE, fps=float(request.fps or _FPS)
            )
            stereo.setLeftRightCheck(True)
            stereo.setSubpixel(True)  # without it, depths beyond 3 m are decimetres apart
            self._depth = stereo.depth.createOutputQueue(maxSize=1, blocking=False)
            self._imu_to_image = self._rotation()
            if self._imu_to_image is not None:
                imu = self._pipeline.create(dai.node.IMU)
                imu.enableIMUSensor(dai.IMUSensor.ACCELEROMETER_RAW, _ACCELEROMETER_HZ)
                imu.setBatchReportThreshold(1)
                imu.setMaxBatchReports(10)
                self._motion = imu.out.createOutputQueue(maxSize=10, blocking=False)
            self._gravity = GravityFilter()
            self._pipeline.start()
            return f"{self._device.getDeviceName()} {self._device.getDeviceId()}"

    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the newest frame, or None."""
        with sdk_errors("unplugged"):
            image = self._depth.get(timedelta(seconds=timeout_s))
            if image is None:
                if not self._pipeline.isRunning() or self._device.isClosed():
                    raise CameraGoneError("unplugged")
                return None
            now_s = steady_s()
            self._read_motion(now_s)
            (fx, _, cx), (_, fy, cy), _ = image.getTransformation().getIntrinsicMatrix()
            depth = np.array(image.getFrame())  # a copy
            height, width = depth.shape
            # Images are stamped by the clock of depthai on this machine.
            age_s = (self._dai.Clock.now() - image.getTimestamp()).total_seconds()
            return DepthFrame(
                depth,
                _UNIT_M,
                Intrinsics(width, height, fx, fy, cx, cy),
                now_s - max(0.0, age_s),
                int(image.getSequenceNum()),
                self._gravity.up(now_s),
            )

    def close(self) -> None:
        """Stop the camera."""
        pipeline, device = self._pipeline, self._device
        self._pipeline = self._device = self._depth = self._motion = None
        close_all(pipeline and pipeline.stop, device and device.close)

    def _read_motion(self, now_s: float) -> None:
        if self._motion is None or self._imu_to_image is None:
            return
        for message in self._motion.tryGetAll():
            for packet in message.packets:
                force = packet.acceleroMeter
                self._gravity.add(self._imu_to_image @ np.array([force.x, force.y, force.z]), now_s)

    def _rotation(self) -> NDArray[np.float64] | None:
        """Return R_image_imu, (3, 3), for the rectified right lens; None of a camera without it."""
        try:
            calibration = self._device.getCalibration()
            lens = calibration.getStereoRightCameraId()
            lens_from_imu = np.asarray(calibration.getImuToCameraExtrinsics(lens), np.float64)[:3, :3]
            image_from_lens = calibration.getStereoRightRectificationRotation()
        except RuntimeError:  # not calibrated, or no accelerometer
            return None
        rotations = rotation_or_none(image_from_lens), rotation_or_none(lens_from_imu)
        return None if rotations[0] is None or rotations[1] is None else rotations[0] @ rotations[1]

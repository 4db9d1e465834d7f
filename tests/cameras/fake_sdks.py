# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for the software of vendors, as far as our classes call it.

`REAL_NAMES` says which class of the real package each stand-in takes the place of; a test compares their names where
the package is installed.
"""

from __future__ import annotations

from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import numpy as np

WIDTH, HEIGHT = 16, 10
# The accelerometer's x points down, y to the left, z back, as in some OAK cameras: R_camera_imu.
LENS_FROM_IMU = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


class Plugged:
    """A cable: what is unplugged answers no more."""

    is_in = True


class OakQueue:
    def __init__(self, items: list[Any], cable: Plugged) -> None:
        self._items, self._cable = items, cable

    def get(self, timeout: timedelta) -> Any:
        if not self._cable.is_in:
            raise RuntimeError("Communication exception - possible device error")
        return self._items.pop(0) if self._items else None

    def tryGetAll(self) -> list[Any]:
        items, self._items[:] = list(self._items), []
        return items


class OakOutput:
    def __init__(self, items: list[Any], cable: Plugged) -> None:
        self._items, self._cable = items, cable

    def createOutputQueue(self, maxSize: int, blocking: bool) -> OakQueue:
        assert not blocking
        return OakQueue(self._items, self._cable)


class OakImage:
    def __init__(self, number: int) -> None:
        self._number = number

    def getFrame(self) -> Any:
        return np.full((HEIGHT, WIDTH), 1500 + self._number, np.uint16)

    def getTransformation(self) -> Any:
        return SimpleNamespace(getIntrinsicMatrix=lambda: [[20.0, 0, 7.0], [0, 21.0, 5.0], [0, 0, 1]])

    def getTimestamp(self) -> timedelta:
        return timedelta(seconds=99.95)

    def getSequenceNum(self) -> int:
        return self._number


class OakStereo:
    def __init__(self, cable: Plugged) -> None:
        self.depth = OakOutput([OakImage(k) for k in range(8)], cable)

    def build(self, autoCreateCameras: bool, size: tuple[int, int], fps: float) -> OakStereo:
        self.size, self.fps = size, fps
        return self

    def setLeftRightCheck(self, enable: bool) -> None: ...

    def setSubpixel(self, enable: bool) -> None: ...


class OakImu:
    def __init__(self, cable: Plugged) -> None:
        down = LENS_FROM_IMU.T @ [0.0, -9.81, 0.0]
        force = SimpleNamespace(x=down[0], y=down[1], z=down[2])
        self.out = OakOutput([SimpleNamespace(packets=[SimpleNamespace(acceleroMeter=force)] * 6)], cable)

    def enableIMUSensor(self, sensor: Any, reportRate: int) -> None: ...

    def setBatchReportThreshold(self, number: int) -> None: ...

    def setMaxBatchReports(self, number: int) -> None: ...


class OakCalibration:
    imu: Any = np.vstack([np.hstack([LENS_FROM_IMU, [[1.0], [2.0], [3.0]]]), [0, 0, 0, 1]]).tolist()

    def getStereoRightCameraId(self) -> int:
        return 2

    def getImuToCameraExtrinsics(self, cameraId: int) -> Any:
        if self.imu is None:
            raise RuntimeError("There is no Imu data available")
        return self.imu

    def getStereoRightRectificationRotation(self) -> Any:
        return np.eye(3).tolist()


class OakDevice:
    cable = Plugged()
    ids = ("14442C10", "19443010")
    calibration = OakCalibration()

    def __init__(self, info: Any) -> None:
        self._id = info

    @classmethod
    def getAllAvailableDevices(cls) -> list[Any]:
        ids = cls.ids if cls.cable.is_in else ()
        return [SimpleNamespace(getDeviceId=lambda k=k: k, name="1.2") for k in ids]

    def getDeviceName(self) -> str:
        return "OAK-D"

    def getDeviceId(self) -> str:
        return str(self._id)

    def getCalibration(self) -> OakCalibration:
        return self.calibration

    def isClosed(self) -> bool:
        return not self.cable.is_in

    def close(self) -> None: ...


class OakPipeline:
    def __init__(self, device: OakDevice) -> None:
        self._cable = device.cable

    def create(self, node: Any) -> Any:
        return node(self._cable)

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def isRunning(self) -> bool:
        return self._cable.is_in


def fake_depthai() -> Any:
    """Return a stand-in for the module depthai with two cameras."""
    OakDevice.cable, OakDevice.calibration = Plugged(), OakCalibration()
    return SimpleNamespace(
        Device=OakDevice,
        DeviceInfo=lambda serial: serial,
        Pipeline=OakPipeline,
        node=SimpleNamespace(StereoDepth=OakStereo, IMU=OakImu),
        IMUSensor=SimpleNamespace(ACCELEROMETER_RAW=0),
        Clock=SimpleNamespace(now=lambda: timedelta(seconds=100)),
    )


class OrbbecError(Exception):
    """OBError."""


class OrbbecProfile:
    """Of a depth image, or of the accelerometer, whose axes are turned as above."""

    rotation: Any = LENS_FROM_IMU

    def __init__(self, model: str = "NONE") -> None:
        self._model = model

    def as_video_stream_profile(self) -> OrbbecProfile:
        return self

    def get_extrinsic_to(self, other: OrbbecProfile) -> Any:
        return SimpleNamespace(rot=self.rotation)

    def get_intrinsic(self) -> Any:
        return SimpleNamespace(fx=20.0, fy=21.0, cx=7.0, cy=5.0, width=WIDTH, height=HEIGHT)

    def get_distortion(self) -> Any:
        coefficients = {
            "k1": 0.1,
            "k2": 0.02,
            "k3": 0.001,
            "k4": 0.0,
            "k5": 0.0,
            "k6": 0.0,
            "p1": 1e-4,
            "p2": 2e-4,
        }
        return SimpleNamespace(model=SimpleNamespace(name=self._model), **coefficients)


class OrbbecDepth:
    def __init__(self, number: int, model: str) -> None:
        self._number, self._model = number, model

    def get_stream_profile(self) -> OrbbecProfile:
        return OrbbecProfile(self._model)

    def get_height(self) -> int:
        return HEIGHT

    def get_width(self) -> int:
        return WIDTH

    def get_data(self) -> Any:
        return np.full(HEIGHT * WIDTH, 3000 + self._number, np.uint16).view(np.uint8)

    def get_depth_scale(self) -> float:
        return 0.5

    def get_index(self) -> int:
        return self._number


class OrbbecAccel:
    def get_stream_profile(self) -> OrbbecProfile:
        return OrbbecProfile()

    def get_x(self) -> float:
        return float((LENS_FROM_IMU.T @ [0.0, -9.81, 0.0])[0])

    def get_y(self) -> float:
        return 0.0

    def get_z(self) -> float:
        return 0.0


class OrbbecFrameSet:
    def __init__(self, depth: OrbbecDepth | None, accel: OrbbecAccel | None) -> None:
        self._depth, self._accel = depth, accel

    def get_depth_frame(self) -> OrbbecDepth | None:
        return self._depth

    def get_accel_frame(self) -> OrbbecAccel | None:
        return self._accel


class OrbbecProfiles:
    def get_default_video_stream_profile(self) -> str:
        return "default"

    def get_video_stream_profile(self, width: int, height: int, format: str, fps: int) -> str:
        if (width, height) not in ((0, 0), (WIDTH, HEIGHT)):
            raise OrbbecError("no matching profile")
        return f"{width}x{height}@{fps}"


class OrbbecPipeline:
    model = "NONE"

    def __init__(self, device: OrbbecDevice) -> None:
        self._cable = device.cable
        self._frames: list[OrbbecFrameSet] = []
        for k in range(8):
            self._frames += [
                OrbbecFrameSet(None, OrbbecAccel()),
                OrbbecFrameSet(OrbbecDepth(k, self.model), None),
            ]

    def get_stream_profile_list(self, sensor: str) -> OrbbecProfiles:
        return OrbbecProfiles()

    def start(self, config: OrbbecConfig) -> None: ...

    def stop(self) -> None: ...

    def wait_for_frames(self, timeout_ms: int) -> OrbbecFrameSet | None:
        return self._frames.pop(0) if self._frames and self._cable.is_in else None


class OrbbecConfig:
    def enable_stream(self, profile: str) -> None: ...

    def enable_accel_stream(self) -> None: ...

    def set_frame_aggregate_output_mode(self, mode: int) -> None: ...


class OrbbecDevice:
    cable = Plugged()

    def get_device_info(self) -> Any:
        return SimpleNamespace(get_name=lambda: "Gemini 335", get_serial_number=lambda: "CP12")

    def get_sensor_list(self) -> list[Any]:
        return [SimpleNamespace(get_type=lambda k=k: k) for k in ("depth", "accel")]


class OrbbecPlayback(OrbbecDevice):
    def __init__(self, file: str) -> None: ...

    def get_playback_status(self) -> str:
        return "stopped"


class OrbbecDevices:
    def get_count(self) -> int:
        return int(OrbbecDevice.cable.is_in)

    def get_device_serial_number_by_index(self, index: int) -> str:
        return "CP12"

    def get_device_name_by_index(self, index: int) -> str:
        return "Gemini 335"

    def get_device_by_serial_number(self, serial: str) -> OrbbecDevice:
        return OrbbecDevice()


class OrbbecContext:
    @staticmethod
    def set_logger_to_file(level: int, path: str) -> None: ...

    @staticmethod
    def set_logger_to_console(level: int) -> None: ...

    def query_devices(self) -> OrbbecDevices:
        return OrbbecDevices()


def fake_pyorbbecsdk() -> Any:
    """Return a stand-in for the module pyorbbecsdk with one camera."""
    OrbbecDevice.cable, OrbbecPipeline.model, OrbbecProfile.rotation = Plugged(), "NONE", LENS_FROM_IMU
    return SimpleNamespace(
        Context=OrbbecContext,
        Pipeline=OrbbecPipeline,
        Config=OrbbecConfig,
        PlaybackDevice=OrbbecPlayback,
        OBError=OrbbecError,
        OBLogLevel=SimpleNamespace(NONE=0),
        OBFormat=SimpleNamespace(Y16="y16"),
        OBSensorType=SimpleNamespace(DEPTH_SENSOR="depth", ACCEL_SENSOR="accel"),
        OBFrameAggregateOutputMode=SimpleNamespace(ANY_SITUATION=0),
        OBPlaybackStatus=SimpleNamespace(STOPPED="stopped"),
    )


REAL_NAMES: dict[str, dict[str, type]] = {
    "depthai": {
        "MessageQueue": OakQueue,
        "Node.Output": OakOutput,
        "ImgFrame": OakImage,
        "node.StereoDepth": OakStereo,
        "node.IMU": OakImu,
        "CalibrationHandler": OakCalibration,
        "Device": OakDevice,
        "Pipeline": OakPipeline,
    },
    "pyorbbecsdk": {
        "VideoStreamProfile": OrbbecProfile,
        "DepthFrame": OrbbecDepth,
        "AccelFrame": OrbbecAccel,
        "FrameSet": OrbbecFrameSet,
        "StreamProfileList": OrbbecProfiles,
        "Pipeline": OrbbecPipeline,
        "Config": OrbbecConfig,
        "Device": OrbbecDevice,
        "PlaybackDevice": OrbbecPlayback,
        "DeviceList": OrbbecDevices,
        "Context": OrbbecContext,
    },
}
"""Stand-ins by package and class."""

# SPDX-License-Identifier: Apache-2.0
"""Recording of a camera as a ROS bag: depth images, their camera, and the direction of gravity.

A file .bag is one of ROS 1, compressed by LZ4; a file .mcap is one of ROS 2. Topics and frame have the names of
image_proc, so that the bag is read without further options (`io.bags`). Depths whose unit is not a millimetre are
written in metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate.cameras.device import DepthFrame, Vector, close_all
from doorstate.cameras.gravity import GRAVITY_M_S2
from doorstate.errors import ConfigError, OutputError, needs_extra
from doorstate.io.camera import Intrinsics
from doorstate.io.messages import CAMERA_INFO, IMAGE

IMAGE_TOPIC, RAW_IMAGE_TOPIC = "/camera/depth/image_rect_raw", "/camera/depth/image_raw"
INFO_TOPIC, MOTION_TOPIC = "/camera/depth/camera_info", "/camera/accel/sample"
SUFFIXES = (".bag", ".mcap")
_MOTION = "sensor_msgs/msg/Imu"
_MILLIMETRE = 0.001


class Recorder:
    """Writer of the frames of one camera, returned by `record_bag`."""

    def __init__(self, writer: Any, store: Any, serialize: Any, frame_id: str) -> None:
        self._writer, self._store, self._serialize, self._frame_id = writer, store, serialize, frame_id
        self._connections: dict[str, Any] = {}
        self.frames = 0

    def write(self, frame: DepthFrame, stamp_ns: int) -> None:
        """Write a frame.

        Raises:
            OutputError: the disk is full, or the file cannot be written.
        """
        header = self._header(stamp_ns)
        topic = IMAGE_TOPIC if frame.intrinsics.distortion is None else RAW_IMAGE_TOPIC
        try:
            self._write(topic, IMAGE, self._image(frame, header), stamp_ns)
            self._write(INFO_TOPIC, CAMERA_INFO, self._camera_info(frame.intrinsics, header), stamp_ns)
            if frame.up is not None:
                self._write(MOTION_TOPIC, _MOTION, self._motion(frame.up, header), stamp_ns)
        except OSError as error:
            raise OutputError(f"the recording cannot be written ({error.strerror or error})") from error
        self.frames += 1

    def _write(self, topic: str, message_type: str, message: Any, stamp_ns: int) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, message_type, typestore=self._store)
        self._writer.write(self._connections[topic], stamp_ns, self._serialize(message, message_type))

    def _type(self, name: str) -> Any:
        return self._store.types[name]

    def _header(self, stamp_ns: int) -> Any:
        stamp = self._type("builtin_interfaces/msg/Time")(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        fields = {"seq": self.frames} if self._is_ros1 else {}
        return self._type("std_msgs/msg/Header")(stamp=stamp, frame_id=self._frame_id, **fields)

    @property
    def _is_ros1(self) -> bool:
        return "seq" in self._type("std_msgs/msg/Header").__dataclass_fields__

    def _image(self, frame: DepthFrame, header: Any) -> Any:
        is_millimetres = frame.depth.dtype == np.uint16 and abs(frame.depth_scale_m / _MILLIMETRE - 1) < 1e-6
        if is_millimetres:
            pixels, encoding = frame.depth.astype("<u2"), "16UC1"
        else:
            pixels, encoding = (frame.depth * frame.depth_scale_m).astype("<f4"), "32FC1"
        height, width = pixels.shape
        return self._type(IMAGE)(
            header=header,
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=0,
            step=width * pixels.itemsize,
            data=np.frombuffer(pixels.tobytes(), np.uint8),
        )

    def _camera_info(self, camera: Intrinsics, header: Any) -> Any:
        lens = camera.distortion
        matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
        numbers: dict[str, NDArray[np.float64]] = {
            "d": np.array(lens.coefficients if lens is not None else [0.0] * 5),
            "k": matrix.ravel(),
            "r": np.eye(3).ravel(),
            "p": np.hstack([matrix, np.zeros((3, 1))]).ravel(),
        }
        if self._is_ros1:
            numbers = {name.upper(): value for name, value in numbers.items()}
        return self._type(CAMERA_INFO)(
            header=header,
            height=camera.height,
            width=camera.width,
            distortion_model=lens.model if lens is not None else "plumb_bob",
            **numbers,
            binning_x=0,
            binning_y=0,
            roi=self._type("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False),
        )

    def _motion(self, up: Vector, header: Any) -> Any:
        unknown = np.zeros(9)
        unknown[0] = -1.0  # of sensor_msgs/Imu: not measured
        vector, quaternion = (self._type(f"geometry_msgs/msg/{name}") for name in ("Vector3", "Quaternion"))
        return self._type(_MOTION)(
            header=header,
            orientation=quaternion(0.0, 0.0, 0.0, 1.0),
            orientation_covariance=unknown,
            angular_velocity=vector(0.0, 0.0, 0.0),
            angular_velocity_covariance=unknown,
            linear_acceleration=vector(*(GRAVITY_M_S2 * part for part in up)),
            linear_acceleration_covariance=np.zeros(9),
        )


@contextmanager
def record_bag(path: Path, frame_id: str) -> Iterator[Recorder]:
    """Yield a recorder; the file is there when the block ends, also by an exception that is not one of writing.

    Args:
        path: file .bag or .mcap.
        frame_id: frame of the images.

    Raises:
        ConfigError: another suffix.
        MissingExtraError: the package rosbags is not installed.
        OutputError: the file cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise ConfigError(
            f"{path} is no name of a recording", field="record", expected=f"a file {' or '.join(SUFFIXES)}"
        )
    with needs_extra("a ROS bag"):
        from rosbags.typesys import Stores, get_typestore
    interruption: BaseException | None = None
    with atomic_path(path) as temporary, TemporaryDirectory(prefix=".doorstate-", dir=path.parent) as folder:
        is_ros1 = path.suffix == ".bag"
        written = Path(folder) / "bag"
        writer = _writer(written, is_ros1)
        store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)
        writer.open()
        try:
            yield Recorder(writer, store, store.serialize_ros1 if is_ros1 else store.serialize_cdr, frame_id)
        except OutputError:
            close_all(writer.close)
            raise
        except BaseException as error:
            interruption = error
        writer.close()
        (written if is_ros1 else next(written.glob("*.mcap"))).replace(temporary)
    if interruption is not None:
        raise interruption


def _writer(path: Path, is_ros1: bool) -> Any:
    if is_ros1:
        from rosbags.rosbag1 import Writer as Writer1

        writer: Any = Writer1(path)
        writer.set_compression(Writer1.CompressionFormat.LZ4)
        return writer
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    return Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)

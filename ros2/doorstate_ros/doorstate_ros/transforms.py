# SPDX-License-Identifier: Apache-2.0
"""Rotation of a camera to a level frame, and its place in a map, from tf; a missing transform is a reason.

Needs tf2_ros only where transforms are looked up: `Transforms` takes any buffer with its method `lookup_transform`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.pose_file import PoseDefaults, place_of
from doorstate.errors import CameraError
from doorstate.io.rotations import Quaternion


class Buffer(Protocol):
    """Part of `tf2_ros.Buffer` that is used."""

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any) -> Any:
        """Return a TransformStamped that turns points of the source frame into the target frame."""


class Transforms:
    """Transforms of camera frames at the times of their clouds.

    Args:
        buffer: buffer of tf.
        make_time: returns rclpy's time of nanoseconds.
        make_duration: returns rclpy's duration of seconds.
    """

    def __init__(
        self, buffer: Buffer, make_time: Callable[[int], Any], make_duration: Callable[[float], Any]
    ) -> None:
        self._buffer, self._make_time, self._make_duration = buffer, make_time, make_duration

    def rotation(self, frame_id: str, level_frame: str, stamp_ns: int, timeout_s: float) -> Quaternion:
        """Return the rotation (x, y, z, w) from the frame of a camera to a level frame.

        Raises:
            CameraError: there is no transform at that time.
        """
        transform = self._look_up(frame_id, level_frame, stamp_ns, timeout_s)
        return _quaternion(transform)

    def place(
        self, frame_id: str, defaults: PoseDefaults, stamp_ns: int, timeout_s: float
    ) -> CameraPlace | MissingPlace:
        """Return the pose of a camera in the map `defaults.frame`, or why it is not known.

        Args:
            frame_id: frame of the camera.
            defaults: frame of the map, errors, and axes of the frame of the camera.
            stamp_ns: time.
            timeout_s: longest time to wait.
        """
        try:
            transform = self._look_up(frame_id, defaults.frame, stamp_ns, timeout_s)
            position = transform.transform.translation
            return place_of((position.x, position.y), _quaternion(transform), defaults)
        except CameraError as error:
            return MissingPlace(str(error))

    def forget(self) -> None:
        """Forget all transforms, as after a clock that was set back."""
        clear = getattr(self._buffer, "clear", None)
        if clear is not None:
            clear()

    def _look_up(self, source: str, target: str, stamp_ns: int, timeout_s: float) -> Any:
        try:
            return self._buffer.lookup_transform(
                target, source, self._make_time(stamp_ns), self._make_duration(timeout_s)
            )
        except Exception as error:  # errors of tf2 have no public common class
            cause = " ".join(str(error).split()).rstrip(".")
            raise CameraError(f"no transform from {source} to {target} ({cause})") from error


def _quaternion(transform: Any) -> Quaternion:
    rotation = transform.transform.rotation
    return rotation.x, rotation.y, rotation.z, rotation.w


def tf_listener(node: Any) -> tuple[Transforms, Callable[[], None]]:
    """Return the transforms that a node hears, and a function that ends the listener.

    It has a node and a thread of its own, so that a callback may wait for a transform.

    Raises:
        CameraError: tf2_ros is not installed.
    """
    from threading import Thread

    import rclpy
    from rclpy.duration import Duration
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.time import Time

    try:
        from tf2_ros import Buffer as TfBuffer
        from tf2_ros import TransformListener
    except ImportError as error:
        raise CameraError(
            "tf2_ros is not installed, which gravity_frame and doors need",
            hint="apt install ros-$ROS_DISTRO-tf2-ros-py",
        ) from error
    listening = rclpy.create_node(
        f"{node.get_name()}_tf",
        namespace=node.get_namespace(),
        parameter_overrides=[node.get_parameter("use_sim_time")],
        use_global_arguments=False,
    )
    buffer = TfBuffer(node=listening)
    listener = TransformListener(buffer, listening)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(listening)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = Thread(target=spin, name="doorstate-tf", daemon=True)
    thread.start()

    def stop() -> None:
        executor.shutdown(timeout_sec=1.0)
        thread.join(1.0)
        listener.unregister()
        listening.destroy_node()

    transforms = Transforms(
        buffer,
        lambda stamp_ns: Time(nanoseconds=stamp_ns, clock_type=listening.get_clock().clock_type),
        lambda seconds: Duration(nanoseconds=round(seconds * 1e9)),
    )
    return transforms, stop

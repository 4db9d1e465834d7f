# SPDX-License-Identifier: Apache-2.0
"""Node around `doorstate.inference.watch.DoorWatch`: messages of a camera in, reports about its door out."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Bool, ColorRGBA, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from doorstate.errors import DoorstateError
from doorstate.inference.backends import needs_torch
from doorstate.inference.backends.threads import configure_torch
from doorstate.inference.door_report import UNKNOWN, DoorPose, DoorReport
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings, parse_settings

ROS_PARAMETERS = {"use_sim_time", "start_type_description_service"}  # of every node
INPUTS = {"cloud": PointCloud2, "depth": Image, "compressed_depth": CompressedImage}
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
COLOURS = {
    "closed": (0.84, 0.15, 0.16),
    "semi_open": (1.0, 0.6, 0.1),
    "open": (0.17, 0.63, 0.17),
    UNKNOWN: (0.6, 0.6, 0.6),
}
TEXT_HEIGHT_M = 0.15
LINE_WIDTH_M = 0.02


class DoorNode:
    """Subscribe to one camera, and publish reports about its door.

    Args:
        node: node with no declared parameters except overrides.

    Raises:
        DoorstateError: a parameter is wrong, or the network or rule cannot be loaded.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        settings = declare_settings(node)
        configure_torch(settings.threads or None, used=needs_torch(settings.weights))
        self._watch = DoorWatch(settings)
        self._state = node.create_publisher(String, "~/state", LATCHED)
        self._open = node.create_publisher(Bool, "~/open", LATCHED)
        self._doors = node.create_publisher(String, "~/doors", 1)
        self._poses = node.create_publisher(PoseArray, "~/poses", 1)
        self._diagnostics = node.create_publisher(DiagnosticArray, "~/diagnostics", 1)
        self._markers = node.create_publisher(MarkerArray, "~/markers", 1)
        self._marker_lifetime = Duration(sec=int(2 * settings.silence_s) + 1)
        # A steady clock, because that of a recording may stand still.
        self._silence_timer = node.create_timer(
            settings.silence_s, self._on_silence, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        policy = ReliabilityPolicy.RELIABLE if settings.reliable else ReliabilityPolicy.BEST_EFFORT
        # Only the newest message waits while another is processed.
        newest = QoSProfile(depth=1, reliability=policy)
        if settings.input != "cloud":
            topic = node.resolve_topic_name(settings.input)
            set_camera = partial(self._watch.set_camera, image_topic=topic)
            node.create_subscription(CameraInfo, "camera_info", set_camera, newest)
        message_type = INPUTS[settings.input]
        subscription = node.create_subscription(message_type, settings.input, self._on_message, newest)
        self._publish(self._watch.report_silence(self._now_ns()), DiagnosticStatus.STALE)
        node.get_logger().info(f"watching {subscription.topic_name} ({self._watch.predictor_name})")

    def _on_message(self, message: Any) -> None:
        if self._watch.is_due(time.monotonic()):
            report = self._watch.process(message, self._now_ns())
            has_state = report.prediction.state is not None
            self._publish(report, DiagnosticStatus.OK if has_state else DiagnosticStatus.WARN)
        self._silence_timer.reset()

    def _on_silence(self) -> None:
        self._publish(self._watch.report_silence(self._now_ns()), DiagnosticStatus.STALE)

    def _publish(self, report: DoorReport, level: bytes) -> None:
        self._state.publish(String(data=report.state))
        self._open.publish(Bool(data=report.is_open))
        header = Header(frame_id=report.frame_id, stamp=stamp(report.stamp_ns))
        self._doors.publish(String(data=report.doors))
        self._poses.publish(PoseArray(header=header, poses=[pose(door) for door in report.poses]))
        self._diagnostics.publish(
            DiagnosticArray(header=header, status=[diagnostic(self._node, report, level)])
        )
        self._markers.publish(MarkerArray(markers=markers(header, report, self._marker_lifetime)))

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)


def declare_settings(node: Node) -> WatchSettings:
    """Declare all parameters as read-only, and check the overrides, misspelt ones too."""
    overrides = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    settings = parse_settings(
        {name: value for name, value in overrides.items() if name not in ROS_PARAMETERS}
    )
    for name, field in WatchSettings.model_fields.items():
        descriptor = ParameterDescriptor(
            name=name, description=field.description, read_only=True, dynamic_typing=True
        )
        if name in overrides:
            node.set_descriptor(name, descriptor)
        else:
            node.declare_parameter(name, field.default, descriptor)
    return settings


def stamp(stamp_ns: int) -> Time:
    return Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def diagnostic(node: Node, report: DoorReport, level: bytes) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name=f"{node.get_name()}: door",
        message=report.prediction.reason or report.values["raw_state"],
        values=[KeyValue(key=key, value=value) for key, value in report.values.items()],
    )


def markers(header: Header, report: DoorReport, lifetime: Duration) -> list[Marker]:
    """Return a label, the detections of a rule and the doors; they replace all earlier markers."""
    red, green, blue = COLOURS[report.state]
    common: dict[str, Any] = {
        "header": header,
        "color": ColorRGBA(r=red, g=green, b=blue, a=1.0),
        "lifetime": lifetime,
    }
    label = Marker(ns="state", type=Marker.TEXT_VIEW_FACING, text=report.text, **common)
    label.scale.z = TEXT_HEIGHT_M
    label.pose.position = point(report.centre_m)
    drawn = [Marker(header=header, action=Marker.DELETEALL), label]
    for number, detection in enumerate(report.detections):
        lines = Marker(ns=detection.name, id=number, type=Marker.LINE_STRIP, **common)
        lines.scale.x = LINE_WIDTH_M
        lines.points = [point(corner) for corner in detection.points_m]
        drawn.append(lines)
    for number, line in enumerate(report.lines):
        lines = Marker(ns=f"doors/{line.name}", id=number, type=Marker.LINE_STRIP, **common)
        lines.scale.x = LINE_WIDTH_M
        lines.points = [point(place) for place in line.points_m]
        drawn.append(lines)
        if line.label:
            text = Marker(
                ns="doors/label", id=number, type=Marker.TEXT_VIEW_FACING, text=line.label, **common
            )
            text.scale.z = TEXT_HEIGHT_M
            text.pose.position = point(line.points_m[-1])
            drawn.append(text)
    return drawn


def point(place_m: Iterable[float]) -> Point:
    x, y, z = (float(metres) for metres in place_m)
    return Point(x=x, y=y, z=z)


def pose(door: DoorPose) -> Pose:
    x, y, z, w = door.quaternion
    return Pose(position=point(door.position_m), orientation=Quaternion(x=x, y=y, z=z, w=w))


def main(args: Sequence[str] | None = None) -> int:
    """Run until stopped; return 1 after one line on standard error if the node cannot start."""
    try:
        rclpy.init(args=args)
    except Exception as error:  # errors of rclpy have no public name
        return print_error(error)
    try:
        node = rclpy.create_node("doorstate", automatically_declare_parameters_from_overrides=True)
        DoorNode(node)
        rclpy.spin(node)
    except DoorstateError as error:
        return print_error(error)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except Exception:
        if rclpy.ok():
            raise
        # Stopped during a callback.
    finally:
        rclpy.try_shutdown()
    return 0


def print_error(error: Exception) -> int:
    """Print one line on standard error, and return the exit code."""
    print(f"doorstate_ros: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
    return 1


if __name__ == "__main__":
    sys.exit(main())

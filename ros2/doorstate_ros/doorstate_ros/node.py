# SPDX-License-Identifier: Apache-2.0
"""The node: messages in, messages out; what is said of them is the library's (doorstate.inference.watch)."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Sequence
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Bool, ColorRGBA, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from doorstate.errors import DoorstateError
from doorstate.inference.watch import UNKNOWN, DoorReport, DoorWatch
from doorstate.inference.watch_settings import WatchSettings, parse_settings

ROS_PARAMETERS = {"use_sim_time", "start_type_description_service"}  # that every node has
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
    """Subscribes to one camera and publishes what is said of its door.

    Args:
        node: with nothing but the parameters that were given.

    Raises:
        DoorstateError: a parameter is wrong, or nobody can answer.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        settings = declared_settings(node)
        self._watch = DoorWatch(settings)
        self._state = node.create_publisher(String, "~/state", LATCHED)
        self._open = node.create_publisher(Bool, "~/open", LATCHED)
        self._answer = node.create_publisher(DiagnosticArray, "~/answer", 1)
        self._markers = node.create_publisher(MarkerArray, "~/markers", 1)
        self._shown_for = Duration(sec=int(2 * settings.silence_s) + 1)
        # A steady clock: that of a recording may stand still.
        self._silence = node.create_timer(
            settings.silence_s, self._on_silence, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        policy = ReliabilityPolicy.RELIABLE if settings.reliable else ReliabilityPolicy.BEST_EFFORT
        # The newest message only: what comes while the one before is being answered takes the place of what waits.
        newest = QoSProfile(depth=1, reliability=policy)
        if settings.input != "cloud":
            node.create_subscription(CameraInfo, "camera_info", self._watch.see_camera, newest)
        message_type = INPUTS[settings.input]
        seen = node.create_subscription(message_type, settings.input, self._on_message, newest)
        self._publish(self._watch.silence(self._now_ns()), DiagnosticStatus.STALE)
        node.get_logger().info(f"watching {seen.topic_name} ({self._watch.answerer})")

    def _on_message(self, message: Any) -> None:
        if self._watch.is_due(time.monotonic()):
            report = self._watch.answer(message, self._now_ns())
            known = report.prediction.state is not None
            self._publish(report, DiagnosticStatus.OK if known else DiagnosticStatus.WARN)
        self._silence.reset()

    def _on_silence(self) -> None:
        self._publish(self._watch.silence(self._now_ns()), DiagnosticStatus.STALE)

    def _publish(self, report: DoorReport, level: bytes) -> None:
        self._state.publish(String(data=report.state))
        self._open.publish(Bool(data=report.is_open))
        header = Header(frame_id=report.frame_id, stamp=stamp(report.stamp_ns))
        self._answer.publish(DiagnosticArray(header=header, status=[diagnostic(self._node, report, level)]))
        self._markers.publish(MarkerArray(markers=markers(header, report, self._shown_for)))

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)


def declared_settings(node: Node) -> WatchSettings:
    """Declare all parameters, read-only, and check those that were given, misspelt ones too."""
    present = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    settings = parse_settings({name: value for name, value in present.items() if name not in ROS_PARAMETERS})
    for name, field in WatchSettings.model_fields.items():
        descriptor = ParameterDescriptor(
            name=name, description=field.description, read_only=True, dynamic_typing=True
        )
        if name in present:
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


def markers(header: Header, report: DoorReport, shown_for: Duration) -> list[Marker]:
    """A label, and what a rule found; they replace all before."""
    red, green, blue = COLOURS[report.state]
    common: dict[str, Any] = {
        "header": header,
        "color": ColorRGBA(r=red, g=green, b=blue, a=1.0),
        "lifetime": shown_for,
    }
    label = Marker(ns="state", type=Marker.TEXT_VIEW_FACING, text=report.text, **common)
    label.scale.z = TEXT_HEIGHT_M
    label.pose.position = point(report.middle_m)
    drawn = [Marker(header=header, action=Marker.DELETEALL), label]
    for number, shape in enumerate(report.shapes):
        lines = Marker(ns=shape.name, id=number, type=Marker.LINE_STRIP, **common)
        lines.scale.x = LINE_WIDTH_M
        lines.points = [point(corner) for corner in shape.points_m]
        drawn.append(lines)
    return drawn


def point(place_m: Iterable[float]) -> Point:
    x, y, z = (float(metres) for metres in place_m)
    return Point(x=x, y=y, z=z)


def main(args: Sequence[str] | None = None) -> int:
    """Run until stopped; exit code 1 and one line on standard error if that cannot begin."""
    try:
        rclpy.init(args=args)
    except Exception as error:  # those of rclpy have no public name
        return failed(error)
    try:
        node = rclpy.create_node("doorstate", automatically_declare_parameters_from_overrides=True)
        DoorNode(node)
        rclpy.spin(node)
    except DoorstateError as error:
        return failed(error)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except Exception:
        if rclpy.ok():
            raise
        # Stopped in the middle of a callback.
    finally:
        rclpy.try_shutdown()
    return 0


def failed(error: Exception) -> int:
    """Say why on standard error."""
    print(f"doorstate_ros: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
    return 1


if __name__ == "__main__":
    sys.exit(main())

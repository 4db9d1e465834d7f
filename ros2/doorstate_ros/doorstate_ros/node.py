# SPDX-License-Identifier: Apache-2.0
"""Lifecycle node around `DoorWatch`: messages of a camera in, reports about its doors out."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Bool, Header, String
from visualization_msgs.msg import MarkerArray

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.door_file import read_doors
from doorstate.doors.history import DoorHistory
from doorstate.doors.live_doors import LiveDoors
from doorstate.doors.pose_file import PoseDefaults
from doorstate.doors.tracker import TrackedFrame
from doorstate.errors import DoorFileError, DoorstateError
from doorstate.inference.backends import needs_torch
from doorstate.inference.backends.threads import configure_torch
from doorstate.inference.door_report import DoorReport
from doorstate.inference.watch import DoorWatch
from doorstate.io.messages import stamp_ns_of
from doorstate.io.sensor_pose import PosedCloud
from doorstate.types import Points

from . import messages
from .doors_json import doors_json
from .settings import LIVE, NodeSettings, changed_settings, parse_node_settings
from .transforms import Transforms, tf_listener

try:
    from doorstate_msgs.msg import Door, Doors
except ImportError:  # the interface package was not built: the standard types are there
    Door = Doors = None

ROS_PARAMETERS = {"use_sim_time", "start_type_description_service"}  # of every node
INPUTS = {"cloud": PointCloud2, "depth": Image, "compressed_depth": CompressedImage}
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
DONE, FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class DoorNode(LifecycleNode):  # type: ignore[misc]  # rclpy has no types where it is not installed
    """Subscribe to one camera, and publish reports about its doors.

    Configuring loads the network, and activating subscribes. Topics are there from configuring to cleaning up, so that
    a node that is deactivated can say that the door is unknown.

    Args:
        name: name of the node.
        make_transforms: returns transforms and a function that ends them; None hears tf.

    Raises:
        DoorstateError: a parameter is wrong.
    """

    def __init__(
        self,
        name: str = "doorstate",
        make_transforms: Callable[[Any], tuple[Transforms, Callable[[], None]]] | None = None,
    ) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self._make_transforms = make_transforms or tf_listener
        self._stack = ExitStack()  # of what configuring opens
        self._watch: DoorWatch | None = None
        self._doors: LiveDoors | None = None
        self._transforms: Transforms | None = None
        self._subscriptions_of_camera: list[Any] = []
        self._timer: Any = None
        self._last_stamp_ns = 0
        self.failure: DoorstateError | None = None  # of the last configuration
        self.settings = self._declare()
        self.add_on_set_parameters_callback(self._on_parameters)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the network or rule, and open lists, history and tf."""
        self.failure = None
        settings = self.settings
        try:
            configure_torch(settings.threads or None, used=needs_torch(settings.weights))
            watch = DoorWatch(settings)
            if settings.uses_tf:
                self._transforms, stop = self._make_transforms(self)
                self._stack.callback(stop)
            if settings.doors:
                doors = read_doors(Path(settings.doors)).doors
                history = None
                if settings.history:
                    history = self._stack.enter_context(
                        DoorHistory(Path(settings.history), settings.history_days)
                    )
                self._doors = LiveDoors(doors, watch.predictor, history, asks=settings.ask_doors)
        except DoorstateError as error:
            self.failure = error
            self.get_logger().error(one_line(error))
            self.close()
            return FAILED
        self._watch = watch
        self._create_publishers()
        self._publish_silence()
        if Doors is None:
            self.get_logger().info("doorstate_msgs is not built: ~/door_list is not published")
        return DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the camera."""
        assert self._watch is not None
        settings = self.settings
        policy = ReliabilityPolicy.RELIABLE if settings.reliable else ReliabilityPolicy.BEST_EFFORT
        # Only the newest message waits while another is processed.
        newest = QoSProfile(depth=1, reliability=policy)
        # A steady clock, because that of a recording may stand still.
        self._timer = self.create_timer(
            settings.silence_s, self._publish_silence, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        if settings.input != "cloud":
            topic = self.resolve_topic_name(settings.input)
            set_camera = partial(self._watch.set_camera, image_topic=topic)
            self._subscriptions_of_camera.append(
                self.create_subscription(CameraInfo, "camera_info", set_camera, newest)
            )
        subscription = self.create_subscription(
            INPUTS[settings.input], settings.input, self._on_message, newest
        )
        self._subscriptions_of_camera.append(subscription)
        self.get_logger().info(f"watching {subscription.topic_name} ({self._watch.predictor_name})")
        return DONE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe, and say that the door is unknown."""
        self._unsubscribe()
        self._publish_silence()
        return DONE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give up everything that configuring opened; parameters may change now."""
        self.close()
        return DONE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Say that the door is unknown, and close."""
        self._unsubscribe()
        if self._watch is not None:
            self._publish_silence()
        self.close()
        return DONE

    def _declare(self) -> NodeSettings:
        """Declare all parameters, and check the overrides, misspelt ones too."""
        overrides = {name: parameter.value for name, parameter in self.get_parameters_by_prefix("").items()}
        settings = parse_node_settings(
            {name: value for name, value in overrides.items() if name not in ROS_PARAMETERS}
        )
        for name, field in NodeSettings.model_fields.items():
            when = "changes at once" if name in LIVE else "changes while the node is unconfigured"
            descriptor = ParameterDescriptor(
                name=name, description=field.description, additional_constraints=when, dynamic_typing=True
            )
            if name in overrides:
                self.set_descriptor(name, descriptor)
            else:
                self.declare_parameter(name, field.default, descriptor)
        return settings

    def _on_parameters(self, parameters: Sequence[Parameter[Any]]) -> SetParametersResult:
        """Check new values, and use them; all of them or none."""
        changes = {p.name: p.value for p in parameters if p.name not in ROS_PARAMETERS}
        try:
            settings = changed_settings(self.settings, changes, is_configured=self._watch is not None)
            if self._watch is not None:
                self._watch.change(settings)
        except DoorstateError as error:
            return SetParametersResult(successful=False, reason=one_line(error))
        self.settings = settings
        return SetParametersResult(successful=True)

    def _on_message(self, message: Any) -> None:
        watch = self._watch
        if watch is None or not self._subscriptions_of_camera:  # it was on its way
            return
        if watch.is_due(time.monotonic()):
            stamp_ns = stamp_ns_of(message) or self._now_ns()
            if stamp_ns < self._last_stamp_ns and self._transforms is not None:
                self.get_logger().warning("the clock was set back: earlier transforms are forgotten")
                self._transforms.forget()
            self._last_stamp_ns = stamp_ns
            report, points = self._report(watch, message, stamp_ns)
            has_state = report.prediction.state is not None
            self._publish(report, points, DiagnosticStatus.OK if has_state else DiagnosticStatus.WARN)
        self._timer.reset()

    def _report(self, watch: DoorWatch, message: Any, stamp_ns: int) -> tuple[DoorReport, Points | None]:
        """Return the report of a message, and its points; a missing transform is a reason without a state."""
        settings, frame_id, seen = self.settings, str(message.header.frame_id), list[Points]()

        def read() -> PosedCloud:
            rotation = None
            if settings.gravity_frame and self._transforms is not None:
                rotation = self._transforms.rotation(
                    frame_id, settings.gravity_frame, stamp_ns, settings.tf_timeout_s
                )
            cloud = watch.cloud(message, rotation)
            seen.append(cloud.points)
            return cloud

        report = watch.report(read, stamp_ns, frame_id)
        return report, seen[0] if seen else None

    def _follow(self, report: DoorReport, points: Points | None) -> TrackedFrame | None:
        """Return the doors of the list; None without one."""
        if self._doors is None or self._transforms is None:
            return None
        place: CameraPlace | MissingPlace = MissingPlace("no cloud")
        settings, pose = self.settings, report.pose
        if points is not None and pose is not None:
            defaults = PoseDefaults(
                settings.position_error_m, settings.yaw_error_deg, settings.map_frame, pose.axes
            )
            place = self._transforms.place(report.frame_id, defaults, report.stamp_ns, settings.tf_timeout_s)
        try:
            return self._doors.follow(report, points, place)
        except DoorFileError as error:
            self.get_logger().error(f"the history ends here: {one_line(error)}")
            self._doors.drop_history()
            return self._doors.follow(report, points, place)

    def _publish_silence(self) -> None:
        assert self._watch is not None
        self._publish(self._watch.report_silence(self._now_ns()), None, DiagnosticStatus.STALE)

    def _publish(self, report: DoorReport, points: Points | None, level: bytes) -> None:
        tracked = self._follow(report, points)
        header = Header(frame_id=report.frame_id, stamp=messages.stamp(report.stamp_ns))
        lifetime = Duration(sec=int(2 * self.settings.silence_s) + 1)
        self._state.publish(String(data=report.state))
        self._open.publish(Bool(data=report.is_open))
        self._doors_text.publish(String(data=doors_json(report, tracked)))
        self._poses.publish(PoseArray(header=header, poses=[messages.pose(door) for door in report.poses]))
        status = messages.diagnostic(self.get_name(), report, level, tracked)
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))
        self._markers.publish(MarkerArray(markers=messages.markers(header, report, lifetime)))
        if Doors is not None:
            doors = messages.door_messages(Door, report, tracked)
            self._door_list.publish(Doors(header=header, doors=doors, reason=report.prediction.reason))

    def _create_publishers(self) -> None:
        self._state = self.create_publisher(String, "~/state", LATCHED)
        self._open = self.create_publisher(Bool, "~/open", LATCHED)
        self._doors_text = self.create_publisher(String, "~/doors", 1)
        self._poses = self.create_publisher(PoseArray, "~/poses", 1)
        self._diagnostics = self.create_publisher(DiagnosticArray, "~/diagnostics", 1)
        self._markers = self.create_publisher(MarkerArray, "~/markers", 1)
        published = [
            self._state,
            self._open,
            self._doors_text,
            self._poses,
            self._diagnostics,
            self._markers,
        ]
        if Doors is not None:
            self._door_list = self.create_publisher(Doors, "~/door_list", LATCHED)
            published.append(self._door_list)
        for publisher in published:
            self._stack.callback(self.destroy_publisher, publisher)

    def _unsubscribe(self) -> None:
        while self._subscriptions_of_camera:
            self.destroy_subscription(self._subscriptions_of_camera.pop())
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None

    def close(self) -> None:
        """Give up everything that configuring opened; the history ends with all doors not seen."""
        if self._doors is not None:
            try:
                self._doors.end()
            except DoorFileError as error:
                self.get_logger().error(one_line(error))
        self._watch = self._doors = self._transforms = None
        self._stack.close()

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)


def one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def main(args: Sequence[str] | None = None) -> int:
    """Run until stopped; return 1 after one line on standard error if the node cannot start."""
    try:
        rclpy.init(args=args)
    except Exception as error:  # errors of rclpy have no public name
        return print_error(error)
    node = None
    try:
        node = DoorNode()
        if node.settings.autostart:
            node.trigger_configure()
            if node.failure is not None:
                return print_error(node.failure)
            node.trigger_activate()
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
        if node is not None:
            node.close()
        rclpy.try_shutdown()
    return 0


def print_error(error: Exception) -> int:
    """Print one line on standard error, and return the exit code."""
    print(f"doorstate_ros: {one_line(error)}", file=sys.stderr)  # noqa: T201
    return 1


if __name__ == "__main__":
    sys.exit(main())

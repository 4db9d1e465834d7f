# SPDX-License-Identifier: Apache-2.0
"""The node in its own process: a camera on loopback publishes simulated doors, a robot reads the reports."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from doorstate_ros.settings import NodeSettings
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Bool, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import camera_pose
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import Points
from tests.ros2.package import PACKAGE

POINTS = 256
NETWORK = "ogurob-pointnet2"  # trained on the door of these frames
STEP = 4  # in the image: small messages are not lost on loopback
FRAME_ID = "camera_depth_optical_frame"
TOPIC = "/camera/points"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WARNING = "module 'sre_"  # of the parser of lark-parser, which message types import
TIMEOUT_S = 90.0  # of one step on a busy machine

pytestmark = pytest.mark.filterwarnings(f"ignore:{WARNING}:DeprecationWarning")


class Robot:
    """Camera and robot: publishes clouds and images, and stores the messages of the node."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("robot")
        self.received: dict[str, list[Any]] = {
            "state": [],
            "open": [],
            "diagnostics": [],
            "markers": [],
            "depth": [],
        }
        for topic, kind, quality in (
            ("state", String, LATCHED),
            ("open", Bool, LATCHED),
            ("diagnostics", DiagnosticArray, 100),
            ("markers", MarkerArray, 100),
        ):
            self.node.create_subscription(kind, f"/doorstate/{topic}", self.received[topic].append, quality)
        self.node.create_subscription(
            DiagnosticArray, "/second/doorstate/diagnostics", self.received["depth"].append, 100
        )
        self.clouds = self.node.create_publisher(PointCloud2, TOPIC, qos_profile_sensor_data)
        reliable = QoSProfile(depth=30, reliability=ReliabilityPolicy.RELIABLE)
        self.images = self.node.create_publisher(Image, "/second/depth", reliable)
        self.infos = self.node.create_publisher(CameraInfo, "/second/camera_info", reliable)

    def wait_until(self, condition: Callable[[], Any], event: str) -> Any:
        """Spin until a condition holds."""
        end_s = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end_s, f"no {event} in {TIMEOUT_S} s"
            rclpy.spin_once(self.node, timeout_sec=0.05)
        return condition()

    def publish(self, cloud: Points, until: Callable[[], Any]) -> set[tuple[int, int]]:
        """Publish a cloud at 10 Hz until something is so; the stamps."""
        stamps: list[Time] = []
        next_s = 0.0

        def condition() -> Any:
            nonlocal next_s
            if time.monotonic() >= next_s:
                stamps.append(self.node.get_clock().now().to_msg())
                self.clouds.publish(cloud_message(cloud, stamps[-1]))
                next_s = time.monotonic() + 0.1
            return until()

        self.wait_until(condition, "report of the cloud")
        return {(stamp.sec, stamp.nanosec) for stamp in stamps}

    def reports(self, raw_state: str) -> list[DiagnosticArray]:
        """Return the reports whose single message has this state."""
        return [report for report in self.received["diagnostics"] if values(report)["raw_state"] == raw_state]

    def states(self) -> list[str]:
        return [message.data for message in self.received["state"]]

    def forget(self) -> None:
        for messages in self.received.values():
            messages.clear()


def to_optical(points: Points) -> Points:
    return np.stack((-points[..., 1], -points[..., 2], points[..., 0]), axis=-1)


def cloud_message(points: Points, stamp: Time) -> PointCloud2:
    height, width = points.shape[:2]
    return PointCloud2(
        header=Header(frame_id=FRAME_ID, stamp=stamp),
        height=height,
        width=width,
        fields=[
            PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
            for i, name in enumerate("xyz")
        ],
        point_step=12,
        row_step=12 * width,
        data=to_optical(points).astype("<f4").tobytes(),
    )


def stamp_of(header: Header) -> tuple[int, int]:
    return header.stamp.sec, header.stamp.nanosec


def values(report: DiagnosticArray) -> dict[str, str]:
    return {value.key: value.value for value in report.status[0].values}


def start(*arguments: str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": str(PACKAGE)}
    warnings = ["-W", "error", "-W", f"ignore:{WARNING}:DeprecationWarning"]
    command = [sys.executable, *warnings, "-m", "doorstate_ros.node", "--ros-args", *arguments]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def clouds() -> list[Points]:
    """Closed, semi-open, open, and nothing measured."""
    small = [replay(row).points[::STEP, ::STEP] for row in draw_rows(PRESETS["ogurob"], 3, 700)]
    return [*small, np.full_like(small[0], np.nan)]


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, subprocess.Popen[str]]]:
    """The node with a network, one with a rule and depth images, and one with an unknown parameter."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))  # nobody else's nodes
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("log")))
        patch.setenv("OMP_NUM_THREADS", "1")
        first = [f"network:={NETWORK}", "points:=256", "hold_s:=0.3", "silence_s:=0.8", "max_hz:=0.0"]
        second = ["input:=depth", "rule:=wall_leaf_angle", "reliable:=true", "max_hz:=0.0"]
        started = {
            "first": start(
                "--params-file", str(PACKAGE / "config" / "doorstate.yaml"),
                *(word for each in first for word in ("-p", each)), "-r", f"cloud:={TOPIC}",
            ),
            "second": start(*(word for each in second for word in ("-p", each)), "-r", "__ns:=/second"),
            "wrong": start("-p", "ponits:=512"),
            "no tf": start("-p", "gravity_frame:=odom"),
        }  # fmt: skip
        rclpy.init()
        try:
            yield started
        finally:
            rclpy.shutdown()
            for process in started.values():
                process.kill()
                process.communicate()


@pytest.fixture(scope="module")
def robot(processes: dict[str, subprocess.Popen[str]]) -> Robot:
    robot = Robot()
    robot.wait_until(lambda: robot.received["state"] and robot.node.count_subscribers(TOPIC), "node")
    return robot


def test_before_any_cloud_the_door_is_unknown_for_late_subscribers_too(robot: Robot) -> None:
    late: list[str] = []
    subscription = robot.node.create_subscription(
        String, "/doorstate/state", lambda m: late.append(m.data), LATCHED
    )
    robot.wait_until(lambda: late, "latched state")
    assert late[0] == robot.received["state"][0].data == "unknown"
    assert robot.received["open"][0].data is False
    robot.node.destroy_subscription(subscription)
    (publisher,) = robot.node.get_publishers_info_by_topic("/doorstate/state")
    assert publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    (subscriber,) = robot.node.get_subscriptions_info_by_topic(TOPIC)
    assert subscriber.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_a_closed_door_has_the_prediction_of_the_library(robot: Robot, clouds: list[Points]) -> None:
    sent = robot.publish(clouds[0], lambda: "closed" in robot.states())
    assert not any(message.data for message in robot.received["open"])
    report = robot.reports("closed")[-1]
    assert {stamp_of(report.header) for report in robot.reports("closed")} <= sent
    assert report.header.frame_id == FRAME_ID
    assert (report.status[0].level, report.status[0].message) == (DiagnosticStatus.OK, "closed")
    expected = Predictor.load(NETWORK, num_points=POINTS)(
        camera_pose("optical").to_body(to_optical(clouds[0]))
    )
    probabilities = {name: float(values(report)[name]) for name in expected.probabilities}
    assert probabilities == pytest.approx(expected.probabilities, abs=1e-4)


def test_a_door_that_has_been_open_for_long_enough_is_open(robot: Robot, clouds: list[Points]) -> None:
    robot.forget()
    sent = robot.publish(clouds[2], lambda: any(message.data for message in robot.received["open"]))
    assert robot.received["open"][0].data is False
    assert "open" in robot.states()

    def shown() -> list[MarkerArray]:
        return [
            message for message in robot.received["markers"] if message.markers[1].text.startswith("open ")
        ]

    robot.wait_until(shown, "marker")
    clear, label = shown()[-1].markers
    assert (clear.action, label.type) == (Marker.DELETEALL, Marker.TEXT_VIEW_FACING)
    assert label.color.g > label.color.r
    assert stamp_of(label.header) in sent
    assert label.header.frame_id == FRAME_ID
    assert label.lifetime.sec > 0
    assert label.pose.position.z > 1.0  # before the camera, by its optical frame


def test_nothing_measured_is_unknown_at_once_and_silence_too(robot: Robot, clouds: list[Points]) -> None:
    robot.forget()
    sent = robot.publish(clouds[3], lambda: robot.reports("unknown"))
    blind = robot.reports("unknown")[0]
    assert stamp_of(blind.header) in sent
    assert blind.status[0].level == DiagnosticStatus.WARN
    assert blind.status[0].message
    robot.wait_until(lambda: robot.received["open"][-1].data is False, "word that the way is not free")
    robot.wait_until(
        lambda: robot.received["diagnostics"][-1].status[0].level == DiagnosticStatus.STALE, "silence"
    )
    assert values(robot.received["diagnostics"][-1])["reason"]
    robot.wait_until(lambda: robot.states()[-1] == "unknown", "unknown state")


def test_some_parameters_change_at_once_and_impossible_values_change_nothing(robot: Robot) -> None:
    client = AsyncParameterClient(robot.node, "/doorstate")
    assert client.wait_for_services(timeout_sec=TIMEOUT_S)
    listed = client.list_parameters([], 10)
    rclpy.spin_until_future_complete(robot.node, listed, timeout_sec=TIMEOUT_S)
    assert set(NodeSettings.model_fields) <= set(listed.result().result.names)

    def change(name: str, value: object) -> SetParametersResult:
        changed = client.set_parameters([Parameter(name, value=value)])
        rclpy.spin_until_future_complete(robot.node, changed, timeout_sec=TIMEOUT_S)
        return changed.result().results[0]

    assert change("hold_s", 0.2).successful
    for name, value in (("points", 1024), ("hold_s", -1.0), ("tilt", "sideways")):
        result = change(name, value)
        assert not result.successful
        assert name in result.reason
    read = client.get_parameters(["hold_s", "points"])
    rclpy.spin_until_future_complete(robot.node, read, timeout_sec=TIMEOUT_S)
    assert [value.double_value or value.integer_value for value in read.result().values] == [0.2, POINTS]


def test_a_node_that_is_deactivated_says_unknown_and_goes_on_when_it_is_activated(
    robot: Robot, clouds: list[Points]
) -> None:
    service = robot.node.create_client(ChangeState, "/doorstate/change_state")
    assert service.wait_for_service(timeout_sec=TIMEOUT_S)

    def change(number: int) -> bool:
        changed = service.call_async(ChangeState.Request(transition=Transition(id=number)))
        rclpy.spin_until_future_complete(robot.node, changed, timeout_sec=TIMEOUT_S)
        return bool(changed.result().success)

    robot.publish(clouds[0], lambda: robot.states()[-1:] == ["closed"])
    assert change(Transition.TRANSITION_DEACTIVATE)
    robot.wait_until(lambda: robot.states()[-1] == "unknown", "unknown state")
    robot.forget()
    deadline_s = time.monotonic() + 1.0
    robot.publish(clouds[0], lambda: time.monotonic() > deadline_s)
    assert robot.states() == []
    assert change(Transition.TRANSITION_CLEANUP)
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    robot.publish(clouds[0], lambda: robot.states()[-1:] == ["closed"])


def test_of_many_depth_images_at_once_the_newest_is_reported(robot: Robot, clouds: list[Points]) -> None:
    depth_m = np.ascontiguousarray(clouds[1][..., 0])
    height, width = depth_m.shape
    robot.wait_until(lambda: robot.node.count_subscribers("/second/depth"), "second node")
    focal = 320 / np.tan(np.pi / 6) / STEP
    matrix = [focal, 0.0, 319.5 / STEP, 0.0, focal, 239.5 / STEP, 0.0, 0.0, 1.0]

    def publish(stamp: int) -> None:
        header = Header(frame_id=FRAME_ID, stamp=Time(sec=stamp))
        robot.infos.publish(CameraInfo(header=header, width=width, height=height, k=matrix))
        robot.images.publish(
            Image(
                header=header,
                height=height,
                width=width,
                encoding="32FC1",
                step=4 * width,
                data=depth_m.tobytes(),
            )
        )

    def reported() -> list[int]:
        stamps = [report.header.stamp.sec for report in robot.received["depth"]]
        return [stamp for stamp in stamps if stamp <= 100]  # those above are of silence

    stamps = iter(range(1, 50))

    def known() -> bool:
        publish(next(stamps))
        time.sleep(0.1)
        return any(values(report)["raw_state"] == "semi_open" for report in robot.received["depth"])

    robot.wait_until(known, "semi-open door")
    robot.forget()
    for stamp in range(51, 81):
        publish(stamp)
    robot.wait_until(lambda: 80 in reported(), "report of the newest")
    assert len(set(reported()) & set(range(51, 81))) < 20
    assert reported() == sorted(reported())


def test_a_misspelt_parameter_is_one_line_and_an_exit_code(
    processes: dict[str, subprocess.Popen[str]],
) -> None:
    _, errors = processes["wrong"].communicate(timeout=TIMEOUT_S)
    assert processes["wrong"].returncode == 1
    assert errors.startswith("doorstate_ros: ")
    assert "ponits" in errors
    assert errors.count("\n") == 1


@pytest.mark.skipif(find_spec("tf2_ros") is not None, reason="tf2_ros is installed")
def test_frames_without_tf_are_one_line_and_an_exit_code(processes: dict[str, subprocess.Popen[str]]) -> None:
    _, errors = processes["no tf"].communicate(timeout=TIMEOUT_S)
    assert processes["no tf"].returncode == 1
    assert errors.splitlines()[-1].startswith("doorstate_ros: ")
    assert "tf2_ros" in errors


@pytest.mark.parametrize(("name", "number"), [("first", signal.SIGINT), ("second", signal.SIGTERM)])
def test_the_node_stops_at_a_signal(
    name: str, number: int, processes: dict[str, subprocess.Popen[str]], robot: Robot
) -> None:
    processes[name].send_signal(number)
    _, errors = processes[name].communicate(timeout=TIMEOUT_S)
    assert processes[name].returncode == 0
    assert "watching /" in errors
    assert "Traceback" not in errors

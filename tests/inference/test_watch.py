# SPDX-License-Identifier: Apache-2.0
"""Reports after each message: simulated doors as clouds and as depth images, with packaged weights."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.door import Door
from doorstate.inference.door_report import DoorReport
from doorstate.inference.known import Known
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.inference.tilt import Tilt
from doorstate.inference.waiting import wait_for
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings, parse_settings
from doorstate.io.body_frame import points_in_body
from doorstate.io.options import ReadOptions
from doorstate.io.sensor_pose import camera_pose
from doorstate.types import STATES, DoorState, Points
from tests.attack.numbers import write_graph

POINTS = 512
STEP = 4  # in the image: small clouds are quick
OPTICAL = "camera_depth_optical_frame"
START_NS = 1_700_000_000_123_456_789


class CachedPredictor(NetworkPredictor):
    """Predictor that runs its network once for the same cloud."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._predictions: dict[bytes, Prediction] = {}

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        (points,) = clouds
        content = points.tobytes()
        if content not in self._predictions:
            (self._predictions[content],) = super()._predict(clouds, known)
        return [self._predictions[content]]


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return CachedPredictor.from_weights("ogurob-pointnet2", num_points=POINTS)  # the door of these frames


@pytest.fixture(scope="module")
def clouds(frames: list[Any]) -> list[Points]:
    """Closed, semi-open, open, and nothing measured."""
    small = [frame.points[::STEP, ::STEP] for frame in frames]
    return [*small, np.full_like(small[0], np.nan)]


def header(stamp_ns: int, frame_id: str) -> SimpleNamespace:
    stamp = SimpleNamespace(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return SimpleNamespace(stamp=stamp, frame_id=frame_id)


def cloud_message(points: Points, stamp_ns: int = START_NS, frame_id: str = "camera_link") -> SimpleNamespace:
    height, width = points.shape[:2]
    fields = [
        SimpleNamespace(name=name, offset=4 * place, datatype=7, count=1) for place, name in enumerate("xyz")
    ]
    return SimpleNamespace(
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * width,
        data=array("B", np.ascontiguousarray(points, "<f4").tobytes()),  # as rclpy holds it
    )


def image_message(pixels: NDArray[Any], encoding: str) -> SimpleNamespace:
    height, width = pixels.shape
    return SimpleNamespace(
        header=header(START_NS, OPTICAL),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=width * pixels.itemsize,
        data=array("B", pixels.tobytes()),
    )


def camera_message(fx: float) -> SimpleNamespace:
    """Return the camera of every fourth row and column of a 640 x 480 image, in pixels of the whole one."""
    k = [fx / STEP, 0, 319.5 / STEP, 0, fx / STEP, 239.5 / STEP, 0, 0, 1]
    return SimpleNamespace(width=640 // STEP, height=480 // STEP, k=k, p=[0.0] * 12, d=[])


def to_optical(points: Points) -> Points:
    return np.stack((-points[..., 1], -points[..., 2], points[..., 0]), axis=-1)


def at_10_hz(watch: DoorWatch, clouds: Iterator[Points] | list[Points]) -> list[DoorReport]:
    return [
        watch.process(cloud_message(cloud, START_NS + number * 10**8), 0)
        for number, cloud in enumerate(clouds)
    ]


def test_a_door_that_opens_is_open_when_waiting_would_end(predictor: Predictor, clouds: list[Points]) -> None:
    seen = [clouds[0]] * 8 + [clouds[2]] * 25
    reports = at_10_hz(DoorWatch(WatchSettings(max_hz=0), predictor), seen)
    assert reports[0].state == "unknown"
    assert reports[7].state == "closed"
    assert reports[-1].state == "open"
    assert reports[-1].prediction.state is DoorState.OPEN
    assert reports[-1].frame_id == "camera_link"
    first = next(report.stamp_ns for report in reports if report.is_open)
    stream = ((report.stamp_ns / 1e9, report.prediction) for report in reports)
    assert wait_for("open", stream, 60.0, hold_s=1.0)
    assert next(stream)[0] == pytest.approx(
        first / 1e9 + 0.1
    )  # the one after the frame that ended the waiting


def test_missing_data_are_never_open(predictor: Predictor, clouds: list[Points]) -> None:
    reports = at_10_hz(DoorWatch(WatchSettings(), predictor), [clouds[2]] * 25 + [clouds[3]] * 12)
    assert reports[24].is_open
    assert not any(report.is_open for report in reports[25:])
    assert {report.values["raw_state"] for report in reports[25:]} == {"unknown"}
    assert reports[25].values["reason"]
    assert reports[25].prediction.abstention is not None
    assert reports[25].prediction.abstention.code == "too_few_points"
    # The filter alone would remember for two to three seconds; from silence_s on the state itself is unknown.
    assert [report.state for report in reports[25:]] == ["open"] * 9 + ["unknown"] * 3


@pytest.mark.parametrize(
    ("row", "state"),
    [((0.0, 0.0, math.nan), "unknown"), ((0.0, 0.0, 1e9), "unknown"), ((0.02, 0.03, 0.95), "open")],
)
def test_broken_outputs_are_unknown(
    row: tuple[float, ...], state: str, clouds: list[Points], tmp_path: Path
) -> None:
    write_graph(tmp_path / "door.onnx", row)
    network = NetworkPredictor(OnnxBackend(tmp_path / "door.onnx"))
    reports = at_10_hz(DoorWatch(WatchSettings(), network), [clouds[2]] * 25)
    report = reports[-1]
    assert (report.state, report.values["raw_state"]) == (state, state)
    assert any(report.is_open for report in reports) == (state == "open")
    code = report.prediction.abstention and report.prediction.abstention.code
    assert code == (None if state == "open" else "invalid_outputs")


def test_silence_is_unknown_and_resets(predictor: Predictor, clouds: list[Points]) -> None:
    watch = DoorWatch(WatchSettings(), predictor)
    assert at_10_hz(watch, [clouds[2]] * 25)[-1].is_open
    silence = watch.report_silence(START_NS + 4 * 10**9)
    assert (silence.state, silence.is_open, silence.stamp_ns) == ("unknown", False, START_NS + 4 * 10**9)
    assert silence.prediction.abstention == Abstention("no_message", {"silence_s": 1.0})
    assert silence.frame_id == "camera_link"
    again = watch.process(cloud_message(clouds[2], START_NS + 4 * 10**9), 0)
    assert (again.state, again.values["raw_state"]) == ("unknown", "open")


@pytest.mark.parametrize("roll_deg", [0, 90, 180, 270])
@pytest.mark.parametrize(("axes", "frame_id", "optical"), [
    ("auto", OPTICAL, True),
    ("auto", "camera_link", False),
    ("optical", "camera_link", True),
    ("ros", OPTICAL, False),
])  # fmt: skip
def test_frames_and_rolled_cameras_do_not_change_the_state_and_places_are_in_them(
    axes: str, frame_id: str, optical: bool, roll_deg: int, clouds: list[Points]
) -> None:
    settings = parse_settings({"axes": axes, "roll": float(roll_deg), "rule": "wall_leaf_angle"})
    upright = DoorWatch(parse_settings({"rule": "wall_leaf_angle"})).process(cloud_message(clouds[1]), 0)
    rolled = camera_pose("ros", -roll_deg).to_body(clouds[1])
    sent = to_optical(rolled) if optical else rolled
    report = DoorWatch(settings).process(cloud_message(sent, frame_id=frame_id), 0)
    assert report.prediction.state is upright.prediction.state is DoorState.SEMI_OPEN
    np.testing.assert_allclose(report.centre_m, np.nanmedian(sent.reshape(-1, 3), axis=0), atol=0.05)
    assert (
        [shape.name for shape in report.detections]
        == [shape.name for shape in upright.prediction.detections]
        != []
    )
    options = ReadOptions(axes="optical" if optical else "ros", roll_deg=roll_deg)
    for detection, expected in zip(report.detections, upright.prediction.detections, strict=True):
        np.testing.assert_allclose(
            points_in_body(detection.points_m, options).points, expected.points_m, atol=1e-3
        )


def test_depth_images_need_a_camera_and_give_the_prediction_of_clouds(
    predictor: Predictor, clouds: list[Points]
) -> None:
    expected = DoorWatch(WatchSettings(), predictor).process(cloud_message(clouds[2]), 0)
    depth_m = clouds[2][..., 0]  # along the viewing axis
    watch = DoorWatch(WatchSettings(input="depth"), predictor)

    def code_after(message: SimpleNamespace) -> str | None:
        abstention = watch.process(message, 0).prediction.abstention
        return None if abstention is None else abstention.code

    assert code_after(image_message(depth_m, "32FC1")) == "unusable_cloud"
    watch.set_camera(camera_message(0.0))
    assert code_after(image_message(depth_m, "32FC1")) == "unusable_cloud"
    watch.set_camera(camera_message(320 / np.tan(np.pi / 6)))
    metres = watch.process(image_message(depth_m, "32FC1"), 0)
    assert metres.prediction.probabilities == pytest.approx(expected.prediction.probabilities, abs=1e-3)
    millimetres = watch.process(image_message(np.nan_to_num(depth_m * 1000).astype("<u2"), "16UC1"), 0)
    assert millimetres.values["raw_state"] == "open"
    np.testing.assert_allclose(metres.centre_m, to_optical(expected.centre_m), atol=1e-4)
    assert code_after(image_message(depth_m, "rgb8")) == "unusable_cloud"


def test_unreadable_messages_are_unknown(predictor: Predictor, clouds: list[Points]) -> None:
    watch = DoorWatch(WatchSettings(), predictor)
    broken = cloud_message(clouds[0])
    broken.data = broken.data[:100]
    assert watch.process(broken, 0).values["reason"]
    broken.data = "not bytes"
    damaged = watch.process(broken, 0).prediction.abstention
    assert damaged is not None
    assert damaged.code == "damaged_message"
    assert watch.process(cloud_message(clouds[0], 0), 5 * 10**9).stamp_ns == 5 * 10**9  # no stamp of its own
    assert watch.process(cloud_message(clouds[0]), 0).values["raw_state"] == "closed"
    png = SimpleNamespace(
        header=header(START_NS, OPTICAL), format="16UC1; compressedDepth png", data=bytes(20)
    )
    images = DoorWatch(WatchSettings(input="compressed_depth"), predictor)
    images.set_camera(camera_message(554.0))
    assert images.process(png, 0).values["raw_state"] == "unknown"


@pytest.mark.parametrize(
    ("camera_hz", "max_hz", "reports"), [(30, 10, 10), (15, 10, 10), (9, 10, 9), (30, 0, 30)]
)
def test_reports_come_at_the_largest_allowed_rate(camera_hz: int, max_hz: float, reports: int) -> None:
    watch = DoorWatch(WatchSettings(max_hz=max_hz), RulePredictor.from_name("depth_region"))
    due = [watch.is_due(1000 + number / camera_hz) for number in range(10 * camera_hz)]
    assert sum(due) == pytest.approx(10 * reports, abs=1)


def test_values_and_text_have_everything(clouds: list[Points]) -> None:
    watch = DoorWatch(parse_settings({"rule": "wall_leaf_angle"}))
    report = [watch.process(cloud_message(clouds[1], START_NS + k * 4 * 10**8), 0) for k in range(4)][-1]
    values = report.values
    assert values["state"] == values["raw_state"] == "semi_open"
    assert values.keys().isdisjoint(STATES)  # a rule estimates no probabilities
    assert sum(float(values[f"filtered_{name}"]) for name in STATES) == pytest.approx(1, abs=1e-5)
    assert 15 < float(values["opening_angle_deg"]) < 65
    assert 0 < float(values["held_s"]) <= 0.8
    assert report.text == f"semi_open {float(values['filtered_semi_open']):.0%}"
    unknown = DoorWatch(WatchSettings(rule="depth_region")).report_silence(START_NS)
    assert unknown.text == f"unknown\n{unknown.prediction.reason}"


class Answers(Predictor):
    """Predictor that gives the same doors for every cloud."""

    name = "answers"
    gate, removes_outliers = None, False

    def __init__(self, *doors: Door, tilt: Tilt | None = None) -> None:
        self._doors, self._tilt = doors, tilt
        self.known: list[Known] = []

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        self.known.append(known)
        return [Prediction.from_doors(self._doors, [], 1024, 1.0, self._tilt) for _ in clouds]


@pytest.mark.parametrize("optical", [True, False])
@pytest.mark.parametrize("tilt", [None, Tilt(5.0, 20.0, "floor")])
def test_doors_are_in_the_frame_of_the_message(
    tilt: Tilt | None, optical: bool, clouds: list[Points]
) -> None:
    """The axes of a door in the frame of the message lead from points of the door to those of the level frame."""
    door = Door(3.0, 0.5, 80.0, 0.9, DoorState.OPEN, hinge="left", opening_angle_deg=90.0, floor_z_m=-1.0)
    predictor = Answers(door, Door(2.0, -2.0, 20.0, 0.8, DoorState.CLOSED), tilt=tilt)
    watch = DoorWatch(
        parse_settings({"axes": "optical" if optical else "ros", "door_known": True}), predictor
    )
    report = watch.process(cloud_message(to_optical(clouds[0]) if optical else clouds[0]), 0)
    assert predictor.known == [Known(door=True)]

    def in_message(point: list[float]) -> Any:
        body = np.array(point) if tilt is None else tilt.from_level(np.array(point))
        return to_optical(body) if optical else body

    first, second = report.poses
    np.testing.assert_allclose(first.position_m, in_message([3.0, 0.5, -1.0]), atol=1e-6)
    assert second.position_m.shape == (3,)
    # Half a metre before the door, one metre up.
    yaw = np.radians(80.0)
    place = [3.0 - 0.5 * np.sin(yaw), 0.5 + 0.5 * np.cos(yaw), 0.0]
    turned = Rotation.from_quat(first.quaternion).apply([0.0, 0.5, 1.0]) + first.position_m
    np.testing.assert_allclose(turned, in_message(place), atol=1e-6)
    frame = next(line for line in report.lines if line.name == "door frame")
    assert frame.label == "1: open"
    left = [3.0 + 0.45 * np.cos(yaw), 0.5 + 0.45 * np.sin(yaw), -1.0]
    assert np.abs(frame.points_m - in_message(left)).sum(axis=1).min() < 1e-6
    listed = json.loads(report.doors)
    assert [(item["state"], item["x_m"], item["yaw_deg"]) for item in listed] == [
        ("open", 3.0, 80.0),
        ("closed", 2.0, 20.0),
    ]
    assert report.values["doors"] == "2"
    assert ("found_pitch_deg" in report.values) == (tilt is not None)


@pytest.mark.parametrize(
    ("leaf_seen", "require_leaf", "is_open"), [(False, True, False), (False, False, True), (True, True, True)]
)
def test_the_way_is_free_with_a_visible_leaf(
    leaf_seen: bool, require_leaf: bool, is_open: bool, clouds: list[Points]
) -> None:
    door = Door(3.0, 0.5, 80.0, 0.9, DoorState.OPEN, leaf_seen=leaf_seen)
    watch = DoorWatch(WatchSettings(require_leaf=require_leaf), Answers(door))
    report = at_10_hz(watch, [clouds[0]] * 25)[-1]
    assert (report.state, report.is_open) == ("open", is_open)


def test_parameters_choose_the_predictor(weights: object) -> None:
    assert DoorWatch(WatchSettings(points=POINTS)).predictor_name == "pointnet2, 512 points"
    assert DoorWatch(WatchSettings(weights=str(weights))).predictor_name == "pointnet, 256 points"
    assert DoorWatch(WatchSettings(rule="plane_state")).predictor_name == "rule plane_state"
    assert WatchSettings(rule="plane_state", gate=False).load_predictor().gate is None
    assert WatchSettings().load_predictor().gate is not None


@pytest.mark.parametrize(("parameters", "field"), [
    ({"ponits": 512}, None),
    ({"points": "many"}, "points"),
    ({"points": True}, "points"),
    ({"budget_ms": float("inf")}, "budget_ms"),
    ({"axes": "map"}, "axes"),
    ({"roll": 450.0}, "roll"),
    ({"tilt": "level"}, "tilt"),
    ({"camera_height": 9.0}, "camera_height"),
    ({"quaternion": "1 2"}, "quaternion"),
    ({"silence_s": 0.0}, "silence_s"),
])  # fmt: skip
def test_a_wrong_parameter_is_one_line(parameters: dict[str, Any], field: str | None) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_settings(parameters)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


def test_parameters_that_exclude_each_other_are_errors() -> None:
    for conflict in ({"points": 512}, {"budget_ms": 33.0}):
        with pytest.raises(ConfigError):
            parse_settings({"rule": "plane_state"} | conflict).load_predictor()
    with pytest.raises(ConfigError):
        parse_settings({"rule": "plane_state", "weights": "door.onnx"}).load_predictor()
    with pytest.raises(ConfigError):
        parse_settings({"points": 512, "budget_ms": 33}).load_predictor()
    with pytest.raises(WeightsError):
        parse_settings({"weights": "nowhere.onnx"}).load_predictor()


def test_a_rule_needs_no_torch_and_nothing_needs_ros() -> None:
    code = (
        "import sys; from doorstate.inference.watch import DoorWatch;"
        "from doorstate.inference.watch_settings import WatchSettings;"
        "DoorWatch(WatchSettings(rule='plane_state')); sys.exit(bool({'torch', 'rclpy'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)

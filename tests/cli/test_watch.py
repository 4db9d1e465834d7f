# SPDX-License-Identifier: Apache-2.0
"""`doorstate watch`: with the simulated camera, and with one that is unplugged by a script."""

from __future__ import annotations

import http.client
import io
import json
import signal
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from doorstate.cameras import registry
from doorstate.cameras.clock import DayTime, steady_s
from doorstate.cameras.grabber import Counts
from doorstate.cameras.watcher import CameraReport, CameraWatch, Notice
from doorstate.cli import predictors, watch_output
from doorstate.cli.depth_picture import depth_picture, depth_pixels, draw_line
from doorstate.cli.watch import _publish
from doorstate.doors.door_file import write_doors
from doorstate.doors.live_doors import LiveDoors
from doorstate.doors.named_door import DoorList
from doorstate.inference.door import Door
from doorstate.inference.door_lines import Line
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.watch_settings import WatchSettings
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import Frame
from doorstate.types import DoorState, Points
from tests.cameras.scripted import ABSENT, GONE, FixedPredictor, ScriptedCamera, frame
from tests.cli.helpers import Run, check_error
from tests.cli.test_view import free_port
from tests.doors.examples import AT_ORIGIN, named

SMALL = ("--camera", "simulated", "--size", "64x48", "--fps", 20)


@pytest.fixture
def watch(run: Run, weights: Path) -> Run:
    """Run `doorstate watch` with an untrained network."""
    return partial(run, "watch", "--weights", weights)


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch, frames: list[Frame]) -> Callable[..., ScriptedCamera]:
    """Let `--camera simulated` be a camera that follows a script of numbers of frames and of what happens."""
    pixels = np.nan_to_num(frames[0].cut.depth_m[::4, ::4] * 1000).astype(np.uint16)
    camera = DepthCamera(width=160, height=120).intrinsics()

    def script(*items: int | str) -> ScriptedCamera:
        made = ScriptedCamera(
            (
                item if isinstance(item, str) else replace(frame(item), depth=pixels, intrinsics=camera)
                for item in items
            ),
            pause_s=0.05,
        )
        monkeypatch.setattr(registry, "make_camera", lambda kind: made)
        return made

    return script


def test_json_has_a_line_for_each_answer(watch: Run) -> None:
    code, out, err = watch(*SMALL, "--json", "--seconds", 1.5)
    assert code == 0
    rows = [json.loads(line) for line in out.splitlines()]
    assert len(rows) > 3
    assert rows[0]["notices"][0]["code"] == "camera_opened"
    assert set(rows[0]["over_time"]) == {"state", "probabilities", "held_s", "is_open"}
    assert all(row["latency_ms"] > 0 and row["milliseconds"] >= 0 for row in rows)
    assert rows[-1]["sensor_pose"]["tilt_from"] == "accelerometer"
    assert abs(rows[-1]["stamp_s"] - time.time()) < 60
    assert [row["stamp_s"] for row in rows] == sorted({row["stamp_s"] for row in rows})
    assert err.startswith("stopped: ")


def test_lines_and_a_recording_that_predict_reads(
    watch: Run, run: Run, weights: Path, tmp_path: Path
) -> None:
    pytest.importorskip("rosbags")
    bag = tmp_path / "run.bag"
    code, out, err = watch(*SMALL, "--seconds", 1, "--record", bag)
    assert code == 0
    assert "simulated camera drive" in out.splitlines()[0]
    assert str(bag) in err
    code, out, _ = run("predict", "--bag", bag, "--weights", weights, "--json")
    assert code == 0
    assert len(out.splitlines()) > 3


def test_a_camera_that_is_unplugged_is_told_and_its_state_is_gone(
    watch: Run, scripted: Callable[..., ScriptedCamera]
) -> None:
    scripted(*range(5), GONE, ABSENT, *range(5, 10), *["nothing"] * 1000)
    code, out, err = watch("--camera", "simulated", "--json", "--seconds", 3)
    assert code == 0
    rows = [json.loads(line) for line in out.splitlines()]
    codes = [notice["code"] for row in rows for notice in row["notices"]]
    assert codes[:3] == ["camera_opened", "camera_gone", "camera_opened"]
    gone = [row for row in rows if "no camera" in row.get("reason", "")]
    assert gone
    assert all(row["state"] is row["over_time"]["state"] is None for row in gone)
    assert "gone 1 time" in err


@pytest.fixture
def ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background processes ignore SIGINT


def press_ctrl_c() -> None:
    main_thread = threading.main_thread().ident
    assert main_thread is not None
    signal.pthread_kill(main_thread, signal.SIGINT)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_it_and_the_recording_is_there(watch: Run, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    timer = threading.Timer(2.0, press_ctrl_c)
    timer.start()
    code, _, err = watch(*SMALL, "--record", tmp_path / "run.mcap")
    timer.join()
    assert code == 0
    assert err.startswith("stopped: ")
    assert (tmp_path / "run.mcap").is_file()
    assert "camera" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.usefixtures("ctrl_c")
def test_the_page_gets_answers_and_the_end_of_the_camera(
    watch: Run, scripted: Callable[..., ScriptedCamera]
) -> None:
    scripted(*range(10), GONE, *[ABSENT] * 1000)
    port, events = free_port(), list[str]()
    reader = threading.Thread(target=read_events, args=(port, events))
    reader.start()
    code, out, _ = watch("--camera", "simulated", "--view", "--no-open", "--port", port)
    reader.join()
    assert (code, out) == (0, f"http://127.0.0.1:{port}/\n")
    entries = [json.loads(line.removeprefix("data: ")) for line in events if line.startswith("data: {")]
    assert [name for name, _ in entries[0]["facts"]][:3] == ["over time", "latency", "notice"]
    assert entries[0]["cloud"] == entries[0]["whole"]
    assert "error" not in entries[0]
    assert "unplugged" in entries[-1]["error"]
    assert "prediction" not in entries[-1]


def read_events(port: int, events: list[str]) -> None:
    """Read events until one tells that the camera is gone, then press Ctrl-C."""
    try:
        for _ in range(600):
            with suppress(ConnectionRefusedError):  # not started yet
                connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
                connection.request("GET", "/events")
                break
            time.sleep(0.05)
        with closing(connection), closing(connection.getresponse()) as response:
            while "unplugged" not in "".join(events):
                events.append(response.readline().decode())
    finally:
        press_ctrl_c()


def test_attached_cameras_are_listed(run: Run) -> None:
    code, out, _ = run("watch", "--list")
    assert code == 0
    assert "loose-cable" in out


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        ((), 2, "--camera"),
        (("--camera", "simulated", "--doors", "doors.yaml"), 2, "--camera-pose"),
        (("--camera", "simulated", "--poses", "poses.csv"), 2, "--doors"),
        (("--camera", "realsens"), 2, "realsense"),
        (("--camera", "simulated", "--port", 8000), 2, "--port"),
        (("--camera", "simulated", "--view", "--json"), 2, "--json"),
        (("--camera", "simulated", "--size", "640"), 2, "--size"),
        (("--camera", "simulated", "--record", "run.txt"), 2, "--record"),
        (("--camera", "simulated", "--play", "run.db3"), 2, "--play"),
        (("--camera", "simulated", "--pitch", 200), 2, "--pitch"),
        (("--camera", "simulated", "--serial", "7"), 1, "7"),
    ],
)
def test_usage_errors(arguments: tuple[object, ...], expected_code: int, name: str, watch: Run) -> None:
    check_error(watch(*arguments), expected_code, name)


def one_report(**changes: Any) -> Any:
    watch = CameraWatch(WatchSettings(), FixedPredictor(DoorState.OPEN), day_time=DayTime())
    return replace(watch.answer(frame(1), Counts(grabbed=3, dropped=1)), **changes)


def test_the_terminal_shows_picture_state_doors_and_notices() -> None:
    shown = Console(width=100, height=20, record=True, file=io.StringIO())
    shown.print(watch_output.describe(one_report(notices=(Notice("clock_jumped", "+2.0 s"),))))
    text = shown.export_text()
    assert text.count("▀") == 8 * 3, "8 x 6 pixels"
    assert "unknown" in text
    assert "dropped 1 of 3" in text
    assert "+2.0 s" in text
    assert "accelerometer" in text


def test_a_high_terminal_has_the_doors_from_above() -> None:
    door = Door(
        2.0, 0.4, 90.0, 0.9, DoorState.OPEN, opening_angle_deg=90.0, hinge="left", passable_width_m=0.8
    )
    report = one_report()
    seen = replace(report, door=replace(report.door, prediction=Prediction.from_doors([door], [], 100, 1.0)))
    assert [line.plain for line in watch_output._doors(seen, 24)] == [
        "  1  open 90°, passable 0.80 m, 2.0 m, 11° left"
    ]
    assert len(watch_output._doors(seen, 50)) > 5


class Publisher:
    """Publisher that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, float]] = []
        self.doors: list[str] = []

    def update(self, statuses: list[Any], age_s: float) -> None:
        self.doors += [status.door for status in statuses]
        self.told += [(status.state, age_s) for status in statuses]


def test_a_camera_that_is_gone_is_published_once_as_unknown() -> None:
    watch = CameraWatch(WatchSettings(require_leaf=False), FixedPredictor(DoorState.OPEN))
    publisher, start_s = Publisher(), steady_s() - 2.5
    reports = [watch.answer(frame(number, start_s + number / 10), Counts()) for number in range(25)]
    reports += [watch.report_gone("unplugged", Counts()) for _ in range(3)]
    assert list(_publish(reports, publisher)) == reports  # type: ignore[arg-type]
    assert [state for state, _ in publisher.told[-2:]] == [DoorState.OPEN, None]
    assert len(publisher.told) == 26
    assert publisher.told[0][1] == reports[0].latency_s > 2, "the age of the image"


LISTED = DoorList(doors=(named("front", 2.0, 0.0), named("lab", -3.0, 0.0)))


class SeesDoor(FixedPredictor):
    """Predictor that sees an open door straight ahead, and another that no list has."""

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        sure = {"closed": 0.01, "semi_open": 0.01, "open": 0.98}
        doors = [
            Door(2.0, y_m, 90.0, 0.9, DoorState.OPEN, raw_probabilities=sure, leaf_seen=True)
            for y_m in (0.0, 1.5)
        ]
        return [Prediction.from_doors(doors, [], 100, 1.0) for _ in clouds]


@pytest.fixture
def listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[object, ...]:
    """Options of a list of two doors and of a camera that stands still, whose predictor sees one of them."""
    write_doors(tmp_path / "doors.yaml", LISTED)
    monkeypatch.setattr(predictors, "load_predictor", lambda *_, **__: SeesDoor(DoorState.OPEN))
    return "--camera", "simulated", "--doors", tmp_path / "doors.yaml", "--camera-pose", "0 0 0"


def test_doors_of_a_list_have_names_and_a_camera_that_is_gone_sees_none(
    run: Run, scripted: Callable[..., ScriptedCamera], listed: tuple[object, ...], tmp_path: Path
) -> None:
    scripted(*range(20), GONE, *[ABSENT] * 1000)
    history = tmp_path / "doors.sqlite"
    code, out, err = run("watch", *listed, "--json", "--seconds", 3, "--history", history)
    assert code == 0, err
    rows = [json.loads(line) for line in out.splitlines()]
    seen = [row for row in rows if row["state"]]
    assert [door["name"] for door in seen[-1]["doors"]] == ["front", "unknown door"]
    front, lab = seen[-1]["named_doors"]
    assert (front["id"], front["seen"], front["filtered_state"]) == ("front", True, "open")
    assert (lab["seen"], lab["state"]) == (False, None)
    gone = [row for row in rows if not row.get("doors")]
    assert gone
    assert all(door["state"] is None and not door["seen"] for row in gone for door in row["named_doors"])
    assert "unplugged" in gone[-1]["named_doors"][0]["reason"]
    code, out, _ = run("doors", "history", history, "--json")
    events = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [(event["door"], event["to"]) for event in events] == [("front", "open"), ("front", "not_seen")]


def test_without_a_new_pose_no_door_has_a_name(
    run: Run, scripted: Callable[..., ScriptedCamera], listed: tuple[object, ...], tmp_path: Path
) -> None:
    scripted(*range(5), *["nothing"] * 1000)
    poses = tmp_path / "poses.csv"
    poses.write_text("time,x,y,yaw\n1.0,0,0,0\n", encoding="utf-8")
    code, out, err = run("watch", *listed[:4], "--poses", poses, "--json", "--seconds", 1)
    assert code == 0, err
    rows = [json.loads(line) for line in out.splitlines()]
    assert all(not door["seen"] for row in rows for door in row["named_doors"])
    assert " s old" in rows[0]["named_doors"][0]["reason"]
    assert {door["name"] for row in rows for door in row.get("doors", ())} == {"unknown door"}


def named_report() -> CameraReport:
    watch = CameraWatch(WatchSettings(), SeesDoor(DoorState.OPEN), day_time=DayTime())
    doors = LiveDoors(LISTED.doors, SeesDoor(DoorState.OPEN))
    report = watch.answer(frame(1), Counts(grabbed=1))
    return replace(report, named=doors.follow(report.door, report.points, AT_ORIGIN))


def test_names_are_printed_and_published(capsys: pytest.CaptureFixture[str]) -> None:
    report, publisher = named_report(), Publisher()
    watch_output.LinePrinter()(report)
    printed = capsys.readouterr().out
    assert "front: open" in printed
    assert "unknown door: open" in printed
    assert "lab: not seen" in printed
    list(_publish([report], publisher))  # type: ignore[arg-type]
    assert publisher.doors == ["front", "lab"]
    assert [line.plain.split()[0] for line in watch_output._doors(report, 24)] == ["front", "unknown"]


def test_near_is_bright_far_is_dark_and_nothing_is_black() -> None:
    wall = frame(1)
    wall.depth[:, :2], wall.depth[:, 6:] = 900, 4900
    wall.depth[:2] = 0
    pixels = depth_pixels(wall, 4, 3).astype(int).sum(axis=2)
    assert (pixels[0] == 0).all()
    assert pixels[1, 0] > pixels[1, 1] > pixels[1, 3] > 0
    metres = replace(
        wall, depth=np.where(wall.depth == 0, np.nan, wall.depth / 1000).astype(np.float32), depth_scale_m=1
    )
    assert np.abs(depth_pixels(metres, 4, 3).astype(int).sum(axis=2) - pixels).max() <= 3


def test_frames_of_doors_are_drawn_where_the_camera_sees_them() -> None:
    wall = frame(1)
    camera = wall.intrinsics
    x_m = (2.0 - camera.cx) * 2 / camera.fx
    line = Line("door frame", np.array([[x_m, -1.0, 2.0], [x_m, 1.0, 2.0], [x_m, 1.0, -2.0]]))
    pixels = depth_pixels(wall, 8, 6)
    draw_line(pixels, line, camera, (1, 2, 3))
    assert set(np.argwhere((pixels == [1, 2, 3]).all(axis=2))[:, 1]) == {2}
    door = Door(2.0, 0.4, 90.0, 0.9, DoorState.OPEN)
    prediction = Prediction.from_doors([door], [], 100, 1.0)
    picture = depth_picture(wall, replace(one_report().door, prediction=prediction, lines=(line,)), 8, 3)
    assert len(picture.plain.splitlines()) == 3
    green = [span.start for span in picture.spans if "#3ce16e" in str(span.style)]
    assert {start % 9 for start in green} == {2}

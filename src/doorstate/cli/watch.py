# SPDX-License-Identifier: Apache-2.0
"""`doorstate watch`."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.choices import CAMERA
from doorstate.cli.mqtt_options import MqttOptions, with_mqtt_options
from doorstate.cli.named_options import NamedOptions, with_live_named_options
from doorstate.cli.options import (
    AsJson,
    BudgetMs,
    DoorBox,
    DoorKnownFlag,
    DoorPose,
    NetworkNames,
    OpenBrowser,
    PointCount,
    RuleNames,
    Threads,
    WeightsFiles,
)
from doorstate.cli.reading_options import CameraHeight, Pitch, Roll
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from doorstate.cameras.device import DepthFrame
    from doorstate.cameras.grabber import FrameGrabber
    from doorstate.cameras.watcher import CameraReport
    from doorstate.cli.named_options import CameraPoses
    from doorstate.cli.watch_output import Show
    from doorstate.doors.live_doors import LiveDoors
    from doorstate.mqtt.publisher import MqttPublisher

_SIZE = re.compile(r"(\d{1,5})x(\d{1,5})")


@with_mqtt_options
@with_live_named_options
def watch(
    camera: Annotated[
        str | None,
        typer.Option("--camera", parser=CAMERA, metavar="NAME", help="Kind of camera: {cameras}."),
    ] = None,
    serial: Annotated[
        str, typer.Option(help="Serial number of the camera. [default: the first one]", show_default=False)
    ] = "",
    size: Annotated[
        str | None,
        typer.Option(metavar="WIDTHxHEIGHT", help="Size of depth images in pixels, such as 640x480."),
    ] = None,
    fps: Annotated[int | None, typer.Option(help="Images a second that the camera takes.", min=1)] = None,
    list_attached: Annotated[
        bool, typer.Option("--list", help="List the cameras that are attached.")
    ] = False,
    play: Annotated[
        Path | None,
        typer.Option(
            help="File recorded by the vendor's own software, in place of a camera: realsense, orbbec."
        ),
    ] = None,
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    rule: RuleNames = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    threads: Threads = None,
    accelerometer: Annotated[
        bool,
        typer.Option(
            "--accelerometer/--no-accelerometer",
            help="Take the tilt from the camera's accelerometer, or leave it to be found in the cloud.",
        ),
    ] = True,
    roll: Roll = None,
    pitch: Pitch = None,
    camera_height: CameraHeight = None,
    door_known: DoorKnownFlag = False,
    door_pose: DoorPose = None,
    door_box: DoorBox = None,
    record: Annotated[
        Path | None, typer.Option(help="Record all images to this .bag (ROS 1) or .mcap (ROS 2) file.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show clouds and doors in the browser.")] = False,
    port: Annotated[
        int, typer.Option(help="With --view: port of the page; 0 chooses a free one.", min=0, max=65535)
    ] = 0,
    open_browser: OpenBrowser = True,
    as_json: AsJson = False,
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop after this time. [default: at Ctrl-C]", min=0.1, show_default=False),
    ] = None,
    *,
    named: NamedOptions,
    mqtt: MqttOptions,
) -> None:
    """Watch over a door with a depth camera that is attached to this machine.

    The newest image is answered, and older ones are dropped. A camera that is unplugged is looked for until it is back.
    With a list of doors and the poses of the camera, each door has its name; one out of view is not seen.

    \b
    Examples:
      doorstate watch --camera simulated
      doorstate watch --list
      doorstate watch --camera realsense --fps 15 --record door.bag
      doorstate watch --camera oak --view
      doorstate watch --camera orbbec --serial CP12345 --json
      doorstate watch --camera simulated --serial loose-cable --view --no-open
      doorstate watch --camera realsense --mqtt mqtts://robot@broker.local --mqtt-camera hall
      doorstate watch --camera oak --doors doors.yaml --camera-pose '2.5 0.4 90' --history doors.sqlite
      localisation | doorstate watch --camera realsense --doors doors.yaml --poses - --json
    """
    from doorstate.cameras.clock import DayTime
    from doorstate.cameras.device import CameraRequest
    from doorstate.cameras.grabber import FrameGrabber
    from doorstate.cameras.recording import record_bag
    from doorstate.cameras.registry import make_camera
    from doorstate.cameras.watcher import FRAME_ID, CameraWatch
    from doorstate.cli.console import native_output_on_stderr
    from doorstate.cli.predictors import Methods, load_predictor
    from doorstate.cli.watch_output import print_attached, show_reports
    from doorstate.inference.watch_settings import parse_settings

    if list_attached:
        with native_output_on_stderr():
            print_attached()
        return
    if camera is None:
        raise ConfigError("--camera names the kind of camera; --list lists the cameras that are attached")
    if not view and port:
        raise ConfigError("--port needs --view")
    if view and as_json:
        raise ConfigError("--json cannot be combined with --view")
    methods = Methods(network, weights, rule)
    if named.doors is not None and (door_known or door_pose or door_box):
        raise ConfigError(
            "--doors asks for its own doors: leave --door-known, --door-pose and --door-box out"
        )
    settings = parse_settings(
        {
            "door_known": door_known,
            "door_pose": door_pose or "",
            "door_box": door_box or "",
            "roll": roll or 0.0,
            "pitch": pitch or 0.0,
            "camera_height": camera_height or 0.0,
            "tilt": "auto" if roll is None and pitch is None else "given",
        }
    )
    request = CameraRequest(serial, _parse_size(size), fps, play)
    day_time = DayTime()
    with ExitStack() as stack:
        stack.enter_context(native_output_on_stderr())
        device = make_camera(camera)
        recorder = None if record is None else stack.enter_context(record_bag(record, FRAME_ID))

        def keep(frame: DepthFrame) -> None:
            if recorder is not None:
                recorder.write(frame, day_time.stamp_ns(frame.captured_s))

        grabber = stack.enter_context(FrameGrabber(device, request, on_frame=keep))
        predictor = load_predictor(methods, points, budget_ms=budget_ms, threads=threads)
        doors = stack.enter_context(named.open_live(predictor))
        watched = CameraWatch(settings, predictor, accelerometer=accelerometer, day_time=day_time)
        publisher = stack.enter_context(mqtt.open())
        with show_reports(
            predictor, as_json=as_json, view=view, port=port, open_browser=open_browser
        ) as show:
            reports = _name(watched.follow(grabber), doors, named.poses)
            answered = _follow(_publish(reports, publisher), show, seconds)
    _print_end(grabber, answered, None if recorder is None else recorder.frames, record)


def _name(
    reports: Iterable[CameraReport], doors: LiveDoors | None, poses: CameraPoses | None
) -> Iterator[CameraReport]:
    """Yield the reports, with the doors of a list where there is one."""
    for report in reports:
        if doors is None or poses is None:
            yield report
            continue
        camera = poses.at(report.door.stamp_ns / 1e9)
        yield replace(report, named=doors.follow(report.door, report.points, camera))


def _publish(reports: Iterable[CameraReport], publisher: MqttPublisher | None) -> Iterator[CameraReport]:
    """Yield the reports, and publish those of frames; a camera that is gone is unknown at once, and then offline."""
    from doorstate.mqtt.status import status_of_front_door, status_of_sighting

    for report in reports:
        is_news = report.frame is not None or any(notice.code == "camera_gone" for notice in report.notices)
        if publisher is not None and is_news:
            statuses = [status_of_front_door(report.door.prediction, report.door.filtered)]
            if report.named is not None:
                statuses = [status_of_sighting(sighting) for sighting in report.named.sightings]
            publisher.update(statuses, report.latency_s)
        yield report


def _follow(reports: Iterable[CameraReport], show: Show, seconds: float | None) -> int:
    """Show reports until the time is up, the recording ends or Ctrl-C is pressed; return the number of answers."""
    from doorstate.cameras.clock import steady_s
    from doorstate.cli.signals import accept_signal

    answered, started_s = 0, steady_s()
    try:
        for report in reports:
            answered += report.frame is not None
            show(report)
            if seconds is not None and steady_s() - started_s >= seconds:
                break
    except KeyboardInterrupt:
        accept_signal()
    return answered


def _print_end(grabber: FrameGrabber, answered: int, recorded: int | None, path: Path | None) -> None:
    from doorstate.cli.console import stderr
    from doorstate.cli.prediction_summary import count

    counts = grabber.counts
    parts = [f"stopped: {count(counts.grabbed, 'image')}, {answered} answered, {counts.dropped} dropped"]
    if counts.losses:
        parts.append(f"the camera was gone {count(counts.losses, 'time')}")
    if recorded is not None:
        parts.append(f"{recorded} written to {path}")
    stderr.print("; ".join(parts))


def _parse_size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = _SIZE.fullmatch(text.lower())
    if match is None:
        raise ConfigError(
            f"{text!r} is no size", field="size", expected="WIDTHxHEIGHT in pixels, such as 640x480"
        )
    return int(match[1]), int(match[2])

# SPDX-License-Identifier: Apache-2.0
"""Output of `doorstate watch`: a picture and the doors in a terminal, lines, JSON, or a page in the browser."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, Any

from rich.console import Group
from rich.live import Live
from rich.text import Text

from doorstate.cli import console
from doorstate.cli.flags import format_flag
from doorstate.cli.prediction_table import STATE_STYLES, door_drawing, not_seen_lines, side_of
from doorstate.types import DoorState

if TYPE_CHECKING:
    from doorstate.cameras.watcher import CameraReport, Notice
    from doorstate.inference.door import Door
    from doorstate.inference.predictor import Predictor

Show = Callable[["CameraReport"], None]

_PERIOD_S = 0.2  # between pictures in terminal and browser
_PICTURE_COLUMNS = 80
_TEXT_ROWS = 7  # below the picture, without the doors
_ROWS_OF_DRAWING = 38  # of a terminal that has room for picture and plan
_WORDS = {
    "camera_opened": "camera",
    "camera_gone": "no camera",
    "clock_jumped": "the clock was set",
    "tilt_not_used": "the tilt is left to the cloud",
}


@contextmanager
def show_reports(
    predictor: Predictor, *, as_json: bool, view: bool, port: int, open_browser: bool
) -> Iterator[Show]:
    """Yield a function that shows a report.

    Args:
        predictor: network or rule, named on the page.
        as_json: print JSON lines.
        view: show a page in the browser.
        port: port of the page; 0 chooses a free one.
        open_browser: False only prints the address of the page.
    """
    if as_json:
        yield _print_json
    elif view:
        with _page(predictor, port, open_browser) as show:
            yield show
    elif console.stdout.is_terminal:
        with Live(console=console.stdout, auto_refresh=False) as live:
            yield _limited(lambda report: live.update(describe(report), refresh=True))
    else:
        yield LinePrinter()


def print_attached() -> None:
    """Print a table of the attached cameras, and on standard error why others could not be looked for."""
    from doorstate.cameras.registry import list_cameras

    found, problems = list_cameras()
    console.print_table("", ["camera", "serial", "name"], [list(camera) for camera in found])
    for kind, error in problems.items():
        console.stderr.print(f"{kind}: {error.describe(format_flag)}", style="yellow")


class LinePrinter:
    """Prints a line where the state, the reason or the number of doors has changed."""

    def __init__(self) -> None:
        self._last: object = None

    def __call__(self, report: CameraReport) -> None:
        """Print a report that tells something new."""
        for notice in report.notices:
            console.stdout.print(f"{_clock_time(report)}  {_notice_text(notice)}")
        prediction = report.door.prediction
        code = prediction.abstention and prediction.abstention.code
        told = (report.door.state, prediction.state, code, len(prediction.doors), _labels(report))
        if told == self._last:
            return
        self._last = told
        texts = zip(_names(report), prediction.doors, strict=True)
        doors = [f"{name}: {_door_text(door)}" if name else _door_text(door) for name, door in texts]
        parts = [
            _clock_time(report),
            f"{_over_time(report):<22}",
            "; ".join([*(doors or filter(None, [prediction.reason])), *_not_seen(report)]),
            _latency(report),
        ]
        console.stdout.print("  ".join(filter(None, parts)))


def describe(report: CameraReport) -> Group:
    """Return the picture of a report, its doors, and what is known of camera and time."""
    from doorstate.cli.depth_picture import depth_picture

    door = report.door
    parts: list[Text] = []
    width, height = console.stdout.size
    doors = _doors(report, height)
    if report.frame is not None:
        rows = max(4, height - _TEXT_ROWS - len(doors))
        parts.append(depth_picture(report.frame, door, min(width, _PICTURE_COLUMNS), rows))
    parts.append(Text(_over_time(report), STATE_STYLES.get(door.state, "bold")))
    parts += doors
    parts += [Text(f"  {line}", "dim") for line in _not_seen(report)]
    if reason := door.prediction.reason:
        parts.append(Text(f"  {reason}", "dim"))
    counts = report.counts
    facts = [_tilt(report), _latency(report), f"dropped {counts.dropped} of {counts.grabbed}"]
    parts.append(Text(" · ".join(filter(None, facts)), "dim"))
    return Group(*parts, *(Text(_notice_text(notice), "yellow") for notice in report.notices))


def _doors(report: CameraReport, height: int) -> list[Text]:
    """Return the doors from above where there is room, else a line for each."""
    from doorstate.inference.serialization import door_to_dict

    doors, names = report.door.prediction.doors, _names(report)
    if doors and height >= _ROWS_OF_DRAWING:
        records = [
            door_to_dict(door) | ({"name": name} if name else {})
            for name, door in zip(names, doors, strict=True)
        ]
        if drawing := door_drawing(records):
            return drawing
    return [
        Text(f"  {name or number}  {_door_text(one)}", STATE_STYLES.get(str(one.state), ""))
        for number, (name, one) in enumerate(zip(names, doors, strict=True), 1)
    ]


def _names(report: CameraReport) -> list[str]:
    """Return the name of each door of the prediction; empty texts without a list of doors."""
    from doorstate.doors.sighting import UNKNOWN_DOOR

    if report.named is None:
        return [""] * len(report.door.prediction.doors)
    return [name or UNKNOWN_DOOR for name in report.named.names]


def _labels(report: CameraReport) -> list[str]:
    return [] if report.named is None else [sighting.label for sighting in report.named.sightings]


def _not_seen(report: CameraReport) -> list[str]:
    """Return lines for the doors of a list that the image does not show."""
    if report.named is None:
        return []
    return not_seen_lines([sighting.to_dict(format_flag) for sighting in report.named.sightings])


def _limited(show: Show) -> Show:
    """Return a function that shows a report at most every fifth of a second, but each with a notice."""
    due_s = 0.0

    def show_if_due(report: CameraReport) -> None:
        nonlocal due_s
        if time.monotonic() < due_s and not report.notices:
            return
        due_s = time.monotonic() + _PERIOD_S
        show(report)

    return show_if_due


def _print_json(report: CameraReport) -> None:
    from doorstate.doors.sighting import names_of_doors
    from doorstate.inference.serialization import prediction_to_dict

    door = report.door
    record: dict[str, Any] = {
        "stamp_s": round(door.stamp_ns / 1e9, 6),
        "over_time": {
            "state": None if door.filtered.state is None else str(door.filtered.state),
            "probabilities": {name: round(p, 6) for name, p in door.filtered.probabilities.items()},
            "held_s": None if door.held_s is None else round(door.held_s, 3),
            "is_open": door.is_open,
        },
        "latency_ms": round(report.latency_s * 1000, 1),
        "grabbed": report.counts.grabbed,
        "dropped": report.counts.dropped,
        "notices": [{"code": notice.code, "text": notice.text} for notice in report.notices],
    }
    values = prediction_to_dict(door.prediction, format_flag, door.pose)
    if report.named is not None:
        values = names_of_doors(values, report.named.names)
        values["named_doors"] = [sighting.to_dict(format_flag) for sighting in report.named.sightings]
    console.print_json(record | values)


@contextmanager
def _page(predictor: Predictor, port: int, open_browser: bool) -> Iterator[Show]:
    from doorstate.cli.view_output import open_in_browser
    from doorstate.errors import CameraGoneError
    from doorstate.viewer.cloud_page import make_live_entry, render_cloud_page
    from doorstate.viewer.live_page import LivePage
    from doorstate.viewer.named_clouds import NamedCloud

    with LivePage(render_cloud_page(predictor, [], live=True), port) as page:
        print(page.address, flush=True)  # noqa: T201
        console.stderr.print("press Ctrl-C to stop")
        if open_browser:
            open_in_browser(page.address)

        def show(report: CameraReport) -> None:
            prediction = report.door.prediction
            cloud = CameraGoneError(prediction.reason) if report.points is None else report.points
            named = NamedCloud(_clock_time(report), cloud, pose=report.door.pose)
            facts = [("over time", _over_time(report)), ("latency", _latency(report, ""))]
            facts += [("notice", _notice_text(notice)) for notice in report.notices]
            facts += [("doors", line) for line in _not_seen(report)]
            names = () if report.named is None else report.named.names
            page.publish("cloud", make_live_entry(prediction, named, facts, format_flag, names))

        yield _limited(show)
        page.publish("end", None)


def _clock_time(report: CameraReport) -> str:
    return datetime.fromtimestamp(report.door.stamp_ns / 1e9).strftime("%H:%M:%S.%f")[:-5]


def _over_time(report: CameraReport) -> str:
    door = report.door
    if door.filtered.state is None:
        return "unknown"
    held = "" if door.held_s is None else f" for {door.held_s:.1f} s"
    return f"{door.state.replace('_', '-')} {door.filtered.probabilities[door.filtered.state]:.0%}{held}"


def _door_text(door: Door) -> str:
    if door.state is None:
        what = f"door without a state ({door.reason})"
    else:
        angle = "" if door.opening_angle_deg is None else f" {door.opening_angle_deg:.0f}°"
        is_passable = door.passable_width_m is not None and door.state is not DoorState.CLOSED
        passable = f", passable {door.passable_width_m:.2f} m" if is_passable else ""
        what = f"{door.state.replace('_', '-')}{angle}{passable}"
    return f"{what}, {door.distance_m:.1f} m, {side_of(door.bearing_deg)}"


def _tilt(report: CameraReport) -> str:
    tilt, pose = report.door.prediction.tilt, report.door.pose
    if tilt is not None:
        return f"camera {_degrees(tilt.pitch_deg, tilt.roll_deg)} ({tilt.source})"
    if pose is None or not pose.is_tilt_known:
        return ""
    return f"camera {_degrees(pose.pitch_deg, pose.roll_deg)} ({pose.tilt_from})"


def _degrees(pitch_deg: float, roll_deg: float) -> str:
    turns = [
        f"{abs(pitch_deg):.0f}° {'down' if pitch_deg > 0 else 'up'}" if round(pitch_deg) else "",
        f"{abs(roll_deg):.0f}° {'clockwise' if roll_deg > 0 else 'counter-clockwise'}"
        if round(roll_deg)
        else "",
    ]
    return ", ".join(filter(None, turns)) or "level"


def _latency(report: CameraReport, label: str = "latency ") -> str:
    return "" if report.frame is None else f"{label}{report.latency_s * 1000:.0f} ms"


def _notice_text(notice: Notice) -> str:
    return f"{_WORDS[notice.code]}: {notice.text}"

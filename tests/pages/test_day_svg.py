# SPDX-License-Identifier: Apache-2.0
"""Picture of a day of doors."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from xml.etree import ElementTree
from zoneinfo import ZoneInfo

from doorstate.doors.intervals import StateInterval
from doorstate.pages.colors import STATE_COLORS
from doorstate.pages.day_svg import day_bounds, day_svg

SVG = "{http://www.w3.org/2000/svg}"
DAY = datetime(2026, 5, 4, 15, 30, tzinfo=UTC)
START_S = datetime(2026, 5, 4, tzinfo=UTC).timestamp()


def test_bars_are_where_their_times_are() -> None:
    hours = [("hall <1>", "open", 6, 12), ("hall <1>", "closed", 12, 30), ("shed", "open", -5, -1)]
    intervals = [
        StateInterval(door, state, START_S + 3600 * first, START_S + 3600 * last)
        for door, state, first, last in hours
    ]
    root = ElementTree.fromstring(day_svg(intervals, ["hall <1>", "shed"], DAY))
    tracks = [
        bar for bar in root.iter(f"{SVG}rect") if bar.get("class") == "track" and bar.get("height") == "16"
    ]
    assert len(tracks) == 2
    left, width = (float(tracks[0].get(name, "0")) for name in ("x", "width"))
    bars = [bar for bar in root.iter(f"{SVG}rect") if bar.get("fill") and bar.get("height") == "16"]
    places = [
        (bar.get("fill"), (float(bar.get("x", "0")) - left) / width, float(bar.get("width", "0")) / width)
        for bar in bars
    ]
    assert [(color, round(start, 2), round(length, 2)) for color, start, length in places] == [
        (STATE_COLORS["open"], 0.25, 0.25),
        (STATE_COLORS["closed"], 0.5, 0.5),
    ]
    assert "hall <1>" in {"".join(text.itertext()) for text in root.iter(f"{SVG}text")}


def test_a_day_of_a_clock_change_has_its_hours() -> None:
    day = datetime(2026, 3, 29, 12, tzinfo=ZoneInfo("Europe/Berlin"))
    first_s, last_s = day_bounds(day)
    assert timedelta(seconds=last_s - first_s) == timedelta(hours=23)
    assert day_svg([], [], day).startswith("<svg")

# SPDX-License-Identifier: Apache-2.0
"""Doors with names from above, and the states of doors over a day; both as the commands write them."""

from __future__ import annotations

import base64
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from tests.headless_chromium import open_browser_page

from doorstate.doors.intervals import StateInterval
from doorstate.doors.sighting import View
from doorstate.inference.predictor import Predictor
from doorstate.pages.day_svg import day_bounds, day_svg
from doorstate.pages.plan import make_plan, plan_walls
from doorstate.pages.plan_svg import plan_svg
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS

_SEED, _INDEX, _SAMPLE, _SENSOR = 11, 5, 2, "d435"
_NAMES = ("kitchen", "store")
_DAY = datetime(2026, 5, 4, tzinfo=UTC)
# Made up, in hours of the day.
_HOURS = {
    "kitchen": ((7.5, 8.2, "closed"), (8.2, 9.6, "open"), (11.4, 13.1, "open"), (13.1, 17.3, "semi_open")),
    "store": ((7.6, 9.9, "closed"), (11.2, 12.4, "closed"), (12.4, 12.9, "open"), (12.9, 17.4, "closed")),
}
_HEIGHT_PX = 330


def draw() -> bytes:
    """Return both pictures side by side as PNG."""
    images = "".join(
        f'<img height="{height}" src="data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}">'
        for svg, height in ((_plan(), _HEIGHT_PX), (_day(), 105))
    )
    style = "margin:0;width:max-content;height:max-content;display:flex;align-items:center;gap:10px"
    with tempfile.TemporaryDirectory() as folder, open_browser_page() as (page, _):
        path = Path(folder) / "page.html"
        path.write_text(f'<!doctype html><body style="{style}">{images}', encoding="utf-8")
        page.goto(path.as_uri())
        return page.locator("body").screenshot()


def _plan() -> str:
    _, frames = simulate_rows(PRESETS["two-doors"], _SEED, _INDEX, _SENSOR)
    points = frames[_SAMPLE].points
    prediction = Predictor.load()(points, is_level=True)
    floor_z_m = prediction.doors[0].floor_z_m or 0.0
    view = View.of(points)
    return plan_svg(
        make_plan(
            prediction,
            _NAMES[: len(prediction.doors)],
            plan_walls(points, floor_z_m),
            (view.right_deg, view.left_deg),
        )
    )


def _day() -> str:
    start_s, _ = day_bounds(_DAY)
    intervals = [
        StateInterval(door, state, start_s + 3600 * first, start_s + 3600 * last)
        for door, hours in _HOURS.items()
        for first, last, state in hours
    ]
    return day_svg(intervals, list(_HOURS), _DAY)

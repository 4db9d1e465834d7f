# SPDX-License-Identifier: Apache-2.0
"""Page of `doorstate view` in Chromium, with the predicted door over a cloud."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tests.headless_chromium import open_browser_page

from doorstate.inference.predictor import Predictor
from doorstate.viewer.cloud_page import make_entry, render_cloud_page
from doorstate.viewer.named_clouds import find_named_clouds

from .. import paths

EVERY, SELECTED = 121, 27  # every 121st sample is listed, and the 27th of these is shown
REPEATS = 20  # of the selected prediction: the fastest one is least disturbed by other processes


def draw() -> bytes:
    """Return a screenshot as PNG; it shows a time, so run it on an idle machine."""
    predictor = Predictor.load(backend="torch")  # shows which points decided
    predictor.warm_up()
    readers = find_named_clouds([paths.RESULTS / "datasets" / "ogurob-4096"])[::EVERY]
    entries = [make_entry(predictor, read()) for read in readers]
    selected = readers[SELECTED - 1]()
    entries[SELECTED - 1] = min(
        (make_entry(predictor, selected) for _ in range(REPEATS)),
        key=lambda entry: float(entry["prediction"]["milliseconds"]),
    )
    html = render_cloud_page(predictor, entries)
    with tempfile.TemporaryDirectory() as folder, open_browser_page() as (page, _):
        path = Path(folder) / "view.html"
        path.write_text(html, encoding="utf-8")
        page.set_viewport_size({"width": 1200, "height": 720})
        page.goto(f"{path.as_uri()}#{SELECTED}")
        page.wait_for_selector("#plot canvas")
        page.click("[data-color=height]")
        page.wait_for_timeout(2000)  # until the cloud is drawn
        return page.screenshot()

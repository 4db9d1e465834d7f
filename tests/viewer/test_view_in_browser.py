# SPDX-License-Identifier: Apache-2.0
"""The cloud page in headless Chromium: buttons, keys, drawing, and no errors in the console."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.pages.colors import PART_COLORS
from doorstate.pages.plan import make_plan
from doorstate.pages.plan_svg import plan_svg
from doorstate.types import DoorState, Part
from doorstate.viewer.cloud_page import Entry, make_entry, render_cloud_page
from doorstate.viewer.live_page import LivePage
from doorstate.viewer.named_clouds import NamedCloud
from tests.headless_chromium import open_browser_page, wait_until

if TYPE_CHECKING:
    from playwright.sync_api import Page

Browser = tuple["Page", list[str]]
LEGEND = "[...document.querySelectorAll('#legend li')].map((item) => item.textContent)"

# Width and height of all that is drawn on the canvas, as shares of its size.
FILLED = """() => {
  const canvas = document.querySelector("#plot canvas");
  const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const [columns, rows] = [new Set(), new Set()];
  for (let i = 3; i < data.length; i += 4) {
    if (data[i]) columns.add(((i - 3) / 4) % width), rows.add(Math.floor((i - 3) / 4 / width));
  }
  return [columns.size / width, rows.size / height];
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser_page() as opened:
        yield opened


def pixels(page: Page) -> np.ndarray:
    """Return the (H, W, 3) screenshot, once two in a row are equal."""
    previous = b""
    for _ in range(100):
        current = page.screenshot()
        if current == previous:
            break
        previous = current
    return np.asarray(Image.open(io.BytesIO(previous)).convert("RGB")).astype(int)


def count_color(color: str, picture: np.ndarray) -> int:
    rgb = [int(color[place : place + 2], 16) for place in (1, 3, 5)]
    return int((np.abs(picture - rgb).max(axis=2) < 40).sum())


def wait_for_text(page: Page, selector: str, text: str) -> None:
    wait_until(page, f"document.querySelector({json.dumps(selector)}).textContent === {json.dumps(text)}")


def test_page_shows_clouds_one_after_the_other(
    browser: Browser, predictor: Predictor, entries: list[Entry], tmp_path: Path
) -> None:
    page, errors = browser
    path = tmp_path / "view.html"
    path.write_text(render_cloud_page(predictor, entries), encoding="utf-8")
    page.goto(path.as_uri())
    wait_until(page, f"({LEGEND}).includes('leaf')")
    assert page.text_content("#name") == "closed door"
    assert "closed" in (page.text_content("#state .badge") or "")
    assert page.locator("#list li").count() == len(entries)
    first = pixels(page)
    assert count_color(PART_COLORS[Part.LEAF], first) > 50, "the canvas is empty"

    page.click("#next")
    wait_for_text(page, "#name", "semi_open door")
    second = pixels(page)
    assert (np.abs(first - second).max(axis=2) > 40)[:, :800].sum() > 500, "the cloud has not changed"
    assert page.evaluate("location.hash") == "#2"
    page.click("[data-color=channels]")
    assert len(page.evaluate(LEGEND)) == 1
    page.keyboard.press("ArrowRight")
    assert page.text_content("#place") == "3 / 5"
    assert page.get_attribute("[data-color=channels]", "aria-pressed") == "true"
    page.click("#list li:nth-child(4) button")
    assert page.text_content("#reason") == entries[3]["prediction"]["reason"]
    assert page.get_attribute("[data-color=height]", "aria-pressed") == "true", "the gate abstained"
    page.keyboard.press("ArrowRight")
    assert page.text_content("#reason") == entries[4]["error"]
    assert page.locator("#plot").is_hidden()
    assert page.locator("#next").is_disabled()
    page.click("#previous")
    page.keyboard.press("ArrowLeft")
    page.click("[data-color=height]")
    assert page.text_content("#place") == "3 / 5"
    assert page.get_attribute("[data-color=height]", "aria-pressed") == "true"
    assert errors == []


def test_cloud_fills_the_canvas_and_turns(
    browser: Browser, predictor: Predictor, entries: list[Entry], tmp_path: Path
) -> None:
    page, errors = browser
    path = tmp_path / "view.html"
    path.write_text(render_cloud_page(predictor, entries[:1]), encoding="utf-8")
    for width, height in ((1280, 800), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        page.goto(path.as_uri())
        wait_until(page, f"({LEGEND}).length > 0")
        pixels(page)
        filled = page.evaluate(FILLED)
        assert max(filled) > 0.75, f"the cloud is small at {width} x {height}"
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        box = page.locator("#plot canvas").bounding_box()
        assert box is not None
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        before = pixels(page)
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] + 120, middle[1])
        page.mouse.up()
        turned = pixels(page)
        assert (np.abs(before - turned).max(axis=2) > 40).sum() > 500, "the cloud has not turned"
        page.mouse.dblclick(*middle)
        page.mouse.move(1, 1)
        assert (np.abs(before - pixels(page)).max(axis=2) > 40).mean() < 0.001, "the view was not reset"
    page.set_viewport_size({"width": 1200, "height": 800})
    assert errors == []


def test_detections_are_drawn(browser: Browser, clouds: list[NamedCloud], tmp_path: Path) -> None:
    page, errors = browser
    rule = RulePredictor.from_name("plane_state")
    path = tmp_path / "rule.html"
    path.write_text(render_cloud_page(rule, [make_entry(rule, clouds[1])]), encoding="utf-8")
    page.goto(path.as_uri())
    wait_until(page, f"({LEGEND}).length > 1")
    assert {"wall", "leaf"} <= set(page.evaluate(LEGEND))
    assert page.locator("[data-color=channels]").is_hidden()
    assert errors == []


def test_live_page_follows_until_the_user_goes_back(
    browser: Browser, predictor: Predictor, entries: list[Entry]
) -> None:
    page, errors = browser
    with LivePage(render_cloud_page(predictor, [], live=True)) as live:
        page.goto(live.address)
        live.publish("cloud", entries[0])
        wait_for_text(page, "#name", "closed door")
        wait_until(page, f"({LEGEND}).length > 0")
        live.publish("cloud", entries[1])
        wait_for_text(page, "#place", "2 / 2")
        page.click("#previous")
        live.publish("cloud", entries[2])
        wait_for_text(page, "#place", "1 / 3")
        page.click("#follow")
        assert page.text_content("#name") == "open/file.pcd"
        live.publish("cloud", entries[4])
        wait_for_text(page, "#name", "broken.pcd")
        live.publish("end", None)
        wait_for_text(page, "#connection", "ended")
    assert errors == []


def test_the_plan_of_the_doors_is_shown_where_there_are_doors(
    browser: Browser, predictor: Predictor, entries: list[Entry], tmp_path: Path
) -> None:
    page, errors = browser
    door = Door(3.0, 0.0, 90.0, 0.9, DoorState.OPEN, hinge="left", opening_angle_deg=80.0)
    plan = plan_svg(make_plan(Prediction.from_doors([door], [], 1, 1.0), ["a <b> & #c%"]))
    path = tmp_path / "view.html"
    path.write_text(render_cloud_page(predictor, [entries[0] | {"plan": plan}, entries[1] | {"plan": ""}]))
    page.goto(path.as_uri())
    wait_until(page, "document.querySelector('#plan').naturalWidth > 100")
    assert page.locator("#plan").is_visible()
    page.keyboard.press("ArrowRight")
    assert not page.locator("#plan").is_visible()
    assert errors == []

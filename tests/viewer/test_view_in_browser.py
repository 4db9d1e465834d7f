# SPDX-License-Identifier: Apache-2.0
"""The view does in headless Chromium what its buttons say, and the console stays empty."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from doorstate.evaluation.views import PART_COLORS
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.types import Part
from doorstate.viewer.cloud_page import look, render_view
from doorstate.viewer.live_page import LivePage
from doorstate.viewer.named_clouds import NamedCloud
from tests.headless_chromium import Browser

Entry = dict[str, Any]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("chromium")) as started:
        yield started


TEXT = "document.querySelector('{}').textContent"
DRAWN = "document.querySelector('#plot').data?.map((trace) => trace.name)"


def pixels(browser: Browser) -> np.ndarray:
    """(H, W, 3) of what is seen, once it has stood still for a moment."""
    last = b""
    for _ in range(100):
        seen = browser.screenshot()
        if seen == last:
            break
        last = seen
    return np.asarray(Image.open(io.BytesIO(last)).convert("RGB")).astype(int)


def count_of(color: str, picture: np.ndarray) -> int:
    wanted = [int(color[place : place + 2], 16) for place in (1, 3, 5)]
    return int((np.abs(picture - wanted).max(axis=2) < 40).sum())


def test_the_page_shows_clouds_and_goes_from_one_to_the_next(
    browser: Browser, viewer: Predictor, entries: list[Entry], tmp_path: Path
) -> None:
    page = tmp_path / "view.html"
    page.write_text(render_view(viewer, entries), encoding="utf-8")
    browser.open(page.as_uri())
    browser.wait_until(f"({DRAWN})?.includes('leaf') && document.querySelector('#plot canvas') !== null")
    assert browser.evaluate(TEXT.format("#name")) == "closed door"
    assert "truth: closed" in browser.evaluate(TEXT.format("#state"))
    assert browser.evaluate("document.querySelectorAll('#list li').length") == len(entries)
    first = pixels(browser)
    assert count_of(PART_COLORS[Part.LEAF], first) > 50, "the canvas is empty"

    browser.click("#next")
    browser.wait_until(f"{TEXT.format('#name')} === 'semi_open door'")
    second = pixels(browser)
    assert (np.abs(first - second).max(axis=2) > 40)[:, :800].sum() > 500, "the cloud has not changed"
    assert browser.evaluate("location.hash") == "#2"
    browser.click("[data-color=channels]")
    assert browser.evaluate(DRAWN) == ["passed over", "looked at", "camera"]
    browser.press("ArrowRight")
    assert browser.evaluate(TEXT.format("#place")) == "3 / 5"
    assert browser.evaluate(DRAWN) == ["passed over", "looked at", "camera"]
    browser.click("#list li:nth-child(4) button")
    assert "glass or missing data" in browser.evaluate(TEXT.format("#reason"))
    assert browser.evaluate(DRAWN) == ["height", "camera"], "no network looked at it"
    browser.press("ArrowRight")
    assert browser.evaluate(TEXT.format("#reason")) == "broken.pcd: is no PCD file"
    assert browser.evaluate(
        "document.querySelector('#plot').hidden && document.querySelector('#next').disabled"
    )
    browser.click("#previous")
    browser.press("ArrowLeft")
    browser.click("[data-color=height]")
    assert browser.evaluate(TEXT.format("#place")) == "3 / 5"
    assert browser.evaluate(DRAWN) == ["height", "camera"]
    assert browser.problems == []


def test_found_shapes_are_drawn(browser: Browser, sightings: list[NamedCloud], tmp_path: Path) -> None:
    rule = RulePredictor.load("plane_state")
    page = tmp_path / "rule.html"
    page.write_text(render_view(rule, [look(rule, sightings[1])]), encoding="utf-8")
    browser.open(page.as_uri())
    names = browser.wait_until(DRAWN)
    assert {"camera", "wall", "leaf"} <= set(names)
    assert browser.evaluate("document.querySelector('[data-color=channels]').hidden")
    assert browser.problems == []


def test_a_live_page_follows_until_somebody_looks_back(
    browser: Browser, viewer: Predictor, entries: list[Entry]
) -> None:
    with LivePage(render_view(viewer, [], live=True)) as live:
        browser.open(live.address)
        live.publish("cloud", entries[0])
        browser.wait_until(f"{TEXT.format('#name')} === 'closed door' && {DRAWN}")
        live.publish("cloud", entries[1])
        browser.wait_until(f"{TEXT.format('#place')} === '2 / 2'")
        browser.click("#previous")
        live.publish("cloud", entries[2])
        browser.wait_until(f"{TEXT.format('#place')} === '1 / 3'")
        browser.click("#follow")
        assert browser.evaluate(TEXT.format("#name")) == "open/file.pcd"
        live.publish("cloud", entries[4])
        browser.wait_until(f"{TEXT.format('#name')} === 'broken.pcd'")
        live.publish("end", None)
        browser.wait_until(f"{TEXT.format('#connection')} === 'ended'")
    assert browser.problems == []

# SPDX-License-Identifier: Apache-2.0
"""Labelling in headless Chromium, by keys and by the mouse."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from doorstate._files import read_csv
from doorstate.dataset.frame_labels import LabelIndex
from doorstate.simulation.frames import Frame
from doorstate.viewer.frame_sources import FolderFrames
from doorstate.viewer.label_page import LabelPage
from doorstate.viewer.label_session import LabelSession
from tests.headless_chromium import open_browser_page, wait_until
from tests.viewer.labelling import FILES, OPTIONS, write_depth_images

if TYPE_CHECKING:
    from playwright.sync_api import Page


@pytest.fixture(scope="module")
def browser() -> Iterator[tuple[Page, list[str]]]:
    with open_browser_page() as opened:
        opened[0].set_viewport_size({"width": 900, "height": 600})  # drawn faster without a graphics card
        yield opened


@contextmanager
def labelling(page: Page, folder: Path) -> Iterator[None]:
    """Open the page of a folder at its first frame."""
    session = LabelSession(FolderFrames(folder, OPTIONS), LabelIndex(folder))
    with ThreadPoolExecutor(1) as worker, LabelPage(session, worker, len(FILES), session.start()) as served:
        page.goto(served.address)
        wait_for_frame(page, FILES[session.start()])
        yield


def wait_for_frame(page: Page, name: str) -> None:
    wait_until(page, f"document.querySelector('#name').textContent === {json.dumps(name)}")


def wait_for_message(page: Page, word: str) -> None:
    wait_until(page, f"document.querySelector('#message').textContent.includes({json.dumps(word)})")


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end, steps=3)
    page.mouse.up()


def labels(folder: Path) -> list[tuple[str, str]]:
    path = folder / "index.csv"
    return [(row["file"], row["state"]) for row in read_csv(path)] if path.exists() else []


LIKELY = "[...document.querySelectorAll('#doors i')].filter((item) => item.textContent).length"


def drop_doors(page: Page, kept: int = 0) -> None:
    """Say one after the other that the likely doors are none, from the last one on."""
    while (count := page.evaluate(LIKELY)) > kept:
        page.evaluate(f"document.querySelectorAll('#doors button')[{count - 1}].click()")
        page.keyboard.press("n")
        if count == 1:  # this was all of the frame
            return
        wait_until(page, f"{LIKELY} < {count}")


def test_a_recording_is_labelled_by_keys(
    browser: tuple[Page, list[str]], frames: list[Frame], tmp_path: Path
) -> None:
    page, errors = browser
    folder = write_depth_images(tmp_path, frames)
    with labelling(page, folder):
        drop_doors(page, kept=1)
        page.keyboard.press("d")
        page.keyboard.type("kitchen")
        page.keyboard.press("Enter")
        page.keyboard.press("c")
        wait_for_frame(page, FILES[1])
        assert labels(folder) == [(FILES[0], "closed")]
        wait_until(page, "!document.querySelector('.accept').hidden")
        assert "closed?" in (page.text_content("#doors") or "")
        page.keyboard.press("Shift+Enter")  # up to the open door
        wait_for_frame(page, FILES[2])
        assert page.evaluate("document.querySelector('.accept').hidden")
        page.keyboard.press("ArrowRight")
        wait_for_frame(page, FILES[3])
        page.keyboard.press("x")
        wait_for_message(page, "last frame")
        assert labels(folder) == [(FILES[0], "closed"), (FILES[1], "closed"), (FILES[3], "unknown")]
        page.keyboard.press("z")
        wait_until(page, "document.querySelector('#labelled').textContent === '2 labelled'")
        assert labels(folder) == [(FILES[0], "closed"), (FILES[1], "closed")]
    assert [row["door"] for row in read_csv(folder / "index.csv")] == ["kitchen", "kitchen"]
    with labelling(page, folder):  # resumes at the third
        drop_doors(page)
        wait_for_frame(page, FILES[3])
        assert labels(folder)[2] == (FILES[2], "no_door")
        page.keyboard.press("Home")
        wait_for_frame(page, FILES[0])
        assert page.text_content("#note") == "labelled before"
        page.keyboard.press("o")
        wait_for_message(page, "Esc")
        page.keyboard.press("Escape")
        wait_until(page, "document.querySelector('#message').hidden")
        assert labels(folder)[0] == (FILES[0], "closed")
        page.keyboard.press("o")
        wait_for_message(page, "Enter")
        page.keyboard.press("Enter")
        wait_for_frame(page, FILES[1])
        assert labels(folder)[0] == (FILES[0], "open")
    assert [error for error in errors if "409" not in error] == []
    errors.clear()


def test_doors_are_dragged_turned_and_drawn(
    browser: tuple[Page, list[str]], frames: list[Frame], tmp_path: Path
) -> None:
    page, errors = browser
    folder = write_depth_images(tmp_path, frames)

    def placed() -> list[dict[str, float]]:
        rows = read_csv(folder / "index.csv")
        return [{name: float(row[name]) for name in row if name.startswith("door_")} for row in rows]

    with labelling(page, folder):
        drop_doors(page, kept=1)
        page.keyboard.press("c")
        wait_for_frame(page, FILES[1])
        page.keyboard.press("ArrowLeft")
        wait_for_frame(page, FILES[0])
        (before,) = placed()
        for _ in range(5):
            page.keyboard.press("Shift+ArrowUp")
        page.keyboard.press(",")
        page.keyboard.press("Shift+ArrowLeft")
        for _ in range(100):  # saved a moment after the last key
            page.wait_for_timeout(50)
            if placed() != [before]:
                break
        (after,) = placed()
        assert after["door_width_m"] == pytest.approx(before["door_width_m"] + 0.1, abs=1e-3)
        assert after["door_yaw_deg"] == pytest.approx(before["door_yaw_deg"] + 2, abs=1e-3)

        # A new door in the plan, right of the other; then it is named open, which writes a second line.
        box = page.locator("#plan").bounding_box()
        assert box is not None
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] - 20)
        drag(page, (middle[0] + 20, middle[1] - 60), (middle[0] + 75, middle[1] - 60))
        wait_until(
            page, "[...document.querySelectorAll('#doors i')].filter((i) => i.textContent).length === 2"
        )
        page.keyboard.press("o")
        wait_for_frame(page, FILES[1])
        assert labels(folder) == [(FILES[0], "closed"), (FILES[0], "open")]
        assert placed()[1]["door_y_m"] < placed()[0]["door_y_m"]

        # A box in the picture, beside all doors, becomes a door with the jambs that were measured there.
        page.keyboard.press("ArrowRight")
        wait_for_frame(page, FILES[2])
        drop_doors(page, kept=1)
        stage = page.locator("#picture").bounding_box()
        assert stage is not None
        count = page.evaluate(LIKELY)
        left = stage["x"] + stage["width"] * 0.12
        drag(
            page, (left, stage["y"] + stage["height"] * 0.3), (left + 100, stage["y"] + stage["height"] * 0.8)
        )
        wait_until(page, f"{LIKELY} === {count + 1}")
        for view in ("cloud", "depth"):
            page.click(f"[data-view={view}]")
            assert page.get_attribute(f"[data-view={view}]", "aria-pressed") == "true"
    assert errors == []


def test_a_frame_that_cannot_be_read_is_passed(
    browser: tuple[Page, list[str]], frames: list[Frame], tmp_path: Path
) -> None:
    page, errors = browser
    folder = write_depth_images(tmp_path, frames)
    (folder / FILES[0]).write_bytes(b"garbage")
    with labelling(page, folder):
        wait_for_message(page, "right arrow")
        page.keyboard.press("c")
        page.keyboard.press("ArrowRight")
        wait_for_frame(page, FILES[1])
        assert labels(folder) == []
        page.keyboard.press("ArrowLeft")
        wait_for_frame(page, FILES[0])
    page.keyboard.press("ArrowRight")
    wait_for_message(page, "ended")
    assert [error for error in errors if "ERR_CONNECTION_REFUSED" not in error] == []

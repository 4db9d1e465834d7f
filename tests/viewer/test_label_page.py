# SPDX-License-Identifier: Apache-2.0
"""Server of the page that labels frames: its frames, and requests that are not from the page."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from doorstate._files import read_csv
from doorstate.dataset.frame_labels import LabelIndex
from doorstate.errors import ConfigError
from doorstate.simulation.frames import Frame
from doorstate.viewer.frame_sources import FolderFrames
from doorstate.viewer.label_page import LabelPage
from doorstate.viewer.label_session import LabelSession
from tests.viewer.labelling import FILES, OPTIONS, write_depth_images

JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def folder(frames: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_depth_images(tmp_path_factory.mktemp("label"), frames)


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[LabelPage]:
    session = LabelSession(FolderFrames(folder, OPTIONS), LabelIndex(folder))
    with ThreadPoolExecutor(1) as worker, LabelPage(session, worker, len(FILES), title="<b>") as served:
        yield served


def ask(page: LabelPage, path: str, content: object = None, **headers: str) -> tuple[int, Any]:
    """Return status and content of a request below the address of the page; an absolute path is asked as it is."""
    address = urlsplit(page.address)
    connection = http.client.HTTPConnection(address.netloc, timeout=60)
    target = path if path.startswith("/") else address.path + path
    if content is None:
        connection.request("GET", target, headers=headers)
    else:
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        connection.request("POST", target, body, headers={**JSON, **headers})
    response = connection.getresponse()
    text = response.read().decode()
    return response.status, json.loads(text) if response.headers[
        "Content-Type"
    ] == "application/json" else text


def test_frames_are_shown_and_labelled(page: LabelPage, folder: Path) -> None:
    status, html = ask(page, "")
    assert status == 200
    assert "&lt;b&gt;" in html
    status, shown = ask(page, "frames/0")
    assert (status, shown["name"], shown["count"]) == (200, FILES[0], 4)
    assert ask(page, "frames/0", {"labels": [{"state": "closed"}]}) == (200, {"saved": True})
    assert read_csv(folder / "index.csv")[0]["state"] == "closed"
    assert ask(page, "undo", {}) == (200, {"number": 0})
    assert ask(page, "undo", {}) == (200, {"number": None})
    status, place = ask(page, "frames/0/place", {"box": [100, 60, 220, 200]})
    assert (status, set(place)) == (200, {"x_m", "y_m", "yaw_deg", "width_m", "floor_z_m"})
    assert ask(page, "frames/4")[0] == ask(page, "frames/4", {"labels": [{"state": "open"}]})[0] == 404
    assert ask(page, "other")[0] == ask(page, "other", {})[0] == 404


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/frames/0", {}),
        ("/wrong/frames/0", {}),
        ("frames/0", {"Host": "door.example"}),
        ("frames/0", {"Host": "door.example:80"}),
        ("frames/0", {"Origin": "https://door.example"}),
        ("frames/0", {"Origin": "http://127.0.0.1:1"}),
        ("frames/0", {"Origin": "null"}),
    ],
)
@pytest.mark.parametrize("content", [None, {"labels": [{"state": "open"}]}])
def test_other_pages_are_refused(
    page: LabelPage, folder: Path, path: str, headers: dict[str, str], content: object
) -> None:
    assert ask(page, path, content, **headers)[0] == 403
    assert not (folder / "index.csv").exists()


@pytest.mark.parametrize(
    ("content", "headers", "expected"),
    [
        ({"labels": [{"state": "open"}]}, {"Content-Type": "text/plain"}, 400),
        (b"{", {}, 400),
        ({"labels": []}, {}, 400),
        ({"labels": [{"state": "ajar"}]}, {}, 400),
        ({"labels": [{"state": "open"}], "path": "/etc"}, {}, 400),
        ({"labels": [{"state": "open", "door": "a" * 101}]}, {}, 400),
        (b'{"labels": [{"state": "open", "place": {"x_m": NaN}}]}', {}, 400),
        (b" " * 100_001, {}, 413),
    ],
)
def test_what_is_no_label_is_refused(
    page: LabelPage, folder: Path, content: object, headers: dict[str, str], expected: int
) -> None:
    assert ask(page, "frames/0", content, **headers)[0] == expected
    assert not (folder / "index.csv").exists()


def test_the_page_may_not_be_framed_or_stored(page: LabelPage) -> None:
    connection = http.client.HTTPConnection(urlsplit(page.address).netloc, timeout=60)
    connection.request("GET", urlsplit(page.address).path)
    headers = connection.getresponse().headers
    assert (headers["X-Frame-Options"], headers["Cache-Control"]) == ("DENY", "no-store")
    assert headers["Referrer-Policy"] == "no-referrer"


def test_a_port_in_use_is_an_error(page: LabelPage) -> None:
    with pytest.raises(ConfigError) as raised, ThreadPoolExecutor(1) as worker:
        LabelPage(page.session, worker, 4, port=urlsplit(page.address).port or 0)
    assert raised.value.field == "port"

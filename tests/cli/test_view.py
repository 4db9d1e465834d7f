# SPDX-License-Identifier: Apache-2.0
"""`doorstate view` as a user meets it: a page on disk or in the browser, a live address, errors of one line."""

from __future__ import annotations

import http.client
import signal
import socket
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

from doorstate.cli import view_output
from tests.hand_made_clouds import image_of_a_rough_wall

Run = Callable[..., tuple[int, str, str]]
CLOUD = image_of_a_rough_wall(20, 25)


@pytest.fixture
def view(run: Run, weights: Path) -> Run:
    """Run `doorstate view`."""
    return partial(run, "view", "--weights", weights)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that a browser was asked for."""
    found: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: not found.append(address))
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three clouds."""
    (tmp_path / "clouds").mkdir()
    for name in ("a", "b", "c"):
        np.save(tmp_path / "clouds" / f"{name}.npy", CLOUD)
    return tmp_path / "clouds"


def test_a_page_is_written_where_asked_and_not_opened(
    view: Run, folder: Path, opened: list[str], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    assert view(folder, "--out", page) == (0, f"{page}\n", "")
    text = page.read_text(encoding="utf-8")
    assert all(f'"name": "{name}.npy"' in text for name in "abc")
    assert opened == []
    assert view(folder, "--out", page, "--every", 2)[0] == 0
    assert '"name": "b.npy"' not in page.read_text(encoding="utf-8")


def test_otherwise_the_browser_is_asked_for_it(view: Run, folder: Path, opened: list[str]) -> None:
    code, out, _ = view(folder / "a.npy")
    assert code == 0
    assert [Path(unquote(urlsplit(address).path)) for address in opened] == [Path(out.strip())]
    assert Path(out.strip()).is_file()
    code, out, _ = view(folder / "a.npy", "--no-open")
    assert Path(out.strip()).is_file()
    assert len(opened) == 1


def test_without_a_browser_the_address_is_said(
    view: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    code, out, err = view(folder / "a.npy")
    assert code == 0
    assert "no browser was found" in err
    assert Path(out.strip()).as_uri() in err


def test_a_file_that_cannot_be_shown_is_one_line_and_the_others_are(
    view: Run, folder: Path, tmp_path: Path
) -> None:
    (folder / "b.npy").write_bytes(b"garbage")
    code, out, err = view(folder, "--out", tmp_path / "page.html")
    assert (code, out) == (1, f"{tmp_path / 'page.html'}\n")
    assert err.startswith("b.npy: damaged")
    assert err.endswith("1 of 3 clouds could not be shown\n")
    code, out, _ = view(folder / "b.npy", "--out", tmp_path / "none.html")
    assert (code, out) == (1, "")
    assert not (tmp_path / "none.html").exists()


def test_a_large_page_is_said_to_be_large(
    view: Run, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_output, "_LARGE_PAGE_BYTES", 1_000_000)
    code, _, err = view(folder, "--out", tmp_path / "page.html")
    assert code == 0
    assert len(err.splitlines()) == 1
    assert "the page has 5 MB" in err
    assert "--every" in err


def test_bags_are_shown_too(view: Run, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from benchmarks.bags import START_NS, cloud, write_bag

    messages = [cloud("/points", CLOUD, START_NS + k * 10**9) for k in range(3)]
    for message in messages:
        message.frame_id = "camera_optical_frame"
    bag = write_bag(tmp_path, "mcap", messages)
    code, _, err = view("--bag", bag, "--every", 2, "--out", tmp_path / "page.html")
    assert code == 0
    assert "is --frame optical missing?" in err
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert [f"170000000{second}.000 s" in text for second in range(3)] == [True, False, True]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def listen_and_stop(port: int, wanted: str, heard: list[str]) -> None:
    """Read events until one says what is wanted, then press Ctrl-C."""
    try:
        for _ in range(600):
            with suppress(ConnectionRefusedError):  # not there yet
                connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
                connection.request("GET", "/events")
                break
            time.sleep(0.05)
        answer = connection.getresponse()
        while wanted not in "".join(heard):
            heard.append(answer.readline().decode())
    finally:
        main_thread = threading.main_thread().ident
        assert main_thread is not None
        signal.pthread_kill(main_thread, signal.SIGINT)


def live(view: Run, wanted: str, *arguments: object) -> tuple[tuple[int, str, str], str]:
    """What the command said, and the events that it sent, until one had what is wanted in it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background ignores the key
    port = free_port()
    heard: list[str] = []
    browser = threading.Thread(target=listen_and_stop, args=(port, wanted, heard))
    browser.start()
    said = view("--live", *arguments, "--port", port)
    browser.join()
    assert said[1] == f"http://127.0.0.1:{port}/\n"
    return said, "".join(heard)


def test_a_folder_is_shown_live_until_ctrl_c(view: Run, folder: Path, opened: list[str]) -> None:
    (code, out, err), heard = live(view, '"name": "c.npy"', folder, "--rate", 50)
    assert (code, err) == (0, "Ctrl-C stops it\nstopped\n")
    assert heard.count("event: cloud\n") == 3
    assert opened == [out.strip()]


def test_a_bag_is_shown_live_to_its_end(view: Run, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from benchmarks.bags import START_NS, cloud, write_bag

    bag = write_bag(tmp_path, "db3", [cloud("/points", CLOUD, START_NS + k * 10**7) for k in range(4)])
    (code, _, _), heard = live(view, "event: end", "--bag", bag, "--every", 2, "--no-open")
    assert code == 0
    assert heard.count("event: cloud\n") == 2
    assert "1700000000.020 s" in heard


@pytest.mark.parametrize(
    ("arguments", "complaint", "expected"),
    [
        ((), "give files, or a recording by --bag", 2),
        (("FOLDER", "--bag", "a.bag"), "give files, or a recording by --bag", 2),
        (("gone.pcd",), "gone.pcd: no such file", 1),
        (("FOLDER", "--topic", "/points"), "are for --bag", 2),
        (("FOLDER", "--port", 8000), "are for --live", 2),
        (("FOLDER", "--rate", 2), "are for --live", 2),
        (("FOLDER", "--out", "page.pdf"), "name a .html file", 2),
        (("FOLDER", "FOLDER", "--live"), "--live takes one folder", 2),
        (("FOLDER/a.npy", "--live"), "--live takes one folder", 2),
        (("FOLDER", "--live", "--out", "page.html"), "leave --out out", 2),
        (("FOLDER", "--rule", "plane_state"), "one answers: give", 2),
        (("FOLDER", "--frame", "sideways"), "sideways", 2),
    ],
)
def test_usage_errors_are_one_line(
    arguments: tuple[object, ...], complaint: str, expected: int, view: Run, folder: Path
) -> None:
    code, out, err = view(*(str(word).replace("FOLDER", str(folder)) for word in arguments))
    assert (code, out) == (expected, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("doorstate: ")
    assert complaint in err

# SPDX-License-Identifier: Apache-2.0
"""`doorstate view`."""

from __future__ import annotations

import http.client
import signal
import socket
import threading
import time
import webbrowser
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

from doorstate.cli import view_output
from tests.cli.helpers import Run, check_error
from tests.hand_made_clouds import image_of_a_rough_wall

CLOUD = image_of_a_rough_wall(20, 25)


@pytest.fixture
def view(run: Run, weights: Path) -> Run:
    """Run `doorstate view`."""
    return partial(run, "view", "--weights", weights)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that were opened in the browser."""
    addresses: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: not addresses.append(address))
    return addresses


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with three clouds."""
    (tmp_path / "clouds").mkdir()
    for name in ("a", "b", "c"):
        np.save(tmp_path / "clouds" / f"{name}.npy", CLOUD)
    return tmp_path / "clouds"


def test_page_is_written_to_out_and_not_opened(
    view: Run, folder: Path, opened: list[str], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    assert view(folder, "--out", page) == (0, f"{page}\n", "")
    text = page.read_text(encoding="utf-8")
    assert all(f'"name": "{name}.npy"' in text for name in "abc")
    assert opened == []
    assert view(folder, "--out", page, "--every", 2)[0] == 0
    assert '"name": "b.npy"' not in page.read_text(encoding="utf-8")


def test_page_without_out_is_opened_in_the_browser(view: Run, folder: Path, opened: list[str]) -> None:
    code, out, _ = view(folder / "a.npy")
    assert code == 0
    assert [Path(unquote(urlsplit(address).path)) for address in opened] == [Path(out.strip())]
    assert Path(out.strip()).is_file()
    code, out, _ = view(folder / "a.npy", "--no-open")
    assert Path(out.strip()).is_file()
    assert len(opened) == 1


def test_address_is_printed_without_a_browser(
    view: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    code, out, err = view(folder / "a.npy")
    assert code == 0
    assert Path(out.strip()).as_uri() in err


def test_damaged_file_is_one_line_and_the_others_are_shown(view: Run, folder: Path, tmp_path: Path) -> None:
    (folder / "b.npy").write_bytes(b"garbage")
    code, out, err = view(folder, "--out", tmp_path / "page.html")
    assert (code, out) == (1, f"{tmp_path / 'page.html'}\n")
    assert err.startswith("b.npy: ")
    assert err.count("b.npy") == 1
    assert err.count("\n") == 2, "the error and the number of errors"
    code, out, _ = view(folder / "b.npy", "--out", tmp_path / "none.html")
    assert (code, out) == (1, "")
    assert not (tmp_path / "none.html").exists()


def test_large_page_warns(view: Run, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view_output, "_LARGE_PAGE_BYTES", 1000)
    code, _, err = view(folder, "--out", tmp_path / "page.html")
    assert code == 0
    assert err.count("\n") == 1
    assert "--every" in err


def test_bag_is_shown(view: Run, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from tests.bag_writer import START_NS, cloud, write_bag

    messages = [cloud("/points", CLOUD, START_NS + k * 10**9) for k in range(3)]
    bag = write_bag(tmp_path, "mcap", messages)
    assert view("--bag", bag, "--every", 2, "--out", tmp_path / "page.html")[0] == 0
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert [f"170000000{second}.000 s" in text for second in range(3)] == [True, False, True]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def listen_and_stop(port: int, last: str, events: list[str]) -> None:
    """Read events until they contain the text `last`, then press Ctrl-C."""
    try:
        for _ in range(600):
            with suppress(ConnectionRefusedError):  # not started yet
                connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
                connection.request("GET", "/events")
                break
            time.sleep(0.05)
        with closing(connection), closing(connection.getresponse()) as response:
            while last not in "".join(events):
                events.append(response.readline().decode())
    finally:
        main_thread = threading.main_thread().ident
        assert main_thread is not None
        signal.pthread_kill(main_thread, signal.SIGINT)


def live(view: Run, last: str, *arguments: object) -> tuple[tuple[int, str, str], str]:
    """Return the result of a live view and its events, stopped after the text `last`."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background processes ignore SIGINT
    port = free_port()
    events: list[str] = []
    browser = threading.Thread(target=listen_and_stop, args=(port, last, events))
    browser.start()
    result = view("--live", *arguments, "--port", port)
    browser.join()
    assert result[1] == f"http://127.0.0.1:{port}/\n"
    return result, "".join(events)


def test_folder_is_shown_live_until_ctrl_c(view: Run, folder: Path, opened: list[str]) -> None:
    (code, out, err), events = live(view, '"name": "c.npy"', folder, "--rate", 50)
    assert (code, err.count("\n")) == (0, 2)
    assert events.count("event: cloud\n") == 3
    assert opened == [out.strip()]


def test_bag_is_shown_live_to_its_end(view: Run, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from tests.bag_writer import START_NS, cloud, write_bag

    bag = write_bag(tmp_path, "db3", [cloud("/points", CLOUD, START_NS + k * 10**7) for k in range(4)])
    (code, _, _), events = live(view, "event: end", "--bag", bag, "--every", 2, "--no-open")
    assert code == 0
    assert events.count("event: cloud\n") == 2
    assert "1700000000.020 s" in events


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        ((), 2, "--bag"),
        (("FOLDER", "--bag", "a.bag"), 2, "--bag"),
        (("gone.pcd",), 1, "gone.pcd"),
        (("FOLDER", "--topic", "/points"), 2, "--topic"),
        (("FOLDER", "--port", 8000), 2, "--port"),
        (("FOLDER", "--rate", 2), 2, "--rate"),
        (("FOLDER", "--out", "page.pdf"), 2, "--out page.pdf"),
        (("FOLDER", "FOLDER", "--live"), 2, "--live"),
        (("FOLDER/a.npy", "--live"), 2, "--live"),
        (("FOLDER", "--live", "--out", "page.html"), 2, "--out"),
        (("FOLDER", "--rule", "plane_state"), 2, "rule"),
        (("FOLDER", "--axes", "sideways"), 2, "sideways"),
    ],
)
def test_usage_errors(
    arguments: tuple[object, ...], expected_code: int, name: str, view: Run, folder: Path
) -> None:
    words = (str(word).replace("FOLDER", str(folder)) for word in arguments)
    check_error(view(*words), expected_code, name)

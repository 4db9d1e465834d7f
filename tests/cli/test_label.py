# SPDX-License-Identifier: Apache-2.0
"""`doorstate label`: what it takes, where it writes, and how it ends."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from doorstate._files import read_csv
from doorstate.cli import label as label_module
from doorstate.dataset.frame_labels import LabelIndex
from tests.cli.helpers import Run, check_error
from tests.hand_made_clouds import image_of_a_rough_wall

CLOUD = image_of_a_rough_wall(30, 40)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "clouds").mkdir()
    for name in ("a", "b"):
        np.save(tmp_path / "clouds" / f"{name}.npy", CLOUD)
    return tmp_path / "clouds"


def start(*arguments: object) -> tuple[subprocess.Popen[str], str]:
    """Start the command, and return its process and the address that it prints."""
    words = [sys.executable, "-m", "doorstate", "label", *map(str, arguments), "--no-open"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def post(address: str, path: str, content: object) -> int:
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=60)
    headers = {"Content-Type": "application/json"}
    connection.request("POST", urlsplit(address).path + path, json.dumps(content), headers)
    return connection.getresponse().status


def test_a_killed_process_loses_nothing_and_the_next_goes_on(folder: Path) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background processes ignore SIGINT
    process, address = start(folder, "--pitch", 0)
    assert post(address, "frames/0", {"labels": [{"state": "open"}]}) == 200
    process.kill()
    process.communicate()
    assert LabelIndex(folder).labels()["a.npy"][0].state == "open"
    process, address = start(folder, "--pitch", 0)
    assert urlsplit(address).hostname == "127.0.0.1"
    assert post(address, "frames/1", {"labels": [{"state": "closed"}]}) == 200
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "2 frames" in err
    assert sorted(path.name for path in folder.iterdir()) == ["a.npy", "b.npy", "index.csv"]
    rows = read_csv(folder / "index.csv")
    assert [(row["state"], row["pitch_deg"], row["moment"]) for row in rows] == [
        ("open", "0", "a"),
        ("closed", "0", "a"),
    ]


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Do not serve; the number of frames of each call instead."""
    counts: list[int] = []

    def serve(session: object, worker: object, source: object, *_: object) -> None:
        counts.append(len(source.names))  # type: ignore[attr-defined]

    monkeypatch.setattr(label_module, "_serve", serve)
    return counts


def test_bag_is_labelled_in_a_folder_beside_it(run: Run, served: list[int], tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from tests.bag_writer import START_NS, cloud, write_bag

    bag = write_bag(tmp_path, "bag", [cloud("/points", CLOUD, START_NS + k * 10**9) for k in range(5)])
    code, out, err = run("label", bag, "--every", 2)
    assert (code, out) == (0, "")
    assert err.count("\n") == 1
    assert served == [3]
    assert [path.name for path in tmp_path.iterdir()] == ["test.bag"]
    assert run("label", bag, "--out", tmp_path / "mine")[0] == 0
    check_error(run("label", bag, "--topic", "/other"), 1, "/other")


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        (("gone",), 1, "gone"),
        (("FOLDER/a.npy",), 1, "a.npy"),
        (("FOLDER", "--topic", "/points"), 2, "--topic"),
        (("FOLDER", "--out", "elsewhere"), 2, "--out"),
        (("FOLDER/empty",), 1, "empty"),
    ],
)
def test_usage_errors(
    arguments: tuple[object, ...], expected_code: int, name: str, run: Run, served: list[int], folder: Path
) -> None:
    (folder / "empty").mkdir()
    words = (str(word).replace("FOLDER", str(folder)) for word in arguments)
    check_error(run("label", *words), expected_code, name)
    assert served == []

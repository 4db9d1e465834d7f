# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict --bag` as a user meets it: answers with stamps, files, errors of one line, exit codes."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from benchmarks.bags import START_NS, Message, camera_info, cloud, image, write_bag

from doorstate.networks import create_network
from doorstate.networks.weights import WeightsCard, save_weights
from doorstate.types import STATES
from tests.hand_made_clouds import image_of_a_rough_wall

Run = Callable[..., tuple[int, str, str]]
POINTS = image_of_a_rough_wall(20, 25)
STAMPS = [f"17000000{second}.500000" for second in ("00", "01", "02", "03")]


@pytest.fixture
def predict(run: Run) -> Run:
    """Run `doorstate predict`."""
    return partial(run, "predict")


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained PointNet: quick, and any answer will do."""
    path = tmp_path_factory.mktemp("weights") / "pointnet.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=128))
    return path


def recording(topic: str = "/points") -> list[Message]:
    return [cloud(topic, POINTS, START_NS + 500_000_000 + second * 10**9) for second in range(4)]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path, "mcap", recording())


@pytest.fixture
def partly_bad(tmp_path: Path) -> Path:
    """The second message is damaged, the third is empty."""
    messages = recording()
    messages[1].fields["point_step"] = 0
    messages[2] = cloud("/points", POINTS[:0, 0], messages[2].stamp_ns)
    return write_bag(tmp_path, "bag", messages)


def test_a_table_has_a_row_per_message(predict: Run, weights: Path, bag: Path) -> None:
    code, out, err = predict("--bag", bag, "--topic", "/points", "--weights", weights)
    assert (code, err) == (0, "")
    rows = [line.replace("│", " ").split() for line in out.splitlines() if "│ 17" in line]
    assert [row[0] for row in rows] == STAMPS
    assert {row[1] for row in rows} <= set(STATES)
    assert {row[5] for row in rows} == {"128"}


def test_answers_are_those_of_the_same_cloud_in_a_file(
    predict: Run, weights: Path, bag: Path, tmp_path: Path
) -> None:
    np.save(tmp_path / "cloud.npy", POINTS.reshape(-1, 3))
    of_file = json.loads(predict(tmp_path / "cloud.npy", "--weights", weights, "--json")[1])
    code, out, _ = predict("--bag", bag, "--weights", weights, "--json", "--every", 2)
    answers = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [answer["stamp_s"] for answer in answers] == [1_700_000_000.5, 1_700_000_002.5]
    assert all(answer["probabilities"] == of_file["probabilities"] for answer in answers)
    assert all(set(answer) ^ set(of_file) == {"stamp_s", "file"} for answer in answers)


def test_a_csv_has_answers_and_errors(predict: Run, weights: Path, partly_bad: Path, tmp_path: Path) -> None:
    table = tmp_path / "deep" / "answers.csv"
    code, out, err = predict("--bag", partly_bad, "--weights", weights, "--out", table)
    assert (code, out) == (1, "")
    assert err == "1 of 4 messages could not be answered\n"
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["stamp_s"]) for row in rows] == [float(stamp) for stamp in STAMPS]
    assert [row["error"] != "" for row in rows] == [False, True, False, False]
    assert "within 0 bytes" in rows[1]["error"]
    assert "the cloud is empty" in rows[2]["reason"]
    assert (rows[2]["state"], rows[2]["points"]) == ("", "0")
    assert {rows[1][column] for column in ("state", *STATES, "points", "milliseconds")} == {""}
    assert sum(float(rows[0][state]) for state in STATES) == pytest.approx(1, abs=1e-5)
    assert [path.name for path in table.parent.iterdir()] == ["answers.csv"]


def test_json_lines_in_a_file_are_those_that_json_prints(
    predict: Run, weights: Path, partly_bad: Path, tmp_path: Path
) -> None:
    lines = tmp_path / "answers.jsonl"
    assert predict("--bag", partly_bad, "--weights", weights, "--out", lines)[0] == 1
    code, out, _ = predict("--bag", partly_bad, "--weights", weights, "--json")
    assert code == 1
    written, printed = ([json.loads(line) for line in text.splitlines()] for text in (lines.read_text(), out))
    for answer in written + printed:
        answer.pop("milliseconds", None)
    assert written == printed
    assert set(written[1]) == {"stamp_s", "error"}


def test_errors_of_a_table_are_lines_of_their_own(predict: Run, weights: Path, partly_bad: Path) -> None:
    code, out, err = predict("--bag", partly_bad, "--weights", weights)
    assert code == 1
    assert err.partition(":")[0] == STAMPS[1]
    assert [stamp in out for stamp in STAMPS] == [True, False, True, True]
    assert "none: the cloud is empty" in " ".join(out.split())


def test_answers_before_a_break_are_kept(predict: Run, weights: Path, tmp_path: Path) -> None:
    path = write_bag(tmp_path, "bag", recording())
    first, second, *rest = path.read_bytes().split(b"op=\x02")  # the records that hold messages
    path.write_bytes(b"op=\x02".join([first, second]) + b"op=\x09" + b"op=\x02".join(rest))
    code, out, err = predict("--bag", path, "--weights", weights, "--json")
    good, broken = (json.loads(line) for line in out.splitlines())
    assert code == 1
    assert good["state"] in STATES
    assert broken["stamp_s"] is None
    assert "damaged from here on" in broken["error"]
    assert err == "1 of 2 messages could not be answered\n"
    out_of_table = predict("--bag", path, "--weights", weights)[2]
    assert out_of_table.startswith("-: test.bag: damaged from here on")


def test_rules_see_images(predict: Run, bag: Path) -> None:
    code, out, _ = predict("--bag", bag, "--rule", "open_door", "--json")
    answers = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert len(answers) == 4
    assert all("organized" not in answer.get("reason", "") for answer in answers)


def test_depth_images_are_answered_with_the_camera_named(predict: Run, weights: Path, tmp_path: Path) -> None:
    depth = np.random.default_rng(1).integers(1000, 3000, (20, 25), dtype=np.uint16)
    k = (20, 0, 12, 0, 20, 9.5, 0, 0, 1)
    messages = [image("/depth", depth, "16UC1"), camera_info("/my_camera", 25, 20, k, [0] * 12)]
    path = write_bag(tmp_path, "db3", messages)
    code, _, err = predict("--bag", path, "--weights", weights)
    assert code == 1
    assert "no CameraInfo in /camera_info" in err
    assert len(err.splitlines()) == 1
    code, named, _ = predict(
        "--bag", path, "--weights", weights, "--json", "--camera-info-topic", "/my_camera"
    )
    assert code == 0
    flags = ("--fx", 20, "--fy", 20, "--cx", 12, "--cy", 9.5)
    given = predict("--bag", path, "--weights", weights, "--json", *flags)[1]
    assert json.loads(named)["probabilities"] == json.loads(given)["probabilities"]


def test_an_optical_frame_that_is_read_as_body_is_said_once(
    predict: Run, weights: Path, tmp_path: Path
) -> None:
    messages = recording()
    for message in messages:
        message.frame_id = "camera_depth_optical_frame"
    path = write_bag(tmp_path, "mcap", messages)
    code, _, err = predict("--bag", path, "--weights", weights)
    assert code == 0
    assert err == "/points is in the frame camera_depth_optical_frame: is --frame optical missing?\n"
    assert predict("--bag", path, "--weights", weights, "--frame", "optical")[2] == ""


@pytest.mark.parametrize(
    ("arguments", "complaint", "expected"),
    [
        ((), "give files, or a recording by --bag", 2),
        (("cloud.npy", "--bag", "BAG"), "give files, or a recording by --bag", 2),
        (("cloud.npy", "--topic", "/points"), "are for --bag", 2),
        (("cloud.npy", "--every", 2), "are for --bag", 2),
        (("--bag", "BAG", "--out", "a.jsonl", "--json"), "leave --json out", 2),
        (("--bag", "gone.bag", "--out", "a.txt"), "name a .csv or .jsonl file", 2),
        (("--bag", "gone.bag"), "gone.bag: no such file", 1),
        (("--bag", "BAG", "--topic", "/gone"), "usable are: /points (PointCloud2, 4)", 1),
    ],
)
def test_usage_errors_are_one_line(
    arguments: tuple[object, ...], complaint: str, expected: int, predict: Run, weights: Path, bag: Path
) -> None:
    code, out, err = predict(*(bag if word == "BAG" else word for word in arguments), "--weights", weights)
    assert (code, out) == (expected, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("doorstate: ")
    assert complaint in err


def test_a_recording_that_cannot_be_used_is_told_before_weights_are_looked_for(
    predict: Run, bag: Path, tmp_path: Path
) -> None:
    gone = tmp_path / "gone.safetensors"
    assert "gone.bag: no such file" in predict("--bag", tmp_path / "gone.bag", "--weights", gone)[2]
    assert "usable are" in predict("--bag", bag, "--topic", "/gone", "--weights", gone)[2]
    assert "gone.safetensors" in predict("--bag", bag, "--weights", gone)[2]

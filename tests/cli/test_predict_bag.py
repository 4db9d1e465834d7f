# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict --bag`."""

from __future__ import annotations

import csv
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights
from doorstate.types import STATES
from tests.bag_writer import START_NS, Message, camera_info, cloud, image, write_bag
from tests.cli.helpers import Run, check_error
from tests.hand_made_clouds import image_of_a_rough_wall

POINTS = image_of_a_rough_wall(20, 25)
STAMPS = [f"17000000{second}.500000" for second in ("00", "01", "02", "03")]


@pytest.fixture
def predict(run: Run) -> Run:
    """Run `doorstate predict`."""
    return partial(run, "predict")


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights file of an untrained PointNet, because it is quick."""
    path = tmp_path_factory.mktemp("weights") / "pointnet.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=128))
    return path


def recording(topic: str = "/points") -> list[Message]:
    return [cloud(topic, POINTS, START_NS + 500_000_000 + second * 10**9) for second in range(4)]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path, "mcap", recording())


@pytest.fixture
def faulty_bag(tmp_path: Path) -> Path:
    """Bag with a damaged second and an empty third message."""
    messages = recording()
    messages[1].fields["point_step"] = 0
    messages[2] = cloud("/points", POINTS[:0, 0], messages[2].stamp_ns)
    return write_bag(tmp_path, "bag", messages)


def test_table_has_a_row_for_each_message(predict: Run, weights: Path, bag: Path) -> None:
    code, out, err = predict("--bag", bag, "--topic", "/points", "--weights", weights)
    assert (code, err) == (0, "")
    rows = [line.split() for line in out.splitlines() if line.startswith("17")]
    assert [row[0] for row in rows] == STAMPS
    assert {row[1] for row in rows} <= set(STATES)


def test_predictions_equal_those_of_the_cloud_in_a_file(
    predict: Run, weights: Path, bag: Path, tmp_path: Path
) -> None:
    np.save(tmp_path / "cloud.npy", POINTS)
    from_file = json.loads(predict(tmp_path / "cloud.npy", "--weights", weights, "--json")[1])
    code, out, _ = predict("--bag", bag, "--weights", weights, "--json", "--every", 2)
    rows = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [row["stamp_s"] for row in rows] == [1_700_000_000.5, 1_700_000_002.5]
    assert all(row["probabilities"] == from_file["probabilities"] for row in rows)
    assert all(set(row) ^ set(from_file) == {"stamp_s", "file"} for row in rows)


def test_csv_has_predictions_and_errors(
    predict: Run, weights: Path, faulty_bag: Path, tmp_path: Path
) -> None:
    table = tmp_path / "deep" / "states.csv"
    code, out, err = predict("--bag", faulty_bag, "--weights", weights, "--out", table)
    assert code == 1
    assert out.count("\n") == err.count("\n") == 1
    assert str(table) in out
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["stamp_s"]) for row in rows] == [float(stamp) for stamp in STAMPS]
    assert [row["error"] != "" for row in rows] == [False, True, False, False]
    assert rows[2]["reason"]
    assert (rows[2]["state"], rows[2]["points"]) == ("", "0")
    assert {rows[1][column] for column in ("state", *STATES, "points", "milliseconds")} == {""}
    assert sum(float(rows[0][state]) for state in STATES) == pytest.approx(1, abs=1e-5)
    assert [path.name for path in table.parent.iterdir()] == ["states.csv"]


def test_jsonl_file_holds_the_printed_json_lines(
    predict: Run, weights: Path, faulty_bag: Path, tmp_path: Path
) -> None:
    lines = tmp_path / "states.jsonl"
    assert predict("--bag", faulty_bag, "--weights", weights, "--out", lines)[0] == 1
    code, out, _ = predict("--bag", faulty_bag, "--weights", weights, "--json")
    assert code == 1
    written, printed = ([json.loads(line) for line in text.splitlines()] for text in (lines.read_text(), out))
    for row in written + printed:
        row.pop("milliseconds", None)
    assert written == printed
    assert set(written[1]) == {"stamp_s", "error"}


def test_errors_are_printed_beside_the_table(predict: Run, weights: Path, faulty_bag: Path) -> None:
    code, out, err = predict("--bag", faulty_bag, "--weights", weights)
    assert code == 1
    assert err.partition(":")[0] == STAMPS[1]
    assert [stamp in out for stamp in STAMPS] == [True, False, True, True]
    assert " abstained " in out


def test_predictions_before_damage_are_kept(predict: Run, weights: Path, tmp_path: Path) -> None:
    path = write_bag(tmp_path, "bag", recording())
    first, second, *rest = path.read_bytes().split(b"op=\x02")  # the records that hold messages
    path.write_bytes(b"op=\x02".join([first, second]) + b"op=\x09" + b"op=\x02".join(rest))
    code, out, err = predict("--bag", path, "--weights", weights, "--json")
    good, broken = (json.loads(line) for line in out.splitlines())
    assert code == 1
    assert good["state"] in STATES
    assert broken["stamp_s"] is None
    assert "test.bag" in broken["error"]
    assert err.count("\n") == 1
    err = predict("--bag", path, "--weights", weights)[2]
    assert err.startswith("-: ")
    assert "test.bag" in err


def test_rules_get_organized_clouds(predict: Run, bag: Path) -> None:
    code, out, _ = predict("--bag", bag, "--rule", "open_door", "--json")
    rows = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert len(rows) == 4
    assert all("organized" not in row.get("reason", "") for row in rows)


def test_camera_of_depth_images_from_topic_or_flags(predict: Run, weights: Path, tmp_path: Path) -> None:
    depth = np.random.default_rng(1).integers(1000, 3000, (20, 25), dtype=np.uint16)
    k = (20, 0, 12, 0, 20, 9.5, 0, 0, 1)
    messages = [image("/depth", depth, "16UC1"), camera_info("/my_camera", 25, 20, k, [0] * 12)]
    path = write_bag(tmp_path, "db3", messages)
    code, _, err = predict("--bag", path, "--weights", weights)
    assert code == 1
    assert "/camera_info" in err
    assert err.count("\n") == 1
    code, from_topic, _ = predict(
        "--bag", path, "--weights", weights, "--json", "--camera-info-topic", "/my_camera"
    )
    assert code == 0
    flags = ("--fx", 20, "--fy", 20, "--cx", 12, "--cy", 9.5)
    from_flags = predict("--bag", path, "--weights", weights, "--json", *flags)[1]
    assert json.loads(from_topic)["probabilities"] == json.loads(from_flags)["probabilities"]


def test_axes_are_those_that_the_header_names(predict: Run, weights: Path, tmp_path: Path) -> None:
    messages = recording()
    for message in messages:
        message.frame_id = "camera_depth_optical_frame"
    path = write_bag(tmp_path, "mcap", messages)
    code, named, err = predict("--bag", path, "--weights", weights, "--json")
    assert (code, err) == (0, "")
    poses = [json.loads(line)["sensor_pose"] for line in named.splitlines()]
    assert {(pose["axes"], pose["axes_from"]) for pose in poses} == {("rdf", "frame_id")}
    given = predict("--bag", path, "--weights", weights, "--json", "--axes", "optical")[1]
    timeless = [
        [json.loads(line) | {"milliseconds": 0, "sensor_pose": 0} for line in text.splitlines()]
        for text in (named, given)
    ]
    assert timeless[0] == timeless[1]


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        ((), 2, "--bag"),
        (("cloud.npy", "--bag", "BAG"), 2, "--bag"),
        (("cloud.npy", "--topic", "/points"), 2, "--topic"),
        (("--bag", "BAG", "--out", "a.jsonl", "--json"), 2, "--json"),
        (("--bag", "gone.bag", "--out", "a.txt"), 2, "--out a.txt"),
        (("--bag", "gone.bag"), 1, "gone.bag"),
        (("--bag", "BAG", "--topic", "/gone"), 1, "/points"),
    ],
)
def test_usage_errors(
    arguments: tuple[object, ...], expected_code: int, name: str, predict: Run, weights: Path, bag: Path
) -> None:
    words = (bag if word == "BAG" else word for word in arguments)
    check_error(predict(*words, "--weights", weights), expected_code, name)


def test_bag_is_opened_before_weights_are_loaded(predict: Run, bag: Path, tmp_path: Path) -> None:
    gone = tmp_path / "gone.safetensors"
    check_error(predict("--bag", tmp_path / "gone.bag", "--weights", gone), 1, "gone.bag")
    check_error(predict("--bag", bag, "--topic", "/gone", "--weights", gone), 1, "/gone")
    check_error(predict("--bag", bag, "--weights", gone), 1, "gone.safetensors")

# SPDX-License-Identifier: Apache-2.0
"""Every script in examples/ runs as documented on simulated doors, with correct results."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from doorstate.inference.predictor import Predictor
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import read_cloud
from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.types import STATES

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def example(name: str, *arguments: object, code: int = 0) -> str:
    """Return the standard output of an example that exits with a code."""
    command = [sys.executable, "-W", "error", EXAMPLES / f"{name}.py", *map(str, arguments)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == code, finished.stderr
    return finished.stdout


def thinned(source: Path, names: str, step: int, target: Path) -> Path:
    """Return a folder of labelled clouds with every n-th row and column of the simulated ones."""
    for path in sorted((source / "pcd").rglob(names)):
        write_pcd(target / path.parent.name / path.name, read_cloud(path)[::step, ::step])
    return target


@pytest.fixture(scope="module")
def doors(simulated_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve of each state, 160 x 120 pixels."""
    return thinned(simulated_folder, "*.pcd", 4, tmp_path_factory.mktemp("labelled"))


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of make_bag.py."""
    folder = tmp_path_factory.mktemp("recording") / "door-bag"
    example("make_bag", folder)
    return folder


def test_every_example_is_tested_and_shows_its_command() -> None:
    here = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES.glob("*.py"):
        assert f'example("{path.stem}", ' in here
        assert re.search(
            rf"^    python examples/{path.name} ", path.read_text(encoding="utf-8"), re.MULTILINE
        )


def test_one_cloud_handles_every_kind_of_result(simulated_folder: Path, tmp_path: Path) -> None:
    opened, closed = (  # the first pose sees the door along its wall
        sorted((simulated_folder / "pcd" / state).glob("*.pcd"))[1] for state in ("open", "closed")
    )
    assert example("one_cloud", opened).startswith("open,")
    assert example("one_cloud", closed, code=1).startswith("closed,")
    cloud = read_cloud(opened)
    cloud[:, :320] = np.nan
    write_pcd(tmp_path / "half.pcd", cloud)
    assert example("one_cloud", tmp_path / "half.pcd", code=2)
    (tmp_path / "empty.pcd").touch()
    assert "empty.pcd" in example("one_cloud", tmp_path / "empty.pcd", code=2)


def test_depth_image_estimates_the_angle(tmp_path: Path) -> None:
    preset = PRESETS["ogurob"]
    simulate_dataset(
        tmp_path / "doors", SimulationSettings(preset=preset, seed=3, poses=1, raw=("depth",)), 1
    )
    (picture,) = (tmp_path / "doors" / "depth" / "semi_open").glob("*.png")
    lens = preset.camera.intrinsics()
    (tmp_path / "camera.json").write_text(json.dumps(vars(lens)))
    output = example("depth_image", picture, tmp_path / "camera.json")
    match = re.search(r"semi_open\D+(\d+)", output)
    rows, _ = simulate_rows(preset, 3, int(picture.stem[1:5]))
    assert match
    assert float(match[1]) == pytest.approx(rows[STATES.index("semi_open")].opening_angle_deg, abs=3)


def test_bag_to_csv_has_a_row_for_every_change(bag: Path, tmp_path: Path) -> None:
    table = tmp_path / "changes.csv"
    assert "/camera/depth/image_rect_raw" in example("bag_to_csv", bag, table)
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["state"] for row in rows] == ["closed", "semi_open", "open"]
    # The door begins to open at 3 s, is semi-open from 15 degrees on and open from 75.
    began, semi_open, opened = (float(row["stamp_s"]) - 1_700_000_000 for row in rows)
    assert (began, semi_open, opened) == (0, pytest.approx(3.33, abs=0.4), pytest.approx(4.67, abs=0.4))


def test_stream_follows_the_door_and_waits_for_it(bag: Path) -> None:
    *changes, _ = example("stream", bag).splitlines()
    filtered = [line.rpartition(" ")[2] for line in changes]
    assert list(dict.fromkeys(filtered)) == ["unknown", *STATES]


def test_choose_rule_counts_every_cloud(simulated_folder: Path, tmp_path: Path) -> None:
    first, _, *rows = example("choose_rule", thinned(simulated_folder, "p03*.pcd", 2, tmp_path)).splitlines()
    counts = {name: [int(number) for number in numbers] for name, *numbers in map(str.split, rows)}
    assert first == "9 clouds"
    assert {sum(numbers[:3]) for numbers in counts.values()} == {9}
    assert counts["wall_leaf_angle"][0] == 9
    *_, with_gate, without = zip(*counts.values(), strict=True)
    assert (sum(with_gate), sum(without)) == (0, 1)


def test_train_own_gives_weights_that_predict(doors: Path, tmp_path: Path) -> None:
    options = ("--network", "pointnet", "--points", 128, "--epochs", 1)
    output = example("train_own", doors, "--out", tmp_path / "trained", *options)
    assert re.search(r"macro-F1 0\.\d+ ", output)
    assert re.search(r"\.pcd: (closed|semi_open|open|abstained)\n$", output)


def test_onnx_robot_needs_no_torch(doors: Path, weights: Path, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    exported, recording = tmp_path / "door.onnx", tmp_path / "recording"
    doorstate = Path(sys.executable).with_name("doorstate")
    command = [doorstate, "export", "--weights", weights, "--out", exported, "--clouds", "3"]
    subprocess.run(command, check=True, capture_output=True)
    shutil.copytree(doors / "open", recording)
    *predictions, last = example("onnx_robot", exported, recording).splitlines()
    assert len(predictions) == 12
    assert all(
        re.fullmatch(r"p\d+-open\.pcd: (closed|semi_open|open)( \(late\))?", line) for line in predictions
    )
    assert last.endswith("torch loaded: False")


def test_onnxruntime_only_refuses_what_a_predictor_refuses(frames: list[Frame], tmp_path: Path) -> None:
    exported = tmp_path / "door.onnx"
    command = [Path(sys.executable).with_name("doorstate"), "export", "--points", "512", "--out", exported]
    subprocess.run(
        [*command, "--network", "ogurob-pointnet2", "--clouds", "3"], check=True, capture_output=True
    )
    predictor = Predictor.load(exported)
    seen = [frame.points[::4, ::4] for frame in frames]
    half = seen[0].copy()
    half[:, 70:] = np.nan
    codes = []
    for cloud in (*seen, half, seen[0][::20, ::20], seen[1] * np.float32(0.1), -seen[2]):
        np.save(tmp_path / "cloud.npy", cloud)
        prediction = predictor(cloud)
        code = 0 if prediction.state else 2
        answer = json.loads(example("onnxruntime_only", exported, tmp_path / "cloud.npy", code=code))
        assert answer["state"] == prediction.state
        if prediction.abstention is None:
            assert answer["probability"] == pytest.approx(prediction.probability, abs=0.01)
        else:
            assert answer == {"state": None, "reason": prediction.abstention.code}
            codes.append(prediction.abstention.code)
    assert codes == ["narrow_view", "too_few_points", "too_near", "points_behind_camera"]

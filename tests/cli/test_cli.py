# SPDX-License-Identifier: Apache-2.0
"""The command line as a user meets it: answers, errors of one line, exit codes."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import doorstate
from doorstate.dataset.store import PreparedDataset
from doorstate.io.pcd import write_pcd
from doorstate.networks import list_networks
from doorstate.networks.packaged import packaged_networks
from doorstate.rules import list_rules

Run = Callable[..., tuple[int, str, str]]
REAL = Path(__file__).resolve().parents[2].parent / "shared" / "real"
COMMANDS = (
    "simulate",
    "prepare",
    "train",
    "compare",
    "report",
    "resolution",
    "transfer",
    "predict",
    "evaluate",
    "view",
    "serve",
    "export",
    "export-sdf",
    "info",
)


@pytest.fixture
def cloud() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.stack([rng.uniform(1, 3, 500), rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500)], 1).astype(
        np.float32
    )


def test_help_is_quick_because_it_imports_nothing_heavy() -> None:
    heavy = ("torch", "numpy", "scipy", "sklearn", "pydantic", "matplotlib", "plotly", "lightning_fabric")
    script = f"import sys, doorstate.cli; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_shows_examples(command: str, run: Run) -> None:
    code, out, _ = run(command, "--help")
    assert code == 0
    assert f"doorstate {command}" in out.partition("Examples:")[2].partition("Options:")[0]


def test_help_lists_the_commands(run: Run) -> None:
    code, out, _ = run("--help")
    assert code == 0
    assert all(f"\n  {command} " in out for command in COMMANDS)


def test_wrong_usage_is_exit_code_2(run: Run) -> None:
    assert run("predict", "--nonsense", "x")[0] == 2
    assert run("predct")[0] == 2


def test_info_names_versions_and_networks(run: Run) -> None:
    code, out, _ = run("info", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["doorstate"] == doorstate.__version__
    assert [entry["network"] for entry in found["networks"]] == list_networks()
    assert {entry["parameters"] for entry in found["networks"]} >= {3_470_540, 1_466_179}
    packaged = {entry["network"]: entry["packaged_weights"] for entry in found["networks"]}
    assert "pointnet2" in packaged["pointnet2"]
    assert sum(map(len, packaged.values())) == len(packaged_networks())
    assert run("info")[0] == 0


def test_info_lists_the_rules(run: Run) -> None:
    assert json.loads(run("info", "--json")[1])["rules"] == list_rules()
    out = run("info")[1]
    assert all(name in out for name in list_rules())


def test_predict_prints_a_table(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", cloud)
    write_pcd(tmp_path / "b.pcd", cloud)
    code, out, err = run("predict", tmp_path, "--weights", weights)
    assert code == 0
    assert "a.npy" in out
    assert "b.pcd" in out
    assert err == ""


def test_names_of_files_are_printed_as_they_are(
    run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    for name in ("rec[red]x.npy", ":door:.npy"):
        np.save(tmp_path / name, cloud)
    (tmp_path / "bad[" / "b]").mkdir(parents=True)
    (tmp_path / "bad[" / "b].npy").write_bytes(b"nothing")
    code, out, err = run("predict", tmp_path, "--weights", weights)
    assert code == 1
    assert "rec[red]x.npy" in out
    assert ":door:.npy" in out
    assert "bad[/b].npy" in err


def test_predict_by_a_rule_needs_no_weights_and_may_say_why_not(
    run: Run, simulated_folder: Path, tmp_path: Path
) -> None:
    cloud = sorted((simulated_folder / "pcd" / "closed").glob("*.pcd"))[0]
    code, out, err = run("predict", "--rule", "plane_state", "--json", cloud)
    assert code == 0, err
    answer = json.loads(out)
    assert (answer["state"] is None) == ("reason" in answer)
    code, out, _ = run("predict", "--rule", "open_door", cloud)
    assert code == 0
    assert "none: " in out, "this rule tells open doors only, from images only"
    code, _, err = run("predict", "--rule", "open_door", "--points", 128, cloud)
    assert code == 2
    assert "leave points and time budget out" in err
    assert run("predict", "--rule", "nonsense", cloud)[0] == 2


def test_predict_json_is_one_object_a_line(
    run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    np.save(tmp_path / "a.npy", cloud)
    (tmp_path / "b.npy").write_bytes(b"garbage")
    np.save(tmp_path / "c.npy", cloud[:200])
    code, out, _ = run("predict", tmp_path, "--weights", weights, "--json")
    answers = [json.loads(line) for line in out.splitlines()]
    assert code == 1, "a file could not be answered"
    assert [Path(answer["file"]).name for answer in answers] == ["a.npy", "b.npy", "c.npy"], "the others are"
    good, bad, few = answers
    assert good["state"] in ("closed", "semi_open", "open")
    assert sum(good["probabilities"].values()) == pytest.approx(1, abs=1e-5)
    assert good["state"] == max(good["probabilities"], key=good["probabilities"].__getitem__)
    assert (good["points"], few["points"]) == (256, 200)
    assert good["milliseconds"] > 0
    assert set(bad) == {"file", "error"}


def test_a_name_that_is_no_text_can_be_printed(
    run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    path = tmp_path / os.fsdecode(b"\xff.npy")
    np.save(path, cloud)
    code, out, err = run("predict", path, "--weights", weights, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["file"].endswith(r"\udcff.npy")
    assert run("predict", path, "--weights", weights)[0] == 0


def broken(kind: str, cloud: np.ndarray) -> np.ndarray:
    return {
        "empty": cloud[:0],
        "all NaN": cloud * np.nan,
        "too few": cloud[:20],
        "millimetres": cloud * 1000,
    }[kind]


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        ("empty", "empty"),
        ("all NaN", "NaN"),
        ("too few", "too few points"),
        ("millimetres", "1000 times too far"),
    ],
)
def test_a_cloud_without_a_door_to_see_is_one_line(
    kind: str, complaint: str, run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    np.save(tmp_path / "bad.npy", broken(kind, cloud))
    np.save(tmp_path / "good.npy", cloud)
    code, out, err = run("predict", tmp_path / "bad.npy", tmp_path / "good.npy", "--weights", weights)
    assert code == 1
    assert "good.npy" in out
    first = err.splitlines()[0]
    assert "bad.npy" in first
    assert complaint in first


def test_units_are_taken(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", cloud)
    np.save(tmp_path / "mm.npy", cloud * 1000)
    _, metres, _ = run("predict", tmp_path / "m.npy", "--weights", weights, "--json")
    code, millimetres, _ = run(
        "predict", tmp_path / "mm.npy", "--weights", weights, "--json", "--units", "mm"
    )
    assert code == 0
    a, b = (json.loads(text)["probabilities"] for text in (metres, millimetres))
    assert a == pytest.approx(b, abs=1e-3)


def test_depth_images_need_and_take_a_camera(run: Run, weights: Path, tmp_path: Path) -> None:
    depth = np.random.default_rng(0).integers(1000, 3000, (30, 40), dtype=np.uint16)
    Image.fromarray(depth).save(tmp_path / "d.png")
    code, _, err = run("predict", tmp_path / "d.png", "--weights", weights)
    assert code == 1
    assert "--intrinsics" in err
    flags = ("--fx", 30, "--fy", 30, "--cx", 19.5, "--cy", 14.5)
    code, by_flags, _ = run("predict", tmp_path / "d.png", "--weights", weights, "--json", *flags)
    assert code == 0
    camera = {"width": 40, "height": 30, "fx": 30, "fy": 30, "cx": 19.5, "cy": 14.5}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    (tmp_path / "camera.yaml").write_text(
        "image_width: 40\nimage_height: 30\ncamera_matrix: {data: [30, 0, 19.5, 0, 30, 14.5, 0, 0, 1]}\n"
    )
    for name in ("camera.json", "camera.yaml"):
        code, out, _ = run(
            "predict", tmp_path / "d.png", "--weights", weights, "--json", "--intrinsics", tmp_path / name
        )
        assert code == 0
        assert json.loads(out)["probabilities"] == json.loads(by_flags)["probabilities"]
    assert "all four" in run("predict", tmp_path / "d.png", "--weights", weights, "--fx", 30)[2]


@pytest.mark.parametrize(
    ("arguments", "complaint", "exit_code"),
    [
        (["predict", "gone.pcd"], "gone.pcd", 1),
        (["predict", ".", "--roll", "45"], "a roll of 45 degrees", 2),
        (["predict", ".", "--fx", "-5", "--fy", "5", "--cx", "2", "--cy", "2"], "fx = -5.0 pixels", 2),
        (["predict", ".", "--rule", "plane_state", "--network", "dgcnn"], "exclude each other", 2),
        (["predict", ".", "--network", "dgcnn", "--weights", "x.safetensors"], "exclude each other", 2),
        (["predict", ".", "--rule", "plane_state", "--points", "1024"], "a rule evaluates all points", 2),
        (["predict", ".", "--points", "512", "--budget-ms", "33"], "give one of them", 2),
        (["predict", ".", "--rule", "plane_state", "--budget-ms", "33"], "a rule evaluates all points", 2),
        (["predict", ".", "--out", "cloud.npy/x.csv"], "cloud.npy/x.csv: cannot be written", 1),
        (["predict", ".", "--out", "states.txt"], "name a .csv or .jsonl file", 2),
        (["view", ".", "--out", "cloud.npy/x.html"], "cloud.npy/x.html: cannot be written", 1),
        (["export", "pointnet", "--out", "cloud.npy/x.onnx"], "cloud.npy/x.onnx: cannot be written", 1),
        (["simulate", "--out", "x", "--poses", "0"], "--poses 0", 2),
        (["predict", ".", "--units", "furlongs"], "--units furlongs", 2),
        (["predict", ".", "--frame", "sideways"], "sideways", 2),
        (["predict", ".", "--network", "pointnett"], "pointnett", 1),
        (["predict", ".", "--weights", "gone.safetensors"], "no such weights file", 1),
        (["simulate", "--out", "x", "--preset", "mars"], "no preset 'mars'", 2),
        (["simulate", "--out", "x", "--poses", "9999"], "1353", 2),
        (["simulate", "--out", "x", "--keep", "video"], "pcd, depth, image", 2),
        (["prepare", "gone", "--out", "x"], "gone", 1),
        (["train", "pointnet", "--data", "gone", "--out", "x"], "gone", 1),
        (["train", "poinnet", "--data", "gone", "--out", "x"], "did you mean 'pointnet'", 2),
        (["compare", "gone.toml"], "gone.toml", 2),
        (["compare", "--data", "gone", "--set", "epochs"], "FIELD=VALUE", 2),
        (["report", "gone"], "gone", 1),
    ],
)
def test_errors_are_one_line_and_wrong_usage_is_exit_code_2(
    arguments: list[str],
    complaint: str,
    exit_code: int,
    run: Run,
    tmp_path: Path,
    cloud: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("cloud.npy", cloud)
    code, _, err = run(*arguments)
    assert code == exit_code
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("doorstate: ")
    assert complaint in err
    assert not Path("x").exists(), "what was refused is in nobody's way"


def test_a_stop_by_the_user_is_exit_code_130(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("doorstate.simulation.run.simulate_dataset", stopped)
    code, _, err = run("simulate", "--out", tmp_path / "x", "--poses", 1)
    # typer turns the key into exit code 130 by itself in some versions.
    assert code == 130
    assert "Traceback" not in err


def test_the_pipeline_from_nothing_to_a_report(run: Run, tmp_path: Path) -> None:
    simulated, clouds, runs = tmp_path / "simulated", tmp_path / "clouds", tmp_path / "runs"
    assert run("simulate", "--out", simulated, "--poses", 12, "--keep", "depth", "--workers", 1)[0] == 0
    assert run("prepare", simulated, "--out", clouds, "--points", 128, "--workers", 1)[0] == 0
    code, out, err = run(
        *("compare", "--data", clouds, "--out", runs, "--networks", "pointnet,pointnet2", "--folds", 1),
        *("--points", 128, "--epochs", 1, "--set", "batch_size=8", "--set", "precision=fp32"),
    )
    assert code == 0, err
    assert "pointnet2" in out
    code, out, err = run("report", runs)
    assert code == 0, err
    assert (runs / "report" / "report.html").is_file()
    assert run("report", clouds, "--out", tmp_path / "data-report")[0] == 0
    trained = runs / "runs" / "pointnet2" / "fold0" / "weights.safetensors"
    depth = sorted((simulated / "depth" / "open").glob("*.png"))[0]
    camera = ("--fx", 554.256258, "--fy", 554.256258, "--cx", 319.5, "--cy", 239.5)
    code, out, _ = run("predict", depth, "--weights", trained, "--json", *camera)
    assert code == 0
    assert json.loads(out)["points"] == 128


def test_resolution_goes_on_from_a_comparison(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    clouds, runs, study = tmp_path / "clouds", tmp_path / "runs", tmp_path / "study.toml"
    assert run("prepare", simulated_folder, "--out", clouds, "--points", 256, "--workers", 1)[0] == 0
    small = ("--set", "batch_size=8", "--set", "precision=fp32")
    code, _, err = run(
        *("compare", "--data", clouds, "--out", runs, "--networks", "pointnet", "--folds", 1),
        *("--points", 256, "--epochs", 1, *small),
    )
    assert code == 0, err
    study.write_text(
        f'dataset = "{clouds}"\nstart_from = "{runs}"\nnetworks = ["pointnet"]\npoints = [128, 256]\n'
        '[fine_tuning]\nepochs = 1\nbatch_size = 8\nprecision = "fp32"\n'
    )
    code, out, err = run("resolution", study, "--out", tmp_path / "out")
    assert code == 0, err
    lines = [line.replace("│", " ").split() for line in out.splitlines() if "│ pointnet" in line]
    assert [line[1] for line in lines] == ["128", "256"]
    report = tmp_path / "out" / "report"
    assert (report / "figures" / "resolution.png").is_file()
    before = (tmp_path / "out" / "latency.csv").read_bytes()
    assert run("resolution", study, "--out", tmp_path / "out")[0] == 0
    assert (tmp_path / "out" / "latency.csv").read_bytes() == before, "nothing is measured twice"


def test_transfer_tests_what_was_trained_elsewhere(
    run: Run, small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    runs, study, out_folder = tmp_path / "runs", tmp_path / "study.toml", tmp_path / "out"
    code, _, err = run(
        *("compare", "--data", small_dataset.folder, "--out", runs, "--networks", "pointnet", "--folds", 1),
        *("--points", 128, "--epochs", 1, "--set", "batch_size=8", "--set", "precision=fp32"),
    )
    assert code == 0, err
    study.write_text(
        f'networks = ["pointnet"]\nnum_points = 128\n[trained]\nhere = "{runs}"\n'
        f'[tested]\nthere = "{small_dataset.folder}"\n'
    )
    code, out, err = run("transfer", study, "--out", out_folder)
    assert code == 0, err
    assert any("here" in line and "pointnet" in line for line in out.splitlines())
    assert (out_folder / "report" / "figures" / "transfer.png").is_file()
    assert run("report", out_folder / "here" / "there")[0] == 0


def test_train_on_everything_tests_nothing(run: Run, small_dataset: PreparedDataset, tmp_path: Path) -> None:
    code, out, err = run(
        *("train", "pointnet", "--data", small_dataset.folder, "--protocol", "all", "--points", 128),
        *("--epochs", 1, "--set", "batch_size=8", "--set", "precision=fp32", "--out", tmp_path / "run"),
    )
    assert code == 0, err
    assert "trained on all 36 clouds" in out
    assert (tmp_path / "run" / "weights.safetensors").is_file()


def test_train_makes_one_run(run: Run, small_dataset: PreparedDataset, tmp_path: Path) -> None:
    arguments = (
        "--points",
        128,
        "--epochs",
        1,
        "--set",
        "batch_size=8",
        "--set",
        "precision=fp32",
        "--fold",
        1,
    )
    code, out, err = run(
        "train", "pointcnn", "--data", small_dataset.folder, "--out", tmp_path / "run", *arguments
    )
    assert code == 0, err
    assert "test macro-F1" in out
    assert (tmp_path / "run" / "weights.safetensors").is_file()


def test_prepare_takes_class_folders(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    pcd = simulated_folder / "pcd"
    code, out, _ = run("prepare", pcd, "--out", tmp_path / "clouds", "--points", 128, "--workers", 1)
    assert code == 0
    assert out.startswith("36 clouds of 128 points")
    assert "12 closed, 12 semi_open, 12 open" in out
    shutil.copytree(pcd / "open", tmp_path / "partial" / "open")
    code, _, err = run(
        "prepare", tmp_path / "partial", "--out", tmp_path / "one", "--points", 128, "--workers", 1
    )
    assert code == 0
    assert "no clouds of state closed" in err
    assert "no clouds of state semi_open" in err


def recorded() -> Iterator[dict[str, str]]:
    if (REAL / "index.csv").is_file():
        with (REAL / "index.csv").open(newline="") as stream:
            yield from (row for row in csv.DictReader(stream) if row["fx"] != "?")


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded frames are not here")
def test_recorded_frames_are_answered(run: Run, weights: Path) -> None:
    answered = 0
    for row in recorded():
        flags = [item for name in ("fx", "fy", "cx", "cy") if row[name] for item in (f"--{name}", row[name])]
        scale = ["--depth-scale", row["depth_unit_m"]] if row["depth_unit_m"] else []
        code, out, _ = run("predict", REAL / row["file"], "--weights", weights, "--json", *flags, *scale)
        answer = json.loads(out)
        if "8bit" in row["file"]:
            assert code == 1
            assert "8-bit" in answer["error"]
        else:
            assert code == 0
            assert answer["points"] == 256
            answered += 1
    assert answered >= 20

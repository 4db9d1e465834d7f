# SPDX-License-Identifier: Apache-2.0
"""`doorstate train`, `compare`, `report`, `resolution` and `transfer`."""

from __future__ import annotations

import json
from pathlib import Path

from doorstate._files import read_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.networks.weights import read_card
from tests.cli.helpers import Run, check_error
from tests.conftest import SMALL_POINTS

SMALL = ("--epochs", 1, "--set", "batch_size=8", "--set", "precision=fp32")


def test_pipeline_from_simulation_to_report(run: Run, tmp_path: Path) -> None:
    simulated, clouds, runs = tmp_path / "simulated", tmp_path / "clouds", tmp_path / "runs"
    assert run("simulate", "--out", simulated, "--poses", 12, "--keep", "depth", "--workers", 1)[0] == 0
    assert run("prepare", simulated, "--out", clouds, "--points", 128, "--workers", 1)[0] == 0
    code, out, err = run(
        *("compare", "--data", clouds, "--out", runs, "--network", "pointnet,pointnet2", "--folds", 1),
        *("--points", 128, *SMALL),
    )
    assert code == 0, err
    assert "pointnet2" in out
    code, out, err = run("report", runs)
    assert code == 0, err
    assert (runs / "report" / "report.html").is_file()
    assert run("report", runs / "runs" / "pointnet2" / "fold0", "--out", tmp_path / "one")[0] == 0
    assert (tmp_path / "one" / "report.html").is_file()
    assert run("report", clouds, "--out", tmp_path / "data-report", "--workers", 2)[0] == 0
    trained = runs / "runs" / "pointnet2" / "fold0" / "weights.safetensors"
    depth = sorted((simulated / "depth" / "open").glob("*.png"))[0]
    camera = ("--fx", 554.256258, "--fy", 554.256258, "--cx", 319.5, "--cy", 239.5)
    code, out, _ = run("predict", depth, "--weights", trained, "--json", *camera)
    assert code == 0
    assert json.loads(out)["points"] == 128


def test_train_writes_one_run(run: Run, small_dataset: PreparedDataset, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    command = ("train", "--network", "POINTCNN", "--data", small_dataset.folder, "--out", folder, "--fold", 1)
    code, out, err = run(*command, *SMALL, "--json")
    assert code == 0, err
    assert err.count("\n") == 1, "one line for the one epoch"
    assert (folder / "weights.safetensors").is_file()
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert 0 <= metrics["test_macro_f1"] <= 1
    assert json.loads(out) == metrics
    assert read_card(folder / "weights.safetensors").num_points == SMALL_POINTS, "all points of the data"
    code, _, err = run("report", folder)
    assert code == 0, err
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert "fold 1" in page
    (folder / "predictions.csv").unlink()
    check_error(run("report", folder), 1, str(folder))


def test_protocol_all_trains_on_all_clouds(run: Run, small_dataset: PreparedDataset, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, _, err = run(
        *(
            "train",
            "--network",
            "pointnet",
            "--data",
            small_dataset.folder,
            "--protocol",
            "all",
            "--out",
            folder,
        ),
        *("--points", 128, *SMALL),
    )
    assert code == 0, err
    assert (folder / "weights.safetensors").is_file()
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert (metrics["train_samples"], metrics["test_samples"]) == (36, 0)


def test_resolution_measures_once(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    clouds, runs, study = tmp_path / "clouds", tmp_path / "runs", tmp_path / "study.toml"
    assert run("prepare", simulated_folder, "--out", clouds, "--points", 256, "--workers", 1)[0] == 0
    code, _, err = run(
        *("compare", "--data", clouds, "--out", runs, "--network", "pointnet", "--folds", 1),
        *("--points", 256, *SMALL),
    )
    assert code == 0, err
    study.write_text(
        f'dataset = "{clouds}"\nstart_from = "{runs}"\nnetworks = ["pointnet"]\npoints = [128, 256]\n'
        '[fine_tuning]\nepochs = 1\nbatch_size = 8\nprecision = "fp32"\n'
    )
    folder = tmp_path / "out"
    code, _, err = run("resolution", study, "--out", folder, "--device", "cpu")
    assert code == 0, err
    assert [row["points"] for row in read_csv(folder / "latency.csv")] == ["128", "256"]
    assert (folder / "report" / "figures" / "resolution.png").is_file()
    before = (folder / "latency.csv").read_bytes()
    assert run("resolution", study, "--out", folder)[0] == 0
    assert (folder / "latency.csv").read_bytes() == before


def test_transfer_tests_on_another_data_set(run: Run, small_dataset: PreparedDataset, tmp_path: Path) -> None:
    runs, study, folder = tmp_path / "runs", tmp_path / "study.toml", tmp_path / "out"
    code, _, err = run(
        *("compare", "--data", small_dataset.folder, "--out", runs, "--network", "pointnet", "--folds", 1),
        *("--points", 128, *SMALL),
    )
    assert code == 0, err
    study.write_text(
        f'networks = ["pointnet"]\nnum_points = 128\n[trained]\nhere = "{runs}"\n'
        f'[tested]\nthere = "{small_dataset.folder}"\n'
    )
    code, out, err = run("transfer", study, "--out", folder, "--device", "cpu")
    assert code == 0, err
    assert any("here" in line and "pointnet" in line for line in out.splitlines())
    assert (folder / "report" / "figures" / "transfer.png").is_file()
    assert run("report", folder / "here" / "there")[0] == 0

# SPDX-License-Identifier: Apache-2.0
"""Benchmarks as commands, with settings too small for meaningful figures."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
import torch

from doorstate._jobs import no_progress
from doorstate.clouds.samplers import choose_sampler
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, RunError
from doorstate.rules import list_rules

REPOSITORY = Path(__file__).resolve().parents[1]
TINY = ("--points", "128", "--batch", "2", "--repeats", "1", "--threads", "1")


def run(*arguments: object) -> tuple[int, str, str]:
    """Return exit code, standard output and errors of `python -m benchmarks`, without lines of progress."""
    process = subprocess.run(
        [sys.executable, "-W", "error", "-m", "benchmarks", *map(str, arguments)],
        cwd=REPOSITORY,
        env=os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = process.stderr.splitlines(keepends=True)
    errors = "".join(line for line in lines if not re.match(r"\w+: \d+ of \d+, about .* left$", line))
    return process.returncode, process.stdout, errors


def read_results(folder: Path, name: str) -> tuple[dict[str, Any], list[dict[str, Any]], str]:
    """Return settings, rows and Markdown of a finished benchmark."""
    content = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    rows = [row for result in content["results"].values() for row in result["rows"]]
    return content["settings"], rows, (folder / f"{name}.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def speeds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Measure DGCNN, and a port without a checkout."""
    folder = tmp_path_factory.mktemp("speeds")
    code, output, errors = run(
        "networks", "--networks", "dgcnn", "--out", folder, "--port-dgcnn", folder / "nowhere", *TINY
    )
    assert (code, errors) == (0, "")
    return folder, output


def test_every_form_of_a_network_has_a_row(speeds: tuple[Path, str]) -> None:
    settings, rows, markdown = read_results(speeds[0], "networks")
    assert settings["threads"] == 1
    forms = {row["form"]: row for row in rows}
    assert {"fast fp32", "plain fp32", "port"} <= set(forms)
    assert any(form.endswith("neighbours cached") for form in forms)
    for name, row in forms.items():
        assert f"| dgcnn | 128 | {name} |" in markdown
        if name == "port":
            continue
        assert row["threads"] == 1
        figures = [row[key] for key in ("training_ms", "memory_mib", "training_gflops", "share_of_peak")]
        assert all(figure > 0 for figure in figures)
        assert ("inference_1_ms" in row) == ("inference_16_ms" in row) == ("cached" not in name)
        expected = {"training"} if "cached" in name else {"training", "inference_1", "inference_16"}
        if name != "plain fp32":
            assert set(row["speedups"]["plain fp32"]) == expected


def test_speedups_compare_the_same_round(speeds: tuple[Path, str]) -> None:
    rows = {row["form"]: row for row in read_results(speeds[0], "networks")[1]}
    fast, plain = rows["fast fp32"], rows["plain fp32"]
    speedup = fast["speedups"]["plain fp32"]["training"]
    assert speedup == pytest.approx(plain["training_ms"] / fast["training_ms"])


def test_operations_are_those_of_the_plain_form(speeds: tuple[Path, str]) -> None:
    content = json.loads((speeds[0] / "networks.json").read_text(encoding="utf-8"))
    edges = 128 * 20 * (6 * 64 + 128 * 64 + 128 * 128 + 256 * 256)
    whole = 128 * 512 * 1024 + 2048 * 512 + 512 * 256 + 256 * 3
    counted = content["results"]["dgcnn 128"]["training_gflop_per_cloud"]
    assert math.isclose(counted, 3 * 2 * (edges + whole) / 1e9)


def test_missing_checkout_is_reported_in_one_line(speeds: tuple[Path, str]) -> None:
    folder, output = speeds
    row = next(row for row in read_results(folder, "networks")[1] if row["form"] == "port")
    assert "antao97/dgcnn.pytorch" in row["reason"]
    assert "\n" not in row["reason"]
    assert f"dgcnn at 128 points, port: {row['reason']}" in output


def test_results_of_other_settings_are_refused(speeds: tuple[Path, str]) -> None:
    folder, _ = speeds
    before = (folder / "networks.json").read_text(encoding="utf-8")
    code, _, errors = run("networks", "--out", folder, *TINY[:-1], "2", "--port-dgcnn", folder / "nowhere")
    assert code == 1
    assert "networks.json" in errors
    assert "threads" in errors
    assert (folder / "networks.json").read_text(encoding="utf-8") == before


def test_only_missing_and_failed_results_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(REPOSITORY)
    from benchmarks import networks
    from benchmarks.clouds import simulated_clouds
    from benchmarks.store import Store

    measured_networks: list[str] = []

    def measure(plan: networks.Plan, network: str, *_: object) -> dict[str, Any]:
        measured_networks.append(network)
        return {
            "network": network,
            "points": 128,
            "rows": [{"form": "port", "reason": "lost"}] * (network == "dgcnn"),
        }

    monkeypatch.setattr(networks, "_measure", measure)
    monkeypatch.setattr(networks, "Worker", lambda *_: nullcontext())
    plan = networks.Plan(batch=2, repeats=1, threads=1, checkouts={}, pyg=False, same_allocator=False)
    pairs = [("pointnet", 128), ("dgcnn", 128)]
    for fresh, expected in (
        (False, ["pointnet", "dgcnn"]),
        (False, ["dgcnn"]),
        (True, ["pointnet", "dgcnn"]),
    ):
        store = Store(tmp_path, "networks", {"batch": 2}, fresh)
        networks.measure_networks(plan, pairs, lambda: simulated_clouds(2, 128), store, no_progress)
        assert measured_networks == expected
        measured_networks.clear()
    assert "dgcnn at 128 points, port: lost" in (tmp_path / "networks.md").read_text(encoding="utf-8")


def test_latency_is_the_sum_of_its_stages(tmp_path: Path) -> None:
    few = ("--points", "128", "--threads", "1", "--repeats", "1")
    assert run("latency", "--networks", "pointnet", "--out", tmp_path, *few)[0] == 0
    _, rows, markdown = read_results(tmp_path, "latency")
    compiled = choose_sampler(import_torch=True).library
    exported = [
        ("pointnet", runtime, library, 128, 1)
        for runtime in ("onnxruntime", "onnxruntime int8")
        for library in dict.fromkeys((compiled, "numpy"))
    ]
    columns = ("network", "runtime", "sampling", "points", "threads")
    assert [tuple(row[column] for column in columns) for row in rows] == [
        ("pointnet", "torch", compiled, 128, 1),
        *exported,
    ]
    assert all(row["ratio"] == 1 for row in rows if row["sampling"] == compiled)
    for row in rows:
        stages = {name: stage["median_ms"] for name, stage in row["stages"].items()}
        total = stages.pop("total")
        assert set(stages) == {"clean", "sample", "network"}
        assert all(duration_ms > 0 for duration_ms in stages.values())
        assert sum(stages.values()) == pytest.approx(total)
        assert f"| {row['network']} | {row['runtime']} | {row['sampling']} | 128 | 1 |" in markdown


def test_time_to_every_door_is_the_sum_of_its_stages(tmp_path: Path) -> None:
    few = ("--network", "pointnet", "--candidates", "1,3", "--threads", "1", "--repeats", "1")
    code, _, errors = run("doorways", "--out", tmp_path, *few)
    assert (code, errors) == (0, "")
    settings, rows, markdown = read_results(tmp_path, "doorways")
    assert settings["weights"] == "untrained pointnet"
    assert [(row["cloud"], row["runtime"], row["candidates"]) for row in rows] == [
        (cloud, runtime, candidates)
        for cloud in ("varied", "corridor")
        for runtime in ("torch", "onnxruntime")
        for candidates in (1, 3)
    ]
    for row in rows:
        stages = {name: stage["median_ms"] for name, stage in row["stages"].items()}
        total, processor = stages.pop("total"), stages.pop("processor")
        assert 1 <= row["doors"] <= row["candidates"]
        assert all(
            duration_ms > 0 for duration_ms in (*stages.values(), *row["check_ms"].values(), processor)
        )
        assert sum(stages.values()) == pytest.approx(total)
        assert f"| {row['cloud']} | {row['runtime']} | 1 | {row['candidates']} | {row['doors']} |" in markdown


def test_time_of_a_simulated_frame_is_the_sum_of_its_stages(tmp_path: Path) -> None:
    few = ("--presets", "varied:xtion", "--scenes", "1", "--batches", "1,2", "--device", "cpu")
    code, _, errors = run("simulation", "--out", tmp_path, *few)
    assert (code, errors) == (0, "")
    _, rows, markdown = read_results(tmp_path, "simulation")
    (row,) = rows
    assert (row["preset"], row["sensor"], row["frames"]) == ("varied", "xtion", 3)
    assert row["crops"] > 0
    assert row["bytes_per_crop"] > 1024 * (3 * 4 + 1)
    stages = row["stages_ms"]
    total, processor = stages.pop("total"), stages.pop("processor")
    assert all(duration_ms > 0 for duration_ms in (*stages.values(), processor))
    assert sum(stages.values()) == pytest.approx(total)
    assert "| varied | xtion | 3 |" in markdown
    batches = read_results(tmp_path, "batched_rendering")[1]
    assert [batch["batch"] for batch in batches] == [1, 2]
    assert all(batch["frames_per_s"] > 0 for batch in batches)


def test_a_long_watch_has_a_row_for_each_eighth(tmp_path: Path) -> None:
    assert run("live-camera", "--out", tmp_path, "--hours", "0.05")[0] == 0
    _, rows, markdown = read_results(tmp_path, "live-camera")
    assert len(rows) == 8
    assert rows[-1]["grabbed"] > 0.05 * 3600 * 30 - 10 > rows[0]["grabbed"]
    assert rows[-1]["answered"] > 0
    assert rows[-1]["resident_mib"] > 10
    assert markdown.count("\n| ") >= 8


def test_busy_has_a_row_for_every_form_and_number_of_processes(tmp_path: Path) -> None:
    few = ("--runtimes", "onnxruntime", "--threads", "1,2", "--processes", "0,1", "--repeats", "1")
    assert run("busy", "--out", tmp_path, *few)[0] == 0
    _, rows, markdown = read_results(tmp_path, "busy")
    forms = {(row["runtime"], row["threads"], row["waiting"]) for row in rows}
    assert forms == {("onnxruntime", 1, "sleep"), ("onnxruntime", 2, "sleep"), ("onnxruntime", 2, "spin")}
    assert len(rows) == 2 * len(forms)
    assert all(len(row["milliseconds"]) == 1 and row["milliseconds"][0] > 0 for row in rows)
    (default,) = (line for line in markdown.splitlines() if line.startswith("| onnxruntime | 2 | sleep |"))
    assert default.count("| 1.00 |") == 2


def test_latency_of_rules_and_networks(tmp_path: Path) -> None:
    few = ("--count", "2", "--points", "128", "--repeats", "1")
    assert run("rules", "--out", tmp_path, *few)[0] == 0
    _, rows, markdown = read_results(tmp_path, "rules")
    assert [row["method"] for row in rows] == [*list_rules(), "mvcnn", "pointnet2"]
    for row in rows:
        assert 0 < row["median_ms"] <= row["p90_ms"] <= row["max_ms"]
        assert f"| {row['method']} | {row['points'] or 'all'} |" in markdown


def test_profile_has_groups_of_operators(tmp_path: Path) -> None:
    few = ("--points", "128", "--batch", "2", "--threads", "1", "--form", "fast")
    code, _, errors = run("profile", "--networks", "dgcnn", "--out", tmp_path, *few)
    assert (code, errors) == (0, "")
    _, rows, markdown = read_results(tmp_path, "profile")
    assert [row["phase"] for row in rows] == ["training", "inference"]
    for row in rows:
        assert row["groups"]["matrix products"]["ms"] > 0
        assert row["groups"]["neighbour search"]["ms"] > 0
    assert ("optimiser" in rows[0]["groups"], "optimiser" in rows[1]["groups"]) == (True, False)
    assert "| dgcnn | training | matrix products |" in markdown


def test_knn_measures_three_methods(tmp_path: Path) -> None:
    assert run("knn", "--out", tmp_path, "--points", "128", "--repeats", "1", "--threads", "1")[0] == 0
    _, rows, markdown = read_results(tmp_path, "knn")
    assert [(row["points"], row["channels"]) for row in rows] == [(128, 64), (128, 128)]
    for row in rows:
        assert set(row["ms"]) == {"doorstate", "full product", "scikit-learn"}
        assert all(duration_ms > 0 for duration_ms in row["ms"].values())
        assert f"| 128 | {row['channels']} |" in markdown


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("networks", "--networks", "pontnet"), "unknown network 'pontnet'; did you mean 'pointnet'?"),
        (("networks", "--points", "64"), "--points"),
        (("profile", "--form", "quick"), "--form"),
        (("doorways", "--candidates", "0"), "--candidates"),
    ],
)
def test_wrong_options_are_reported_in_one_line(
    arguments: tuple[str, ...], text: str, tmp_path: Path
) -> None:
    code, _, errors = run(*arguments, "--out", tmp_path / "out")
    assert code == 1
    assert text in errors
    assert errors.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_knn_methods_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(REPOSITORY)
    from benchmarks.neighbours import METHODS

    features = torch.randn(1, 128, 64, generator=torch.Generator().manual_seed(0))
    neighbours = {name: method(features).sort(-1).values for name, method in METHODS.items()}
    assert torch.equal(neighbours["doorstate"], neighbours["full product"])
    assert torch.equal(neighbours["doorstate"], neighbours["scikit-learn"])


def test_clouds_of_a_data_set_are_taken_at_equal_intervals(
    small_dataset: PreparedDataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(REPOSITORY)
    from benchmarks.clouds import dataset_clouds

    clouds = dataset_clouds(small_dataset.folder, 3, 130)
    assert clouds.points.shape == (3, 130, 3)
    assert (clouds.points[-1] == small_dataset.clouds[-1, :130]).all()
    assert clouds.labels.tolist() == [small_dataset.labels[i] for i in (0, (len(small_dataset) - 1) // 2, -1)]
    assert abs(clouds.first_points(128).points.mean(axis=1)).max() < 1e-6
    with pytest.raises(ConfigError) as caught:
        dataset_clouds(small_dataset.folder, 3, 161)
    assert caught.value.expected == "3 of 161"


def test_failures_of_a_worker_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(REPOSITORY)
    from benchmarks.workers import Worker

    with Worker(list, [3]) as worker:
        assert worker.call("count", 3) == 1
        with pytest.raises(RunError, match="ValueError"):
            worker.call("remove", 4)
        assert worker.call("count", 3) == 1
    with Worker(Dying) as worker, pytest.raises(RunError, match="SIGKILL"):
        worker.call("die")


class Dying:
    """Object whose process is killed, as by the kernel when memory runs out."""

    def die(self) -> None:
        os.kill(os.getpid(), 9)


def test_service_is_measured_with_every_number_of_clients(tmp_path: Path) -> None:
    few = ("--points", 128, "--workers", 1, "--seconds", 0.5, "--clients", "1,3")
    code, _, errors = run("service", "--out", tmp_path, *few)
    assert (code, errors) == (0, "")
    _, rows, markdown = read_results(tmp_path, "service")
    assert [row["clients"] for row in rows] == [1, 3]
    for row in rows:
        successful = row["responses"]["200"]
        assert row["responses"] == {"200": successful}
        assert successful >= row["clients"]
        assert row["clouds_per_s"] == pytest.approx(successful / row["seconds"])
        assert row["p50_ms"] <= row["p99_ms"]
        assert min(row["memory_mib"]) > 100
    assert "| 3 |" in markdown


def test_check_of_a_gpu_runs_on_the_processor(tmp_path: Path) -> None:
    script = REPOSITORY / "paper" / "gpu_check.sh"
    command = [script, "--device", "cpu", "--quick", "--networks", "pointnet", "--out", tmp_path]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHON": sys.executable}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "gpu.json").read_text(encoding="utf-8"))
    assert results["settings"]["device"] == "cpu"
    assert [row["network"] for row in results["parity"]] == ["pointnet"]
    assert all(row["float64"] == {"outputs": 0, "gradients": 0} for row in results["parity"])
    assert {row["form"] for row in results["networks"]} >= {"fast fp32", "plain fp32"}
    assert all(row["training_ms"] > 0 and row["inference_1_ms"] > 0 for row in results["networks"])
    assert all(row["gb_per_s"] > 0 for row in results["kernels"])
    assert results["simulation"][0]["frames_per_s"] > 0
    assert results["failed"] == results["left_out"] == []


def test_check_of_a_gpu_without_one(tmp_path: Path) -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device")
    code, output, errors = run("gpu", "--out", tmp_path)
    assert (code, errors, output.count("\n")) == (77, "", 1)
    assert not any(tmp_path.iterdir())


def test_a_network_that_differs_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import gpu

    points = torch.rand(4, 128, 3, generator=torch.Generator().manual_seed(0))
    labels = torch.tensor([0, 1, 2, 0])
    cpu = torch.device("cpu")
    assert gpu.compare("pointnet", points, labels, cpu)["is_within_tolerance"]
    monkeypatch.setattr(gpu, "_difference", lambda got, expected: 0.5)
    assert not gpu.compare("pointnet", points, labels, cpu)["is_within_tolerance"]


def test_engines_are_measured(tmp_path: Path) -> None:
    few = ("--scenes", "8", "--pieces", "40", "--seconds", "1", "--repeats", "1", "--engines", "processes")
    assert run("engines", "--out", tmp_path, *few)[0] == 0
    _, (row,), markdown = read_results(tmp_path, "engines")
    assert row["seconds_s"] >= 1
    assert row["overhead"] == pytest.approx(row["seconds_s"] - 1)
    assert row["linear"] == pytest.approx(row["one_worker_s"] / (2 * row["two_workers_s"]))
    assert min(row["start_s"], row["piece_ms"], row["peak_mib"]) > 0
    assert row["ratio_to_first"] == 1
    assert "| processes |" in markdown

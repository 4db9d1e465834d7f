# SPDX-License-Identifier: Apache-2.0
"""Lost machines and programs: the results are those of an undisturbed run of the process engine."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from doorstate._jobs import ProcessEngine, RayEngine, Resources
from doorstate.dataset.store import PreparedDataset
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.training.comparison import compare
from doorstate.training.experiment import Experiment
from tests._jobs.engines import TwoMachines
from tests.training.runs import read_results, small_experiment
from tests.waiting import wait_until

ONE = Resources(cpus=1)
WAIT_S = 120.0
SMALL = PRESETS["varied"].model_copy(update={"camera": DepthCamera(width=160, height=120)})
SETTINGS = SimulationSettings(preset=SMALL, seed=6, poses=64)  # eight pieces
SIMULATE = """
import sys
from pathlib import Path
from doorstate._jobs import RayEngine
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset

address, folder, settings = sys.argv[1:]
with RayEngine(address) as engine:
    simulate_dataset(Path(folder, "data"), SimulationSettings.model_validate_json(settings), engine)
"""
COMPARE = """
import sys
from pathlib import Path
from doorstate._jobs import RayEngine, Resources
from doorstate.training.comparison import compare
from doorstate.training.experiment import Experiment

address, folder, experiment = sys.argv[1:]
with RayEngine(address) as engine:
    compare(Experiment.model_validate_json(experiment), Path(folder, "runs"), engine, resources=Resources(cpus=1))
"""


def in_background(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work)
    thread.start()
    return thread


def files(folder: Path, name: str) -> list[Path]:
    return sorted(folder.rglob(name))


def results(folder: Path) -> dict[str, Any]:
    return {
        path.parent.relative_to(folder): read_results(path.parent) for path in files(folder, "metrics.json")
    }


@pytest.fixture(scope="module")
def experiment(small_dataset: PreparedDataset) -> Experiment:
    """Two trainings, one for each machine."""
    changes = {"epochs": 8, "batch_size": 8, "precision": "fp32"}
    return small_experiment(
        small_dataset, networks=("pointnet2", "pointnet"), folds=1, recipe_changes=changes
    )


@pytest.fixture(scope="module")
def undisturbed(experiment: Experiment, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed")
    simulate_dataset(folder / "data", SETTINGS, ProcessEngine(2))
    compare(experiment, folder / "runs", ProcessEngine(1), resources=ONE)
    return folder


def manifest(folder: Path) -> bytes:
    return (folder / "data" / "manifest.csv").read_bytes()


def test_a_simulation_outlives_a_machine(
    cluster: TwoMachines, ray_engine: RayEngine, undisturbed: Path, tmp_path: Path
) -> None:
    thread = in_background(lambda: simulate_dataset(tmp_path / "data", SETTINGS, ray_engine))
    wait_until(lambda: files(tmp_path, "0*.csv"), WAIT_S)
    cluster.lose_node()
    assert not (tmp_path / "data" / "manifest.csv").exists()
    thread.join()
    assert manifest(tmp_path) == manifest(undisturbed)


@pytest.mark.slow
def test_trainings_outlive_a_machine(
    cluster: TwoMachines, ray_engine: RayEngine, experiment: Experiment, undisturbed: Path, tmp_path: Path
) -> None:
    thread = in_background(lambda: compare(experiment, tmp_path / "runs", ray_engine, resources=ONE))
    wait_until(lambda: len(files(tmp_path, "checkpoint.pt")) == 2, WAIT_S)
    cluster.lose_node()
    assert not files(tmp_path, "metrics.json"), "both were running"
    thread.join()
    assert results(tmp_path / "runs") == results(undisturbed / "runs")
    assert len(results(tmp_path / "runs")) == 2


def kill_program(script: str, arguments: list[str], started: Callable[[], object]) -> None:
    with subprocess.Popen([sys.executable, "-c", script, *arguments]) as program:
        wait_until(lambda: started() or program.poll() is not None, WAIT_S)
        assert program.poll() is None
        program.kill()


def test_a_simulation_whose_program_was_killed_continues(
    cluster: TwoMachines, ray_engine: RayEngine, undisturbed: Path, tmp_path: Path
) -> None:
    arguments = [cluster.address, str(tmp_path), SETTINGS.model_dump_json()]
    kill_program(SIMULATE, arguments, lambda: files(tmp_path, "0*.csv"))
    assert not (tmp_path / "data" / "manifest.csv").exists()
    simulate_dataset(tmp_path / "data", SETTINGS, ray_engine)
    assert manifest(tmp_path) == manifest(undisturbed)


@pytest.mark.slow
def test_trainings_whose_program_was_killed_continue(
    cluster: TwoMachines, ray_engine: RayEngine, experiment: Experiment, undisturbed: Path, tmp_path: Path
) -> None:
    arguments = [cluster.address, str(tmp_path), experiment.model_dump_json()]
    kill_program(COMPARE, arguments, lambda: files(tmp_path, "checkpoint.pt"))
    assert len(files(tmp_path, "metrics.json")) < 2
    compare(experiment, tmp_path / "runs", ray_engine, resources=ONE)
    assert results(tmp_path / "runs") == results(undisturbed / "runs")


def descendants(process: int) -> list[int]:
    try:
        listed = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
    return [number for child in map(int, listed) for number in (child, *descendants(child))]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_command_leaves_nothing_running(
    stop: signal.Signals, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    pytest.importorskip("ray", reason="Ray is not installed: the extra cluster brings it")
    line = [
        "simulate",
        "--preset",
        "varied",
        "--scenes",
        "4000",
        "--out",
        "data",
        "--engine",
        "ray",
        "--workers",
        "2",
    ]
    if stop == signal.SIGTERM:
        line += ["--address", request.getfixturevalue("cluster").address]
    command = [
        sys.executable,
        "-c",
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n",
    ]
    command[-1] += "from doorstate.cli import main; main()"
    with subprocess.Popen([*command, *line], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as program:
        wait_until(lambda: files(tmp_path, "0*.csv") or program.poll() is not None, WAIT_S)
        assert program.poll() is None
        started = descendants(program.pid)
        program.send_signal(stop)
        _, stderr = program.communicate(timeout=30)
    assert program.returncode == -stop
    assert "Traceback" not in stderr
    assert stderr.count("; run the same command again to continue") == 1
    wait_until(lambda: not any(Path(f"/proc/{number}").exists() for number in started), 10)
    time.sleep(1)
    done = len(files(tmp_path, "0*.csv"))
    time.sleep(1.5)
    assert len(files(tmp_path, "0*.csv")) == done, "workers of the cluster have ended too"
    assert not files(tmp_path, ".*.tmp.*")
    assert {path.name for path in (tmp_path / "data").iterdir()} == {"simulation.json", "pieces"}

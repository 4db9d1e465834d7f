# SPDX-License-Identifier: Apache-2.0
"""A small simulated and prepared data set that many tests read and none changes, and the command in this process."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import torch
from hypothesis import HealthCheck, settings

from doorstate.cli import main
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.join import join_datasets
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.dataset.store import PreparedDataset
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset

pytest_plugins = ["tests._jobs.engines"]
if TYPE_CHECKING:
    from tests.mqtt.broker import Broker

SMALL_POINTS = 160
Run = Callable[..., tuple[int, str, str]]

# No test depends on how busy the machine is.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# A landing must not depend on luck; everybody else's runs go on looking for new counterexamples.
settings.register_profile("ci", settings.get_profile("suite"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "suite")


@pytest.fixture(autouse=True, scope="session")
def _one_thread() -> None:
    """Small tensors are quicker on one thread, and the suite runs one process per processor."""
    torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="session")
def _no_waiting_for_the_disk() -> Iterator[None]:
    """A test that loses its files to a power cut is run again, and waiting would make the suite twice as long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("doorstate._files._sync", lambda *_: None)
        yield


@pytest.fixture(scope="session")
def simulated_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve poses, 36 samples, with their organized clouds as PCD."""
    folder = tmp_path_factory.mktemp("simulated") / "small"
    settings = SimulationSettings(preset=PRESETS["ogurob"], seed=3, poses=12, raw=("pcd",))
    simulate_dataset(folder, settings, workers=1)
    return folder


@pytest.fixture(scope="session")
def small_dataset(simulated_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """The same samples with 160 points each."""
    folder = tmp_path_factory.mktemp("prepared") / "small"
    return prepare_dataset(
        Preparation(simulated_folder, CloudSpec(num_points=SMALL_POINTS)), folder, workers=1
    ).dataset


@pytest.fixture(scope="session")
def frames() -> list[Frame]:
    """A closed, a semi-open and an open door from one pose."""
    return [replay(row) for row in draw_rows(PRESETS["ogurob"], 3, 700)]


@pytest.fixture(scope="session")
def scene_dataset(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Eight varied doors in three states and twelve scenes without one, 160 points each, seen by a small camera."""
    folder = tmp_path_factory.mktemp("scenes")
    parts = [_scenes(folder, preset, 4, scenes) for preset, scenes in (("varied", 8), ("no-door", 12))]
    return join_datasets([part.folder for part in parts], folder / "joined")


@pytest.fixture(scope="session")
def more_dataset(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Four varied doors of another seed in three states, 160 points each."""
    return _scenes(tmp_path_factory.mktemp("more"), "varied", 5, 4)


def _scenes(folder: Path, preset: str, seed: int, scenes: int) -> PreparedDataset:
    """Scenes seen by a small camera, simulated and prepared below `folder`."""
    small = PRESETS[preset].model_copy(update={"camera": DepthCamera(width=160, height=120)})
    simulate_dataset(folder / preset, SimulationSettings(preset=small, seed=seed, poses=scenes), workers=1)
    return prepare_dataset(
        Preparation(folder / preset, CloudSpec(num_points=SMALL_POINTS)), folder / f"{preset}-160", workers=1
    ).dataset


@pytest.fixture(scope="session")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained PointNet: quick, and any answer will do."""
    path = tmp_path_factory.mktemp("weights") / "pointnet.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=256))
    return path


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    """A broker of MQTT without users."""
    from tests.mqtt.broker import MOSQUITTO, Broker

    if MOSQUITTO is None:
        pytest.skip("mosquitto is not installed")
    started = Broker(tmp_path)
    yield started
    started.kill()


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command in this process: exit code, standard output, standard error."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["doorstate", *map(str, arguments)])
        code = 0
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            main()
        except SystemExit as end:
            if isinstance(end.code, str):
                print(end.code, file=sys.stderr)
            code = 1 if isinstance(end.code, str) else end.code or 0
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call

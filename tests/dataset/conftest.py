# SPDX-License-Identifier: Apache-2.0
"""A tiny simulated folder, and a prepared folder written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate._files import write_csv
from doorstate.dataset.description import DatasetDescription
from doorstate.dataset.store import CLOUDS_FILE
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.types import STATES


@pytest.fixture(scope="session")
def tiny_simulation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five poses with a camera of 160 x 120 pixels; read only."""
    folder = tmp_path_factory.mktemp("simulated") / "tiny"
    preset = PRESETS["ogurob"].model_copy(update={"camera": DepthCamera(width=160, height=120)})
    simulate_dataset(folder, SimulationSettings(preset=preset, seed=2, poses=5), workers=1)
    return folder


@pytest.fixture
def prepared(tmp_path: Path) -> Path:
    """Eleven random clouds of 40 points with alternating states."""
    folder = tmp_path / "prepared"
    folder.mkdir()
    np.save(folder / CLOUDS_FILE, np.random.default_rng(0).uniform(1, 4, (11, 40, 3)).astype(np.float32))
    write_csv(
        folder / MANIFEST_FILE,
        [{"sample_id": f"s{number}", "state": STATES[number % 3]} for number in range(11)],
    )
    DatasetDescription(
        kind="imported", source="by hand", num_points=40, samples=11, doorstate_version="0"
    ).save(folder)
    return folder

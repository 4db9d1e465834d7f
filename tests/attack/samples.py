# SPDX-License-Identifier: Apache-2.0
"""Small data that commands of the attacks read."""

from __future__ import annotations

import os
from pathlib import Path

from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset

POINTS = 128
_TINY = PRESETS["varied"].model_copy(update={"camera": DepthCamera(width=160, height=120)})


def simulated(folder: Path, seed: int = 0, scenes: int = 6) -> Path:
    """Return a folder of simulated scenes, three clouds each; the same names for every seed."""
    settings = SimulationSettings(preset=_TINY, seed=seed, poses=scenes, raw=("pcd",))
    simulate_dataset(folder, settings, workers=1)
    return folder


def prepared(folder: Path, seed: int = 0, scenes: int = 6) -> Path:
    """Return a folder of prepared clouds."""
    raw = simulated(folder.with_name(f"{folder.name}-raw"), seed, scenes)
    prepare_dataset(Preparation(raw, CloudSpec(num_points=POINTS)), folder, workers=1)
    return folder


def first_cloud(folder: Path) -> Path:
    """Return the first cloud file below a folder."""
    return min(folder.rglob("*.pcd"))


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of all files below a folder by path, pipes and devices aside."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and os.access(path, os.R_OK)
    }

# SPDX-License-Identifier: Apache-2.0
"""Adaptation on a cluster: clouds and scores are those of one process."""

from __future__ import annotations

from pathlib import Path

import torch

from doorstate._jobs import RayEngine
from doorstate.dataset.labelled import labelled_frames
from doorstate.evaluation.adaptation import score_before_and_after
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.training.adaptation.frames import prepare_frames

PRESET = PRESETS["ogurob"].model_copy(update={"camera": DepthCamera(width=160, height=120)})


def untrained(path: Path, seed: int) -> Path:
    torch.manual_seed(seed)
    save_weights(path, create_network("pointnet2"), WeightsCard(network="pointnet2", num_points=128))
    return path


def test_clouds_and_scores_are_those_of_one_process(ray_engine: RayEngine, tmp_path: Path) -> None:
    simulate_dataset(tmp_path / "site", SimulationSettings(preset=PRESET, seed=3, poses=3, raw=("depth",)), 1)
    frames = labelled_frames(tmp_path / "site" / "depth")
    before, after = (untrained(tmp_path / f"{seed}.safetensors", seed) for seed in (1, 2))
    folders = [tmp_path / "one", tmp_path / "cluster"]
    for folder, workers in zip(folders, (1, ray_engine), strict=True):
        folder.mkdir()
        prepare_frames(frames, before, folder / "clouds", workers)
    for name in ("manifest.csv", "clouds.npy"):
        one, cluster = ((folder / "clouds" / name).read_bytes() for folder in folders)
        assert one == cluster
    scores = [
        score_before_and_after(before, after, frames, workers, folder)
        for folder, workers in zip(folders, (1, ray_engine), strict=True)
    ]
    assert scores[0] is not None
    assert scores[1] is not None
    assert scores[0].to_json() == scores[1].to_json()
    assert {row["frames"] for row in scores[0].to_json()["scores"]} == {9}

# SPDX-License-Identifier: Apache-2.0
"""Adaptation from labelled frames to weights, with small clouds and small networks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from doorstate.dataset.labelled import LabelledFrame, labelled_frames
from doorstate.errors import DatasetError
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads
from doorstate.networks.weights import load_weights, save_weights
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import Preset
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.training.adaptation import weights as adapted_weights
from doorstate.training.adaptation.adapt import Adaptation
from doorstate.training.adaptation.frames import FRAME_COLUMN, prepare_frames
from doorstate.training.adaptation.simulated import SimulatedPart, simulate_for
from doorstate.types import Part

PARTS = ((SimulatedPart("varied", "none", 2, 1),), (SimulatedPart("varied", "none", 2, 2),))
CHANGES = {"epochs": 2, "clouds_per_epoch": 16, "batch_size": 8, "precision": "fp32"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> list[LabelledFrame]:
    """Frames of four doors of a building, in all states."""
    folder = tmp_path_factory.mktemp("site")
    preset = Preset(name="site", camera=DepthCamera(width=320, height=240))
    simulate_dataset(folder, SimulationSettings(preset=preset, seed=2, poses=4, raw=("depth",)), workers=1)
    return labelled_frames(folder / "depth")


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Untrained weights for doorways."""
    torch.manual_seed(0)
    options, heads = {"centres": [32, 8]}, ("door", "frame", "parts")
    network = create_network("pointnet2", **options)
    add_heads(network, heads)
    path = tmp_path_factory.mktemp("start") / "start.safetensors"
    card = WeightsCard(
        network="pointnet2",
        network_options=options,
        num_points=128,
        heads=heads,
        input="doorway",
        scale_m=1.5,
    )
    save_weights(path, network, card)
    return path


def test_an_adaptation_goes_on_and_freezes_the_statistics(
    site: list[LabelledFrame], start: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapted_weights, "MOST_FORGOTTEN", 1.0)
    adaptation = Adaptation(site, start, tmp_path, changes=CHANGES)
    doors = {frame.columns["door"] for frame in site}
    held_out = {frame.columns["door"] for frame in adaptation.held_out}
    assert (len(doors), len(held_out)) == (4, 1)
    prepared = adaptation.prepare(workers=1)
    assert not {row["door"] for row in prepared.dataset.rows} - doors
    simulated = simulate_for(adaptation.card, tmp_path / "cache", 1, parts=PARTS)
    adaptation.train(prepared.dataset, simulated, "cpu")
    log = adaptation.run.read_log()
    adapted = adaptation.finish(prepared.dataset, simulated, tmp_path / "site.safetensors", "cpu")
    first, last = load_weights(start)[0].state_dict(), load_weights(adaptation.run.weights)[0].state_dict()
    moved = {name for name in first if not torch.equal(first[name], last[name])}
    assert moved
    assert not [name for name in moved if "running" in name or "tracked" in name]
    card = load_weights(tmp_path / "site.safetensors")[1]
    assert card == adapted.card
    assert card.trained_on.endswith("9 labelled frames")
    # The same adaptation goes on where it stopped: nothing is left to do.
    again = Adaptation(site, start, tmp_path, changes=CHANGES)
    assert again.folder == adaptation.folder
    again.train(again.prepare(workers=1).dataset, simulated, "cpu")
    assert again.run.read_log() == log
    assert Adaptation(site[:11], start, tmp_path, changes=CHANGES).folder != adaptation.folder


def test_the_label_belongs_to_the_candidate_at_the_place(
    site: list[LabelledFrame], start: Path, tmp_path: Path
) -> None:
    frames = [frame for frame in site if "00001" in frame.file]
    without = replace(site[0], label="no_door", columns={})
    prepared = prepare_frames([*frames, without], start, tmp_path, 1)
    assert not prepared.left_out
    rows = prepared.dataset.rows
    assert [row["state"] for row in rows[3:]] == ["no_door"] * (len(rows) - 3)
    assert len(rows) > 3
    for frame, row in zip(frames, rows, strict=False):
        assert row[FRAME_COLUMN] == frame.file
        apart_m = np.hypot(
            *(float(row[f"doorway_{axis}"]) - float(frame.columns[f"door_{axis}"]) for axis in ("x_m", "y_m"))
        )
        assert apart_m < 0.75
    assert prepared.dataset.clouds.shape == (len(rows), 128, 3)
    assert (prepared.dataset.parts_of(np.arange(len(rows)), 128) == Part.NONE).all()


def test_one_sided_frames_are_refused(site: list[LabelledFrame], start: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError) as refused:
        Adaptation([frame for frame in site if frame.label != "open"], start, tmp_path)
    assert refused.value.field == "state"

# SPDX-License-Identifier: Apache-2.0
"""Tests of paper.finder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from paper.finder import samples as sources
from paper.finder.samples import TARGETS, WallSamples, make_samples
from paper.finder.train import augmented, export_scorer, train_scorer

from doorstate.doorways.elevation import MAX_COLUMNS


@pytest.fixture(scope="module")
def walls(tmp_path_factory: pytest.TempPathFactory) -> WallSamples:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sources, "SOURCES", (("varied", "none", 5, 1),))
        return make_samples(tmp_path_factory.mktemp("walls"), workers=1)


def test_columns_of_a_door_are_targets(walls: WallSamples) -> None:
    middle = walls.targets[..., TARGETS.middle]
    has_door = middle.max(axis=1) > 0
    assert has_door.sum() >= 3  # three states of one door
    wall = int(np.flatnonzero(has_door)[0])
    near = walls.targets[wall, :, TARGETS.is_near] == 1
    assert 8 <= near.sum() <= 10  # columns of 5 cm within 25 cm
    places_m = np.arange(MAX_COLUMNS)[near] * 0.05 + walls.targets[wall, near, TARGETS.place]
    assert np.ptp(places_m) < 1e-4  # all name the same middle
    assert walls.lengths.max() <= MAX_COLUMNS
    assert (walls.targets[wall, walls.lengths[wall] :] == 0).all()


def test_augmentation_keeps_middles_between_their_ends(walls: WallSamples) -> None:
    numbers = np.arange(len(walls.lengths)).repeat(4)
    cells, columns, targets = augmented(walls, numbers, np.random.default_rng(0))
    assert np.isfinite(cells).all()
    assert np.isfinite(columns).all()
    for target, original in zip(targets, walls.targets[numbers], strict=True):
        # x runs to the left, mirrored or not.
        ends = [target[:, column].argmax() for column in (TARGETS.right, TARGETS.middle, TARGETS.left)]
        if original[:, [TARGETS.right, TARGETS.left]].max(axis=0).min() > 0.5:
            assert ends == sorted(ends)


def test_the_exported_network_gives_the_outputs_of_the_trained_one(
    walls: WallSamples, tmp_path: Path
) -> None:
    network = train_scorer(walls, steps=3)
    export_scorer(network, tmp_path / "scorer.onnx")
    session = onnxruntime.InferenceSession(str(tmp_path / "scorer.onnx"), providers=["CPUExecutionProvider"])
    cells, columns = walls.cells[:2, :50].astype(np.float32), walls.columns[:2, :50]
    (outputs,) = session.run(None, {"cells": cells, "columns": columns})
    with torch.no_grad():
        expected = network(torch.from_numpy(cells), torch.from_numpy(columns)).numpy()
    assert outputs == pytest.approx(expected, abs=1e-4)
    again = train_scorer(walls, steps=3)
    assert all(torch.equal(a, b) for a, b in zip(network.parameters(), again.parameters(), strict=True))

# SPDX-License-Identifier: Apache-2.0
"""Clouds of the page tests: one door in three states, one behind glass, and one that cannot be read."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from doorstate.errors import CloudReadError
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.simulation.frames import Frame
from doorstate.types import STATES
from doorstate.viewer.cloud_page import Entry, make_entry
from doorstate.viewer.named_clouds import NamedCloud

POINTS = 300


@pytest.fixture(scope="module")
def predictor() -> NetworkPredictor:
    """Untrained PointNet, because it is quick."""
    torch.manual_seed(0)
    card = WeightsCard(network="pointnet", num_points=POINTS)
    return NetworkPredictor(TorchBackend(create_network("pointnet"), card))


@pytest.fixture(scope="module")
def clouds(frames: list[Frame]) -> list[NamedCloud]:
    """Two clouds with parts and truth, one without, one behind glass, and an error."""
    glass = frames[0].points.copy()
    glass[:, 200:440] = np.nan
    simulated = [
        NamedCloud(f"{state} door", frame.points, frame.cut.part.reshape(-1), state)
        for state, frame in zip(STATES[:2], frames[:2], strict=True)
    ]
    return [
        *simulated,
        NamedCloud("open/file.pcd", frames[2].points),
        NamedCloud("glass.png", glass),
        NamedCloud("broken.pcd", CloudReadError("not a PCD file", path="broken.pcd")),
    ]


@pytest.fixture(scope="module")
def entries(predictor: NetworkPredictor, clouds: list[NamedCloud]) -> list[Entry]:
    return [make_entry(predictor, cloud) for cloud in clouds]

# SPDX-License-Identifier: Apache-2.0
"""What the tests of the view show: one door in three states, one behind glass, and a file that is broken."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from doorstate.errors import CloudReadError
from doorstate.inference.predictor import Predictor
from doorstate.networks import create_network
from doorstate.networks.weights import WeightsCard
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.generate import PRESETS, draw_pose
from doorstate.types import STATES
from doorstate.viewer.cloud_page import look
from doorstate.viewer.named_clouds import NamedCloud

POINTS = 300
Entry = dict[str, Any]


@pytest.fixture(scope="module")
def viewer() -> Predictor:
    """An untrained PointNet: quick, and any answer will do."""
    torch.manual_seed(0)
    card = WeightsCard(network="pointnet", num_points=POINTS)
    return Predictor(create_network("pointnet"), card, POINTS)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """A closed, a semi-open and an open door from one place."""
    return [replay(row) for row in draw_pose(PRESETS["ogurob"], 3, 700)]


@pytest.fixture(scope="module")
def sightings(frames: list[Frame]) -> list[NamedCloud]:
    """Two with all that can be known, one from a file, one behind glass, one that could not be read."""
    glass = frames[0].points.copy()
    glass[:, 200:440] = np.nan
    known = [
        NamedCloud(f"{state} door", frame.points, frame.cut.part.reshape(-1), state)
        for state, frame in zip(STATES[:2], frames[:2], strict=True)
    ]
    return [
        *known,
        NamedCloud("open/file.pcd", frames[2].points),
        NamedCloud("glass.png", glass),
        NamedCloud("broken.pcd", CloudReadError("broken.pcd: is no PCD file")),
    ]


@pytest.fixture(scope="module")
def entries(viewer: Predictor, sightings: list[NamedCloud]) -> list[Entry]:
    return [look(viewer, sighting) for sighting in sightings]

# SPDX-License-Identifier: Apache-2.0
"""Network, finder and tilt of a doorway predictor that answer as a test says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from doorstate.clouds.leveling import Leveling
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.upright import Upright
from doorstate.inference import doorway_predictor
from doorstate.inference.backends.base import CloudOutputs, Outputs
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.networks.card import HeadErrors, WeightsCard
from doorstate.types import STATES, Points

HEADS = ("door", "angle", "hinge", "frame", "widths")
CARD = WeightsCard(network="pointnet", num_points=128, input="doorway", scale_m=1.5, heads=HEADS)
MEASURED = CARD.model_copy(
    update={
        "errors": HeadErrors(
            along_m=0.04, across_m=0.03, yaw_deg=1.0, width_m=0.1, angle_deg={"semi_open": 6.0, "open": 5.0}
        )
    }
)
FLOOR_M = -1.0


def outputs(state: str = "closed", p_door: float = 0.9, p_state: float = 0.9, **heads: float) -> CloudOutputs:
    """Return outputs for a crop: a state, no correction, a hinge on the left."""
    rest = (1 - p_state) / 2
    values = {
        "p_door": p_door,
        "opening_angle_deg": {"closed": 0.0, "semi_open": 40.0, "open": 90.0}[state],
        "p_hinge_left": 0.8,
        "door_x_m": 0.0,
        "door_y_m": 0.0,
        "door_yaw_deg": 0.0,
        "opening_width_m": 0.9,
        "passable_width_m": 0.8 if state == "open" else 0.1,
    }
    probabilities = np.array([p_state if name == state else rest for name in STATES], np.float32)
    return CloudOutputs(probabilities, values | heads)


class ScriptedBackend:
    """Network that gives its outputs one after the other, whatever the crops."""

    num_points = None
    network = None

    def __init__(self, script: Sequence[CloudOutputs], card: WeightsCard = CARD) -> None:
        self.card = card
        self.script = list(script)
        self.batches: list[tuple[int, ...]] = []  # shapes

    def __call__(self, points: Points) -> Outputs:
        self.batches.append(points.shape)
        answers, self.script = self.script[: len(points)], self.script[len(points) :]
        names: Mapping[str, float] = answers[0].heads
        return Outputs(
            np.stack([answer.probabilities for answer in answers]),
            {name: np.array([answer.heads[name] for answer in answers]) for name in names},
        )


def doorway(
    distance_m: float = 3.0, bearing_deg: float = 0.0, width_m: float = 0.9, score: float = 0.5
) -> Doorway:
    """Return a doorway that faces the camera."""
    bearing = math.radians(bearing_deg)
    x_m, y_m = distance_m * math.cos(bearing), distance_m * math.sin(bearing)
    return Doorway(x_m, y_m, bearing_deg + 90, width_m, FLOOR_M, score)


def scripted_predictor(
    monkeypatch: pytest.MonkeyPatch,
    found: Sequence[Doorway],
    script: Sequence[CloudOutputs],
    card: WeightsCard = CARD,
    leveling: Leveling | None = None,
) -> DoorwayPredictor:
    """Return a predictor without a gate, whose finder and network answer by a script."""

    def find(cloud: Points, **_: float | None) -> Upright:
        return Upright(leveling or Leveling(cloud, np.eye(3), "given", floor_z_m=FLOOR_M), list(found))

    monkeypatch.setattr(doorway_predictor, "find_upright_doorways", find)
    return DoorwayPredictor(ScriptedBackend(script, card), gate=None)


def room() -> Points:
    """Return (N, 3) points that surround the camera, some near every doorway within 5 m."""
    rng = np.random.default_rng(0)
    points: Points = rng.uniform((0.5, -5.0, FLOOR_M), (6.0, 5.0, 1.4), (60_000, 3)).astype(np.float32)
    return points

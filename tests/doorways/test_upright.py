# SPDX-License-Identifier: Apache-2.0
"""Doorways tell which of two directions is up, or the tilt stays refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from paper.answers import gazebo_frames

from doorstate.clouds.leveling import level_cloud
from doorstate.doorways import upright
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.finder import find_doorways
from doorstate.doorways.upright import find_upright_doorways
from doorstate.io.rotations import tilt_matrix
from doorstate.types import Points


def turned(points: Points, roll_deg: float, pitch_deg: float) -> Points:
    return (points @ np.array(tilt_matrix(roll_deg, pitch_deg))).astype(np.float32)


@pytest.fixture(scope="module")
def ambiguous() -> Points:
    """Cloud of a camera that looks 30 degrees down, of which floor and walls leave two directions open."""
    clouds = (turned(points, 0, 30) for _, points in gazebo_frames())
    return next(cloud for cloud in clouds if _code(cloud) == "tilt_ambiguous")


def _code(cloud: Points) -> str | None:
    refusal = level_cloud(cloud).refusal
    return None if refusal is None else refusal.code


def test_doorways_decide_between_two_directions(ambiguous: Points) -> None:
    leveling, doorways = find_upright_doorways(ambiguous)
    assert leveling.refusal is None
    assert leveling.source == "doorways"
    up = np.array(tilt_matrix(0, 30))[2]
    assert math.degrees(math.acos(min(1.0, float(leveling.rotation[2] @ up)))) < 1
    assert leveling.error_deg is not None
    assert doorways == find_doorways(leveling.points, leveling.floor_z_m)


@pytest.mark.parametrize(("first", "second"), [(0.69, 0.1), (0.9, 0.5), (0.0, 0.0)])
def test_unlikely_doorways_and_doorways_both_ways_do_not(
    ambiguous: Points, monkeypatch: pytest.MonkeyPatch, first: float, second: float
) -> None:
    scores = iter((first, second))
    monkeypatch.setattr(
        upright, "find_doorways", lambda *_: [Doorway(3.0, 0.0, 90.0, 0.9, -1.0, score=next(scores))]
    )
    leveling, doorways = find_upright_doorways(ambiguous)
    assert leveling.refusal is not None
    assert leveling.refusal.code == "tilt_ambiguous"
    assert leveling.points is ambiguous
    assert doorways == []


def test_other_refusals_and_given_tilts_stay_as_they_are(ambiguous: Points) -> None:
    wall = np.array([[2.0, y, z] for y in np.arange(-2, 2, 0.02) for z in np.arange(-1, 1, 0.02)], np.float32)
    refused = find_upright_doorways(wall).leveling.refusal
    assert refused is not None
    assert refused.code == "tilt_one_plane"
    given = find_upright_doorways(ambiguous, is_level=True)
    assert (given.leveling.source, given.leveling.points is ambiguous) == ("given", True)

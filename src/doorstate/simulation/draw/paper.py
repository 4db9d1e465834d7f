# SPDX-License-Identifier: Apache-2.0
"""Scenes of the paper's presets: one door in open space, seen from the half-ring of poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from doorstate.simulation.draw.half_ring import draw_heading_offset_deg, half_ring
from doorstate.simulation.draw.openings import ANGLES_DEG
from doorstate.simulation.draw.scenes import DrawnScene
from doorstate.simulation.draw.viewpoints import Viewpoint
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.scene import Scene
from doorstate.types import DoorState

FIXED_ANGLES_DEG = {
    DoorState.CLOSED: (0.0, 0.0),
    DoorState.SEMI_OPEN: (45.0, 45.0),
    DoorState.OPEN: (90.0, 90.0),
}


def draw_paper_scene(
    seed: int,
    index: int,
    door: Door = Door(),  # noqa: B008 (frozen)
    angles_deg: Mapping[DoorState, tuple[float, float]] = ANGLES_DEG,
) -> DrawnScene:
    """Draw one pose of the half-ring and an opening for each state.

    Args:
        seed: seed of the data set.
        index: number of the position in `half_ring()`.
        door: the door of all scenes.
        angles_deg: range of opening angles for each state.
    """
    openings = []
    for state in DoorState:
        # From 1: numpy pads short seeds with zeros, so 0 would repeat the number drawn for the heading.
        rng = np.random.default_rng([seed, index, 1 + state.class_index])
        openings.append(Opening(angle_deg=float(rng.uniform(*angles_deg[state]))))
    viewpoint = Viewpoint.on_lattice(half_ring()[index], draw_heading_offset_deg(seed, index))
    return DrawnScene(Scene(door=door, has_ceiling=False), viewpoint, openings)

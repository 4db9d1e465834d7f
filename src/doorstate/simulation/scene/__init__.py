# SPDX-License-Identifier: Apache-2.0
"""Scenes as boxes: a door or another wall feature, the rooms on both sides, and clutter.

Door frame: origin in the middle of the opening, on the floor, on the robot's face of the wall; x along the wall, y from
the wall to the robot, z up. Looking at the wall, left is +x.
"""

from doorstate.simulation.scene.box import Box, Material
from doorstate.simulation.scene.door import Door, DoorKind, Opening
from doorstate.simulation.scene.scene import Scene, scene_boxes

__all__ = [
    "Box",
    "Door",
    "DoorKind",
    "Material",
    "Opening",
    "Scene",
    "scene_boxes",
]

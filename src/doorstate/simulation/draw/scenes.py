# SPDX-License-Identifier: Apache-2.0
"""Random scenes with or without a door: rooms, a camera, openings, and clutter that hides the door."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from doorstate.errors import ConfigError
from doorstate.simulation.camera import CameraBias, DepthCamera
from doorstate.simulation.draw.clutter import draw_items
from doorstate.simulation.draw.doors import draw_door
from doorstate.simulation.draw.features import draw_feature
from doorstate.simulation.draw.openings import draw_any_openings, draw_openings
from doorstate.simulation.draw.rooms import draw_far, draw_near
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.draw.viewpoints import Viewpoint, draw_viewpoint
from doorstate.simulation.occlusion import BINS, DoorView, occluded_bin
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.clearance import free_angle_deg
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import fixed_boxes, frame_and_leaf_boxes, leaf_boxes
from doorstate.simulation.scene.feature import feature_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.room import Space
from doorstate.simulation.scene.scene import Scene, clutter_boxes, room_boxes
from doorstate.types import Part

_SCENE_TRIES, _CLUTTER_TRIES = 60, 150
LEAST_FREE_DEG = 80
LEAF_TO_ROBOT_M, ITEM_TO_ROBOT_M = 0.2, 0.3
_MOST_ITEMS, FEW_ITEMS = 8, 4


class DrawnScene(NamedTuple):
    """A scene, its camera, and the openings to render it with."""

    scene: Scene
    viewpoint: Viewpoint
    openings: list[Opening]
    clutter_tries: int = 0
    other_openings: Sequence[tuple[Opening, ...]] = ()  # of the other doors, one entry for each of `openings`
    door_id: str = ""  # of a main door that other scenes show, too
    bias: CameraBias | None = None


def draw_varied(stream: Stream) -> DrawnScene:
    """Draw a door with one opening for each state."""
    return _draw_door_scene(stream, any_opening=False)


def draw_varied_angles(stream: Stream) -> DrawnScene:
    """Draw a door with three openings that together are uniform from closed to 115 degrees."""
    return _draw_door_scene(stream, any_opening=True)


def draw_cluttered(stream: Stream) -> DrawnScene:
    """Draw a door behind 1 to 8 items; its hidden share when closed falls into a bin, all bins equally often."""
    target_bin = stream.choice(dict.fromkeys(BINS[:-1], 1.0))
    for _ in range(_SCENE_TRIES):
        drawn = draw_varied(stream)
        door, viewpoint = drawn.scene.door, drawn.viewpoint
        assert door is not None
        view = DoorView(drawn.scene, drawn.openings[0], viewpoint.camera_pose(), DepthCamera())
        leaves = [box for opening in drawn.openings for box in leaf_boxes(door, opening)]
        obstacles = [
            *fixed_boxes(door),
            *leaves,
            *solid(room_boxes(drawn.scene)),
            viewpoint.robot_box(ITEM_TO_ROBOT_M),
        ]
        for number in range(1, _CLUTTER_TRIES + 1):
            scene = with_items(stream, drawn.scene, viewpoint, _MOST_ITEMS, obstacles)
            boxes = clutter_boxes(scene)
            if boxes and occluded_bin(view.occluded_share(boxes)) == target_bin:
                return drawn._replace(scene=scene, clutter_tries=number)
    raise exhausted()


def draw_no_door(stream: Stream) -> DrawnScene:
    """Draw a wall without a door; in half of the scenes up to four items stand before it."""
    for _ in range(_SCENE_TRIES):
        viewpoint = draw_viewpoint(stream)
        feature = draw_feature(stream, viewpoint.x_m)
        cornered = feature.kind in ("inner_corner", "outer_corner")
        near = draw_near(stream, feature.width_m / 2, viewpoint.x_m, viewpoint.y_m)
        far = draw_far(stream, feature.width_m / 2) if feature.kind == "passage" else Space()
        scene = Scene(feature=feature, near=Space() if cornered else near, far=far)
        walls = solid([*feature_boxes(feature), *room_boxes(scene)])
        robot = viewpoint.robot_box(ITEM_TO_ROBOT_M)
        if collide([robot], walls):
            continue
        if stream.chance(0.5):
            scene = with_items(stream, scene, viewpoint, FEW_ITEMS, [*walls, robot])
        return DrawnScene(scene, viewpoint, [Opening()])
    raise exhausted()


def _draw_door_scene(stream: Stream, any_opening: bool) -> DrawnScene:
    for _ in range(_SCENE_TRIES):
        door = draw_door(stream)
        viewpoint = draw_viewpoint(stream)
        near = draw_near(stream, door.half_width_m, viewpoint.x_m, viewpoint.y_m)
        scene = Scene(door=door, near=near, far=draw_far(stream, door.half_width_m))
        walls = solid(room_boxes(scene))
        free_deg = turning_deg(door, walls)
        if free_deg < LEAST_FREE_DEG:
            continue
        openings = (draw_any_openings if any_opening else draw_openings)(stream, door, free_deg)
        robot = viewpoint.robot_box(LEAF_TO_ROBOT_M)
        if not any(collide([robot], leaf_boxes(door, opening)) for opening in openings):
            return DrawnScene(scene, viewpoint, openings)
    raise exhausted()


def turning_deg(door: Door, walls: list[Box]) -> float:
    """Return the free angle between walls; for a door that opens by a share 180 if it can do so fully, or else 0."""
    if door.opens_by_share:
        blocked = collide(frame_and_leaf_boxes(door, Opening(share=1.0)), walls)
        return 0.0 if blocked else 180.0
    return free_angle_deg(door, walls)


def solid(boxes: list[Box]) -> list[Box]:
    """Return boxes without floor and ceiling, which items and robot touch by design."""
    return [box for box in boxes if box.part not in (Part.FLOOR, Part.CEILING)]


def with_items(stream: Stream, scene: Scene, viewpoint: Viewpoint, most: int, obstacles: list[Box]) -> Scene:
    """Return the scene with up to `most` items that touch nothing."""
    items = draw_items(stream, stream.integer(1, most), (viewpoint.x_m, viewpoint.y_m), scene.near, obstacles)
    return scene.model_copy(update={"items": items})


def exhausted(tries: int = _SCENE_TRIES) -> ConfigError:
    """Return the error of a seed that gives no scene."""
    return ConfigError(f"no scene fits in {tries} tries", hint="use another seed", field="seed")

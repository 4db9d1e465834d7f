# SPDX-License-Identifier: Apache-2.0
"""Scenes drawn from a seed: a door or none, spaces around it, a camera, openings, and things that hide the door."""

from __future__ import annotations

from typing import NamedTuple

from doorstate.errors import ConfigError
from doorstate.simulation.clutter import draw_items
from doorstate.simulation.door_draws import draw_any_openings, draw_door, draw_openings
from doorstate.simulation.doors import Opening, VariedDoor, fixed_boxes, free_angle_deg, leaf_boxes
from doorstate.simulation.draws import Draws
from doorstate.simulation.no_door import draw_feature, feature_boxes
from doorstate.simulation.occlusion import BINS, DoorView, occluded_bin
from doorstate.simulation.plan import collide
from doorstate.simulation.rooms import Space, draw_far, draw_near
from doorstate.simulation.scene import Box
from doorstate.simulation.scenes import Scene, clutter_boxes, room_boxes
from doorstate.simulation.sensor import DepthCamera
from doorstate.simulation.viewpoints import Viewpoint, draw_viewpoint
from doorstate.types import Part

_SCENE_TRIES, _CLUTTER_TRIES = 60, 150
_LEAST_FREE_DEG = 80
_LEAF_TO_ROBOT_M, _ITEM_TO_ROBOT_M = 0.2, 0.3
_MOST_ITEMS, _FEW_ITEMS = 8, 4


class DrawnScene(NamedTuple):
    """A scene, its camera, and the openings in which it is seen."""

    scene: Scene
    viewpoint: Viewpoint
    openings: list[Opening]
    clutter_tries: int = 0


def draw_varied(draws: Draws) -> DrawnScene:
    """A door in one opening for each state."""
    return _draw_door_scene(draws, any_opening=False)


def draw_varied_angles(draws: Draws) -> DrawnScene:
    """A door in three openings that together are uniform from closed to 115 degrees."""
    return _draw_door_scene(draws, any_opening=True)


def draw_cluttered(draws: Draws) -> DrawnScene:
    """A door behind 1 to 8 things; when closed it is hidden by a share from one bin, all bins equally often."""
    wanted = draws.one_of(dict.fromkeys(BINS[:-1], 1.0))
    for _ in range(_SCENE_TRIES):
        drawn = draw_varied(draws)
        door, viewpoint = drawn.scene.door, drawn.viewpoint
        assert door is not None
        view = DoorView(drawn.scene, drawn.openings[0], viewpoint.camera_pose(), DepthCamera())
        leaves = [box for opening in drawn.openings for box in leaf_boxes(door, opening)]
        obstacles = [
            *fixed_boxes(door),
            *leaves,
            *_walls(room_boxes(drawn.scene)),
            viewpoint.robot(_ITEM_TO_ROBOT_M),
        ]
        for number in range(1, _CLUTTER_TRIES + 1):
            scene = _with_items(draws, drawn.scene, viewpoint, _MOST_ITEMS, obstacles)
            boxes = clutter_boxes(scene)
            if boxes and occluded_bin(view.occluded_share(boxes)) == wanted:
                return drawn._replace(scene=scene, clutter_tries=number)
    raise _exhausted()


def draw_no_door(draws: Draws) -> DrawnScene:
    """A wall without a door; in half of the scenes up to four things stand before it."""
    for _ in range(_SCENE_TRIES):
        viewpoint = draw_viewpoint(draws)
        feature = draw_feature(draws, viewpoint.x_m)
        cornered = feature.kind in ("inner_corner", "outer_corner")
        near = draw_near(draws, feature.width_m / 2, viewpoint.x_m, viewpoint.y_m)
        far = draw_far(draws, feature.width_m / 2) if feature.kind == "passage" else Space()
        scene = Scene(feature=feature, near=Space() if cornered else near, far=far)
        walls = _walls([*feature_boxes(feature), *room_boxes(scene)])
        robot = viewpoint.robot(_ITEM_TO_ROBOT_M)
        if collide([robot], walls):
            continue
        if draws.chance(0.5):
            scene = _with_items(draws, scene, viewpoint, _FEW_ITEMS, [*walls, robot])
        return DrawnScene(scene, viewpoint, [Opening()])
    raise _exhausted()


def _draw_door_scene(draws: Draws, any_opening: bool) -> DrawnScene:
    for _ in range(_SCENE_TRIES):
        door = draw_door(draws)
        viewpoint = draw_viewpoint(draws)
        half = door.opening_width_m / 2 + door.jamb_thickness_m + door.casing_width_m
        near = draw_near(draws, half, viewpoint.x_m, viewpoint.y_m)
        scene = Scene(door=door, near=near, far=draw_far(draws, half))
        walls = _walls(room_boxes(scene))
        free_deg = _free_deg(door, walls)
        if free_deg < _LEAST_FREE_DEG:
            continue
        openings = (draw_any_openings if any_opening else draw_openings)(draws, door, free_deg)
        robot = viewpoint.robot(_LEAF_TO_ROBOT_M)
        if not any(collide([robot], leaf_boxes(door, opening)) for opening in openings):
            return DrawnScene(scene, viewpoint, openings)
    raise _exhausted()


def _free_deg(door: VariedDoor, walls: list[Box]) -> float:
    """How far a door turns between walls; a sliding one that slides all the way does so at any angle."""
    if door.is_sliding:
        blocked = collide([*leaf_boxes(door, Opening(share=1.0)), *fixed_boxes(door)], walls)
        return 0.0 if blocked else 180.0
    return free_angle_deg(door, walls)


def _walls(boxes: list[Box]) -> list[Box]:
    """Without floor and ceiling: what stands on the floor touches it."""
    return [box for box in boxes if box.part not in (Part.FLOOR, Part.CEILING)]


def _with_items(draws: Draws, scene: Scene, viewpoint: Viewpoint, most: int, obstacles: list[Box]) -> Scene:
    items = draw_items(draws, draws.whole(1, most), (viewpoint.x_m, viewpoint.y_m), scene.near, obstacles)
    return scene.model_copy(update={"items": items})


def _exhausted() -> ConfigError:
    return ConfigError(f"no scene fits in {_SCENE_TRIES} tries; use another seed")

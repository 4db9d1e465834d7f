# SPDX-License-Identifier: Apache-2.0
"""Doors beside the main door: their poses, the gaps they cut, and scenes that cannot be."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.clutter import Item
from doorstate.simulation.scene.feature import Feature
from doorstate.simulation.scene.placed_door import PlacedDoor, WallName, wall_pose
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.room import Space
from doorstate.simulation.scene.scene import box_groups
from doorstate.types import Part

NEAR = Space(left_m=3.0, right_m=2.0, depth_m=4.0)
WALLS: tuple[WallName, ...] = ("main", "left", "opposite", "right")
ALONG_M = {"main": 1.5, "left": 2.0, "opposite": 0.5, "right": -2.5}
MIDDLE_M = {"main": (1.5, 0.0), "left": (3.0, 2.0), "opposite": (-0.5, 4.0), "right": (-2.0, 2.5)}
INTO_THE_ROOM = {"main": (0, 1), "left": (-1, 0), "opposite": (0, -1), "right": (1, 0)}


def placed(wall: WallName, **values: object) -> PlacedDoor:
    return PlacedDoor(door=Door(hinge="right").model_copy(update=values), wall=wall, along_m=ALONG_M[wall])


def scene(*doors: PlacedDoor) -> Scene:
    return Scene(door=Door(), near=NEAR, far=Space(left_m=1.0, depth_m=3.0), other_doors=doors)


@pytest.mark.parametrize("wall", WALLS)
def test_a_door_stands_in_its_wall_and_faces_the_room(wall: WallName) -> None:
    pose = placed(wall).pose(NEAR)
    assert (pose.x_m, pose.y_m) == pytest.approx(MIDDLE_M[wall])
    assert (-math.sin(pose.yaw_rad), math.cos(pose.yaw_rad)) == pytest.approx(INTO_THE_ROOM[wall], abs=1e-12)
    back = pose.after(pose.inverse())
    assert back == pytest.approx(Pose(0.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("wall", WALLS)
def test_a_robot_passes_through_every_door_and_nowhere_else(wall: WallName) -> None:
    boxes = [
        box
        for box in scene_boxes(scene(*map(placed, WALLS)), Opening(angle_deg=90), [Opening(angle_deg=90)] * 4)
        if box.part is not Part.FLOOR
    ]
    passage = Box(Part.OTHER, (0.0, -0.1, 0.5), (0.6, 0.6, 0.9))
    pose = placed(wall).pose(NEAR)
    assert not collide(pose.place([passage]), boxes)
    beside = Pose(pose.x_m, pose.y_m, pose.yaw_rad).after(Pose(-0.9, 0.0, 0.0))
    assert collide(beside.place([passage]), [box for box in boxes if box.part is Part.WALL])
    assert collide(pose.place([passage]), scene_boxes(scene(*map(placed, WALLS)), Opening(), [Opening()] * 4))


def test_boxes_of_each_door_are_numbered() -> None:
    item = Item(kind="bin", x_m=0, y_m=2, yaw_deg=0, width_m=0.3, depth_m=0.3, height_m=0.5)
    groups = box_groups(
        scene(placed("left"), placed("right")).model_copy(update={"items": (item,)}),
        Opening(),
        [Opening()] * 2,
    )
    boxes = groups.all()
    main, left, right = (
        [boxes[number] for number in numbers if boxes[number].part is Part.LEAF] for numbers in groups.doors()
    )
    assert [len(leaves) for leaves in (main, left, right)] == [1, 1, 1]
    assert left[0].center_m[0] > 2.9
    assert right[0].center_m[0] < -1.9
    assert boxes[-1].part is Part.OTHER


def test_a_scene_without_other_doors_has_the_json_it_had() -> None:
    assert "other_doors" not in Scene(door=Door()).model_dump_json(exclude_none=True)


@pytest.mark.parametrize(
    "values",
    [
        {"other_doors": (placed("left", wall_height_m=2.5),)},
        {"other_doors": (placed("main", wall_thickness_m=0.2),)},
        {"other_doors": (placed("left"),), "near": Space()},
        {"other_doors": (placed("opposite"),), "near": Space(left_m=1.0)},
        {
            "door": None,
            "feature": Feature(kind="wall", wall_thickness_m=0.15, wall_height_m=2.6),
            "other_doors": (placed("left"),),
        },
    ],
)
def test_impossible_scenes_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Scene.model_validate({"door": Door(), "near": NEAR} | values)


def test_a_missing_wall_is_refused() -> None:
    with pytest.raises(ValueError, match="left"):
        wall_pose("left", Space())

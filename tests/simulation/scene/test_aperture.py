# SPDX-License-Identifier: Apache-2.0
"""Apertures: rays pass through them and end where they should; floors end with their spaces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.render import Render, render_behind_glass
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.simulation.scene.aperture import Aperture, ApertureKind
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.feature import Feature
from doorstate.simulation.scene.placed_door import WallName
from doorstate.simulation.scene.room import OUTDOORS, Space
from doorstate.simulation.scene.scene import room_boxes
from doorstate.simulation.scene.stairs import Stairs
from doorstate.types import Part

ROOM = Space(left_m=2.0, right_m=2.0, depth_m=3.0)
CAMERA = Intrinsics.from_hfov(33, 25, math.radians(60))
# Position and heading of a camera that looks straight at the middle of each wall.
VIEWS: dict[WallName, tuple[float, float, float]] = {
    "main": (0.0, 2.5, -90.0),
    "left": (-1.5, 1.5, 0.0),
    "opposite": (0.0, 0.5, 90.0),
    "right": (1.5, 1.5, 180.0),
}
MIDDLE = {"main": 0.0, "left": 1.5, "opposite": 0.0, "right": -1.5}


def scene(*apertures: Aperture, stairs: tuple[Stairs, ...] = ()) -> Scene:
    wall = Feature(kind="wall", wall_thickness_m=0.2, wall_height_m=2.6)
    return Scene(
        feature=wall, near=ROOM, far=OUTDOORS, layout="room", apertures=apertures, stairs=stairs or None
    )


def aperture(kind: ApertureKind, wall: WallName, **values: object) -> Aperture:
    sizes = {"width_m": 1.0, "bottom_m": 0.8, "top_m": 2.0, "wall_thickness_m": 0.2} | values
    return Aperture(kind=kind, wall=wall, along_m=MIDDLE[wall], **sizes)


def look(built: Scene, wall: WallName, height_m: float = 1.4) -> Render:
    x, y, heading = VIEWS[wall]
    pose = CameraPose.from_degrees((x, y, height_m), heading, 0.0)
    return render_behind_glass(scene_boxes(built, Opening()), pose, CAMERA)


@pytest.mark.parametrize("wall", VIEWS)
def test_nothing_is_seen_through_a_window(wall: WallName) -> None:
    solid = 2.5 if wall in ("main", "opposite") else 3.5
    assert look(scene(), wall).depth_m[12, 16] == pytest.approx(solid)
    seen = look(scene(aperture("window", wall)), wall)
    assert np.isinf(seen.depth_m[12, 16])
    # Around it: the casement, then the wall.
    assert {Part.OTHER, Part.WALL} <= set(np.unique(seen.part).tolist())
    assert seen.depth_m[12, 0] == pytest.approx(solid) or wall in ("left", "right")


@pytest.mark.parametrize("wall", VIEWS)
def test_a_niche_has_a_back_and_a_passage_the_space_beyond(wall: WallName) -> None:
    solid = 2.5 if wall in ("main", "opposite") else 3.5
    assert look(scene(aperture("niche", wall, depth_m=0.5)), wall).depth_m[12, 16] == pytest.approx(
        solid + 0.5
    )
    beyond = Space(left_m=1.0, right_m=1.0, depth_m=2.0)
    passage = aperture("passage", wall, bottom_m=0.0, beyond=beyond)
    seen = look(scene(passage), wall)
    assert seen.depth_m[12, 16] == pytest.approx(solid + 0.2 + 2.0)
    assert Part.OTHER not in seen.part


def test_an_open_sash_turns_into_the_room() -> None:
    closed, ajar = (
        [
            box
            for box in room_boxes(scene(aperture("window", "left", sashes=2, sash_deg=angle)))
            if box.part is Part.OTHER
        ]
        for angle in (0.0, 90.0)
    )
    assert len(closed) == len(ajar) == 10
    assert min(box.center_m[0] for box in closed) > 1.99
    assert min(box.center_m[0] for box in ajar) == pytest.approx(2.0 - 0.5, abs=0.06)


def test_floors_end_with_their_spaces_and_leave_holes_for_stairs() -> None:
    def area(boxes: list[Box], part: Part) -> float:
        return sum(box.size_m[0] * box.size_m[1] for box in boxes if box.part is part)

    passage = aperture("passage", "left", bottom_m=0.0, beyond=Space(left_m=1.0, right_m=0.5, depth_m=2.0))
    bare = room_boxes(scene(aperture("window", "right"), passage))
    assert area(bare, Part.FLOOR) == area(bare, Part.CEILING) == pytest.approx(4 * 3 + 1.5 * 2.2)
    down = Stairs(x_m=-1.0, y_m=2.0, yaw_deg=-90.0, width_m=1.0, going_m=0.25, rise_m=-0.17, steps=4)
    assert area(room_boxes(scene(stairs=(down,))), Part.FLOOR) == pytest.approx(4 * 3 - 1)
    assert area(
        room_boxes(scene(stairs=(down.model_copy(update={"rise_m": 0.17}),))), Part.FLOOR
    ) == pytest.approx(12)


def test_apertures_need_their_wall_and_its_thickness() -> None:
    with pytest.raises(ValidationError, match="thickness"):
        scene(aperture("window", "main", wall_thickness_m=0.3))
    with pytest.raises(ValidationError, match="without such a wall"):
        Scene(door=Door(), layout="room", apertures=(aperture("window", "left"),))

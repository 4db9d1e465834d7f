# SPDX-License-Identifier: Apache-2.0
"""Manifest rows of drawn scenes: from a seed to rows, and what a row needs to be rendered again."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Literal

from pydantic import ConfigDict, field_serializer, field_validator

from doorstate._models import FrozenModel
from doorstate.simulation.door_draws import state_of
from doorstate.simulation.doors import Opening, passable_width_m
from doorstate.simulation.draws import Draws
from doorstate.simulation.frames import Frame, door_place, simulate
from doorstate.simulation.occlusion import DoorView, occluded_bin
from doorstate.simulation.scene import Box
from doorstate.simulation.scene_draws import (
    DrawnScene,
    draw_cluttered,
    draw_no_door,
    draw_varied,
    draw_varied_angles,
)
from doorstate.simulation.scenes import Scene, clutter_boxes, scene_boxes
from doorstate.simulation.sensor import CameraPose, DepthCamera
from doorstate.types import NO_DOOR

PresetName = Literal["varied", "varied-angles", "cluttered", "no-door"]
_DRAWS: dict[PresetName, Callable[[Draws], DrawnScene]] = {
    "varied": draw_varied,
    "varied-angles": draw_varied_angles,
    "cluttered": draw_cluttered,
    "no-door": draw_no_door,
}


class ScenePreset(FrozenModel):
    """What a data set of many scenes draws; the ranges are in the data card."""

    name: PresetName
    camera: DepthCamera = DepthCamera()


SCENE_PRESETS = {name: ScenePreset(name=name) for name in _DRAWS}


class SceneRow(FrozenModel):
    """One line of the manifest of a preset of many scenes.

    `scene`, the opening, camera, sensor, seed and name rebuild the frame; the others describe it. Poses are in the door
    frame (simulation.scene) but for `door_*`, which is the door frame in the sensor frame. What a scene without a door,
    or a door that slides, does not have is empty.
    """

    model_config = ConfigDict(allow_inf_nan=False)

    sample_id: str
    pose_id: str
    scene_id: str
    state: Literal["closed", "semi_open", "open", "no_door"]
    ambiguous: bool = False  # between the ranges of two states
    scene_kind: str  # door, or what is there instead of one
    door_kind: str = ""
    hinge: str = ""
    swing: str = ""
    opening_angle_deg: float | None = None
    passive_angle_deg: float | None = None
    opening_share: float | None = None
    opening_width_m: float | None = None
    opening_height_m: float | None = None
    passable_width_m: float | None = None
    x_m: float
    y_m: float
    camera_height_m: float
    heading_deg: float
    heading_offset_deg: float  # from the bearing to the door's middle
    pitch_deg: float
    roll_deg: float
    distance_m: float
    robot_angle_deg: float
    door_x_m: float | None = None
    door_y_m: float | None = None
    door_z_m: float | None = None
    door_yaw_deg: float | None = None
    seed: int
    sensor: str = "none"
    camera: DepthCamera
    scene: Scene
    clutter_tries: int = 0
    occluded_share: float | None = None
    occluded_bin: str = ""
    measured_px: int = 0
    visible_leaf_px: int = 0
    visible_frame_px: int = 0
    visible_opening_px: int = 0
    same_image_as: str = ""
    depth_sha256: str = ""

    @field_serializer("scene")
    def _to_json(self, scene: Scene) -> str:
        return scene.model_dump_json(exclude_none=True)

    @field_validator("scene", mode="before")
    @classmethod
    def _from_json(cls, scene: object) -> object:
        return json.loads(scene) if isinstance(scene, str) else scene

    def camera_pose(self) -> CameraPose:
        """The camera in the door frame."""
        at_m = self.x_m, self.y_m, self.camera_height_m
        return CameraPose.of_degrees(at_m, self.heading_deg, self.pitch_deg, self.roll_deg)

    def opening(self) -> Opening:
        """How far the door is open."""
        return Opening(
            angle_deg=self.opening_angle_deg or 0.0,
            passive_angle_deg=self.passive_angle_deg or 0.0,
            share=self.opening_share or 0.0,
        )

    def boxes(self) -> list[Box]:
        """What the camera looks at."""
        return scene_boxes(self.scene, self.opening())


def draw_scene(preset: ScenePreset, seed: int, index: int) -> list[SceneRow]:
    """The samples of one scene, drawn and not yet rendered: three openings of a door, or one without a door.

    All samples of a scene share its door, room, clutter and camera. Draws depend on the preset's name, seed and index
    alone, so any order or sharding gives the same rows.
    """
    drawn = _DRAWS[preset.name](Draws(seed, index, preset.name))
    scene_id = f"{preset.name}-{seed}-{index:05d}"
    scene, view = drawn.scene, drawn.viewpoint
    row = SceneRow(
        sample_id=f"{scene_id}-{NO_DOOR}",
        pose_id=scene_id,
        scene_id=scene_id,
        state=NO_DOOR,
        scene_kind=scene.feature.kind if scene.feature else "door",
        x_m=view.x_m,
        y_m=view.y_m,
        camera_height_m=view.camera_height_m,
        heading_deg=view.heading_deg,
        heading_offset_deg=view.heading_offset_deg,
        pitch_deg=view.pitch_deg,
        roll_deg=view.roll_deg,
        distance_m=view.distance_m,
        robot_angle_deg=view.robot_angle_deg,
        seed=seed,
        camera=preset.camera,
        scene=scene,
        clutter_tries=drawn.clutter_tries,
    )
    if scene.door is None:
        return [row]
    by_angle = preset.name == "varied-angles"
    return [
        row.model_copy(update=_of_opening(row, opening, f"a{number}" if by_angle else None))
        for number, opening in enumerate(drawn.openings)
    ]


def _of_opening(row: SceneRow, opening: Opening, name: str | None) -> dict[str, object]:
    door = row.scene.door
    assert door is not None
    state, ambiguous = state_of(door, opening)
    return {
        "sample_id": f"{row.scene_id}-{name or state.label}",
        "state": state.label,
        "ambiguous": ambiguous,
        "door_kind": door.kind,
        "hinge": "" if door.is_sliding else door.hinge,
        "swing": door.swing,
        "opening_angle_deg": None if door.is_sliding else opening.angle_deg,
        "passive_angle_deg": opening.passive_angle_deg if door.is_double else None,
        "opening_share": opening.share if door.is_sliding else None,
        "opening_width_m": door.opening_width_m,
        "opening_height_m": door.opening_height_m,
        "passable_width_m": round(passable_width_m(door, opening), 4),
        **door_place(row.x_m, row.y_m, row.camera_height_m, math.radians(row.heading_deg)),
    }


def simulate_scene(
    preset: ScenePreset, seed: int, index: int, sensor: str = "none"
) -> tuple[list[SceneRow], list[Frame]]:
    """Draw and render the samples of one scene and fill in what can be seen of its door."""
    rows = draw_scene(preset, seed, index)
    door = rows[0].scene.door
    filled, frames = simulate(
        rows, sensor, None if door is None else (door.opening_width_m, door.opening_height_m)
    )
    return [row.model_copy(update=_of_scene(row)) for row in filled], frames


def _of_scene(row: SceneRow) -> dict[str, object]:
    found: dict[str, object] = {"same_image_as": " ".join(sorted(row.same_image_as.split()))}
    if row.scene.door is None:
        return found
    share = 0.0
    if row.scene.items:
        view = DoorView(row.scene, row.opening(), row.camera_pose(), row.camera)
        share = view.occluded_share(clutter_boxes(row.scene))
    return found | {"occluded_share": share, "occluded_bin": occluded_bin(share)}

# SPDX-License-Identifier: Apache-2.0
"""One sample of a simulated data set: everything needed to render it again, and what its frame shows."""

from __future__ import annotations

import json
from typing import Literal, Self

from pydantic import Field, field_serializer, field_validator, model_validator

from doorstate._documents import parse_json
from doorstate._models import Degrees, FrozenModel, Metres, Seed
from doorstate.errors import DatasetError
from doorstate.simulation.camera import CameraBias, CameraPose, DepthCamera
from doorstate.simulation.noise.conditions import Conditions
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.scene import BoxGroups, Scene, box_groups
from doorstate.simulation.true_door import OtherDoor


class Row(FrozenModel):
    """One line of a manifest.

    The scene, opening, camera, pose, sensor, seed and name rebuild the frame; the other columns describe it. Poses
    are in the door frame, except `door_*`, which is the door frame in the sensor frame. Columns that do not apply are
    empty: those of the door in scenes without one, angles of a door that opens by a share, and `scene_id` where all
    samples of a data set show the same scene. Where several poses show one door, `scene_id` names the door. All
    columns of a door describe the main door; `other_doors` holds those beside it. The state of folding and revolving
    doors is `unknown`.
    """

    sample_id: str
    pose_id: str
    scene_id: str = ""
    state: Literal["closed", "semi_open", "open", "no_door", "unknown"]
    ambiguous: bool = False  # between the ranges of two states
    scene_kind: str  # "door", or the kind of the feature
    door_kind: str = ""
    hinge: str = ""
    swing: str = ""
    opening_angle_deg: Degrees | None = None
    passive_angle_deg: Degrees | None = None
    opening_share: float | None = None
    opening_width_m: Metres | None = None
    opening_height_m: Metres | None = None
    passable_width_m: Metres | None = None
    x_m: Metres
    y_m: Metres
    camera_height_m: Metres
    heading_deg: Degrees
    heading_offset_deg: Degrees  # from the bearing to the door's middle
    pitch_deg: Degrees
    roll_deg: Degrees
    distance_m: Metres
    robot_angle_deg: Degrees
    door_x_m: Metres | None = None
    door_y_m: Metres | None = None
    door_z_m: Metres | None = None
    door_yaw_deg: Degrees | None = None
    seed: Seed
    sensor: str = "none"  # a name for noise.sensors.find_sensor
    conditions: Conditions | None = None  # of sensors that depend on them
    camera: DepthCamera
    bias: CameraBias | None = None  # poses and angles are the true ones
    scene: Scene
    other_doors: tuple[OtherDoor, ...] = Field(default=(), max_length=20)
    clutter_tries: int = 0
    occluded_share: float | None = None
    occluded_bin: str = ""
    measured_px: int = 0
    visible_leaf_px: int = 0
    visible_frame_px: int = 0
    visible_opening_px: int = 0
    same_image_as: str = ""  # other states of the pose that give the same image
    depth_sha256: str = ""

    @field_serializer("scene")
    def _scene_to_json(self, scene: Scene) -> str:
        return scene.model_dump_json(exclude_none=True)

    @field_serializer("other_doors")
    def _other_doors_to_json(self, doors: tuple[OtherDoor, ...]) -> str | None:
        return json.dumps([door.model_dump(mode="json") for door in doors]) if doors else None

    @field_validator("scene", "other_doors", mode="before")
    @classmethod
    def _from_json(cls, value: object) -> object:
        try:
            return parse_json(value, DatasetError) if isinstance(value, str) else value
        except DatasetError as error:
            raise ValueError(error.message) from error

    @model_validator(mode="after")
    def _check_other_doors(self) -> Self:
        if len(self.other_doors) != len(self.scene.other_doors or ()):
            raise ValueError("one entry of other_doors for each of the scene")
        return self

    def camera_pose(self) -> CameraPose:
        """Return the camera in the door frame."""
        position_m = self.x_m, self.y_m, self.camera_height_m
        return CameraPose.from_degrees(position_m, self.heading_deg, self.pitch_deg, self.roll_deg)

    def told_tilt_deg(self) -> tuple[float, float]:
        """Return pitch and roll as the camera tells them."""
        bias = self.bias or CameraBias()
        return self.pitch_deg + bias.pitch_deg, self.roll_deg + bias.roll_deg

    def opening(self) -> Opening:
        """Return the angles or the share the door is open by."""
        return Opening(
            angle_deg=self.opening_angle_deg or 0.0,
            passive_angle_deg=self.passive_angle_deg or 0.0,
            share=self.opening_share or 0.0,
        )

    def box_groups(self, opening: Opening | None = None) -> BoxGroups:
        """Return the boxes of the scene in the door frame, by what they belong to; by default with its own opening."""
        others = [door.opening for door in self.other_doors]
        return box_groups(self.scene, opening or self.opening(), others)

    def boxes(self) -> list[Box]:
        """Return the boxes of the scene in the door frame."""
        return self.box_groups().all()

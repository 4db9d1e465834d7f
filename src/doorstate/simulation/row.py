# SPDX-License-Identifier: Apache-2.0
"""One sample of a simulated data set: everything needed to render it again, and what its frame shows."""

from __future__ import annotations

from typing import Literal

from pydantic import field_serializer, field_validator

from doorstate._documents import parse_json
from doorstate._models import Degrees, FrozenModel, Metres, Seed
from doorstate.errors import DatasetError
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.scene import Scene, scene_boxes


class Row(FrozenModel):
    """One line of a manifest.

    The scene, opening, camera, pose, sensor, seed and name rebuild the frame; the other columns describe it. Poses are
    in the door frame, except `door_*`, which is the door frame in the sensor frame. Columns that do not apply are
    empty: those of the door in scenes without one, angles of a sliding door, and `scene_id` where all samples of a data
    set show the same scene.
    """

    sample_id: str
    pose_id: str
    scene_id: str = ""
    state: Literal["closed", "semi_open", "open", "no_door"]
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
    camera: DepthCamera
    scene: Scene
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

    @field_validator("scene", mode="before")
    @classmethod
    def _scene_from_json(cls, scene: object) -> object:
        try:
            return parse_json(scene, DatasetError) if isinstance(scene, str) else scene
        except DatasetError as error:
            raise ValueError(error.message) from error

    def camera_pose(self) -> CameraPose:
        """Return the camera in the door frame."""
        position_m = self.x_m, self.y_m, self.camera_height_m
        return CameraPose.from_degrees(position_m, self.heading_deg, self.pitch_deg, self.roll_deg)

    def opening(self) -> Opening:
        """Return the angles or the share the door is open by."""
        return Opening(
            angle_deg=self.opening_angle_deg or 0.0,
            passive_angle_deg=self.passive_angle_deg or 0.0,
            share=self.opening_share or 0.0,
        )

    def boxes(self) -> list[Box]:
        """Return the boxes of the scene in the door frame."""
        return scene_boxes(self.scene, self.opening())

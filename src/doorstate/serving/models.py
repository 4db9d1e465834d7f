# SPDX-License-Identifier: Apache-2.0
"""Bodies of the service's responses."""

from __future__ import annotations

from pydantic import BaseModel, Field

from doorstate.types import STATES


class SensorPoseResponse(BaseModel):
    """Pose of a camera, and where its parts come from: assumed, given, the file's VIEWPOINT, or a depth image."""

    axes: str = Field(description="Directions of x, y and z in the frame of the camera, such as flu.")
    axes_from: str = Field(description="Where the axes come from.")
    roll_deg: float = Field(description="Clockwise rotation of the camera, seen from behind.")
    pitch_deg: float = Field(description="Angle by which the camera looks down.")
    tilt_from: str = Field(description="Where roll and pitch come from.")
    position_m: list[float] | None = Field(
        None, description="Position of the camera in the frame of the points, from VIEWPOINT."
    )
    camera_height_m: float | None = Field(
        None, description="Height of the camera above the floor, where it was given."
    )


class TiltResponse(BaseModel):
    """Tilt of a camera that was found in the cloud."""

    roll_deg: float = Field(description="Clockwise rotation of the camera, seen from behind.")
    pitch_deg: float = Field(description="Angle by which the camera looks down.")
    tilt_from: str = Field(description="What it was found from: floor, walls or doorways.")
    error_deg: float | None = Field(None, description="Standard error.")


class _Answer(BaseModel):
    """Answer about one door. Fields that a method does not estimate are absent."""

    state: str | None = Field(
        description="Predicted state; null with a reason if there is none.",
        json_schema_extra={"enum": [*STATES, None]},
    )
    probabilities: dict[str, float] | None = Field(
        None, description="Probability of each state; absent without a state, and for a rule."
    )
    raw_probabilities: dict[str, float] | None = Field(
        None, description="Probabilities of a network whose state is refused: no evidence for a state."
    )
    reason: str = Field("", description="Reason why there is no state.")
    door_probability: float | None = Field(None, description="Probability that there is a door.")
    opening_angle_deg: float | None = Field(None, description="Opening angle of the leaf.")
    hinge: str | None = Field(None, description="Side of the hinge, left or right, seen from the camera.")
    hinge_probability: float | None = Field(None, description="Probability of this side.")
    passable_width_m: float | None = Field(None, description="Free width between leaf and jamb.")
    leaf_seen: bool | None = Field(
        None, description="Of an open door; false if no leaf was seen, so that glass cannot be excluded."
    )


class DoorResponse(_Answer):
    """One door, in the level frame of the camera: x forward, y left."""

    x_m: float = Field(description="Middle of the opening, forward of the camera.")
    y_m: float = Field(description="Middle of the opening, to the left of the camera.")
    yaw_deg: float = Field(description="Direction of the wall to the left; 90 for a wall straight ahead.")
    width_m: float = Field(description="Width of the opening.")
    distance_m: float = Field(description="Distance to the middle of the opening, in plan view.")
    bearing_deg: float = Field(description="Direction to the middle of the opening, positive to the left.")
    position_error_m: float | None = Field(None, description="Standard error of the place.")
    yaw_error_deg: float | None = Field(None, description="Standard error of the direction.")
    angle_error_deg: float | None = Field(None, description="Standard error of the opening angle.")
    score: float | None = Field(None, description="Score of the place by the search for doorways.")


class PredictionResponse(_Answer):
    """Prediction for one file: the object that `doorstate predict --json` prints, without the file name.

    The fields of one door are those of the door most in front.
    """

    points: int = Field(description="Number of points that the prediction is based on.")
    milliseconds: float = Field(description="Time of the prediction, without reading the file.")
    door_x_m: float | None = Field(None, description="Middle of the opening, forward of the camera.")
    door_y_m: float | None = Field(None, description="Middle of the opening, to the left of the camera.")
    door_yaw_deg: float | None = Field(
        None, description="Direction of the wall to the left; 90 for a wall straight ahead."
    )
    opening_width_m: float | None = Field(None, description="Width of the door frame.")
    doors: list[DoorResponse] | None = Field(
        None, description="All doors, the one of the fields above first; absent without any."
    )
    tilt: TiltResponse | None = Field(
        None, description="Tilt of the camera, where it was found in the cloud."
    )
    sensor_pose: SensorPoseResponse = Field(description="Pose of the camera that was applied to the points.")


class HealthResponse(BaseModel):
    """State of the service."""

    ready: bool
    version: str
    network: str | None = Field(default=None, description="Name of the network.")
    points: int | None = Field(default=None, description="Number of points that the network gets.")
    rule: str | None = Field(default=None, description="Name of the rule, if no network predicts.")
    problem: str | None = Field(default=None, description="Reason why the service is not ready.")


class ErrorResponse(BaseModel):
    """Reason why a request failed."""

    error: str = Field(description="One line.")

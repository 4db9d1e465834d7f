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


class PredictionResponse(BaseModel):
    """Prediction for one file: the object that `doorstate predict --json` prints, without the file name."""

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
    points: int = Field(description="Number of points that the prediction is based on.")
    milliseconds: float = Field(description="Time of the prediction, without reading the file.")
    reason: str = Field("", description="Reason why there is no state.")
    opening_angle_deg: float | None = Field(
        None, description="Opening angle of the leaf. This and the following fields depend on the method."
    )
    door_probability: float | None = Field(None, description="Probability that there is a door.")
    hinge: str | None = Field(None, description="Side of the hinge, left or right, seen from the camera.")
    hinge_probability: float | None = Field(None, description="Probability of this side.")
    door_x_m: float | None = Field(None, description="Middle of the opening, forward of the camera.")
    door_y_m: float | None = Field(None, description="Middle of the opening, to the left of the camera.")
    door_yaw_deg: float | None = Field(
        None, description="Direction of the wall to the left; 90 for a wall straight ahead."
    )
    opening_width_m: float | None = Field(None, description="Width of the door frame.")
    passable_width_m: float | None = Field(None, description="Free width between leaf and jamb.")
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

# SPDX-License-Identifier: Apache-2.0
"""Query parameters of a prediction request."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from doorstate.inference.known import DoorKnown, door_known
from doorstate.io.camera import pinhole_from_numbers
from doorstate.io.formats import CLOUD_SUFFIXES, format_suffix
from doorstate.io.options import ReadOptions, metres_per_unit, unit_name
from doorstate.io.rotations import parse_quaternion
from doorstate.serving.body import unknown_format
from doorstate.types import UNITS_M

_FORMATS = [suffix.lstrip(".") for suffix in CLOUD_SUFFIXES]
# Parameters that are not spelled like the parameter of the library function they are passed to.
_NAMES = {
    "roll_deg": "roll",
    "pitch_deg": "pitch",
    "camera_height_m": "camera_height",
    "depth_scale_m": "depth_scale",
    "units_m": "units",
    "intrinsics": "fx, fy, cx and cy",
}


class PredictQuery(BaseModel):
    """Query parameters, as the options of `doorstate predict`."""

    model_config = ConfigDict(extra="forbid")

    format: str | None = Field(
        None,
        description="Format of the file. If it is missing, `filename`, the file name in a form, the Content-Type or the"
        " first bytes of the file give it.",
        json_schema_extra={"enum": [*_FORMATS]},
    )
    filename: str | None = Field(None, description="File name; its suffix gives the format.")
    axes: str = Field(
        "auto",
        description="Directions of x, y and z in clouds: ros (flu), optical (rdf), opengl (rub), or three letters among"
        " f b l r u d; auto is ros.",
    )
    roll: float | None = Field(
        None, description="Clockwise rotation of the camera, seen from behind, in degrees."
    )
    pitch: float | None = Field(
        None,
        description="Angle by which the camera looks down, in degrees. Without roll and pitch the camera is taken for"
        " level; weights for doorways find the tilt themselves.",
    )
    quaternion: str | None = Field(
        None,
        description="In place of roll and pitch: x,y,z,w of the rotation from the points' frame to a level frame.",
    )
    camera_height: float | None = Field(
        None, description="Height of the camera above the floor in metres, if it is known."
    )
    ignore_viewpoint: bool = Field(False, description="Ignore VIEWPOINT of PCD files.")
    units: str = Field(
        "m",
        description="Length unit of clouds and of floating point depth images.",
        json_schema_extra={"enum": list(UNITS_M)},
    )
    depth_scale: float = Field(0.001, description="Metres per unit of integer depth images.")
    door_known: bool = Field(
        False, description="A door is known to be in view, so that no door is no answer."
    )
    door_pose: str | None = Field(
        None,
        description="Rough place of that door for weights of doorways: x,y, x,y,yaw or x,y,yaw,width of its opening in"
        " metres and degrees, as in the response.",
    )
    door_box: str | None = Field(
        None, description="In place of door_pose: left,top,right,bottom of a box around the door, in pixels."
    )
    fx: float | None = Field(None, description="Horizontal focal length of depth images in pixels.")
    fy: float | None = Field(None, description="Vertical focal length in pixels.")
    cx: float | None = Field(None, description="Horizontal image centre in pixels.")
    cy: float | None = Field(None, description="Vertical image centre in pixels.")

    def read_options(self) -> ReadOptions:
        """Return how the file is read.

        Raises:
            ConfigError: a parameter has no such value.
            CameraError: the camera is impossible.
        """
        camera = pinhole_from_numbers(self.fx, self.fy, self.cx, self.cy)
        return ReadOptions(
            axes=self.axes,
            roll_deg=self.roll,
            pitch_deg=self.pitch,
            quaternion=None if self.quaternion is None else parse_quaternion(self.quaternion),
            camera_height_m=self.camera_height,
            ignore_viewpoint=self.ignore_viewpoint,
            intrinsics=camera,
            depth_scale_m=self.depth_scale,
            units_m=metres_per_unit(self.units),
        )

    def known_door(self) -> DoorKnown:
        """Return True, or the rough place, where a door is known to be in view.

        Raises:
            ConfigError: no place of a door.
        """
        return door_known(self.door_known, self.door_pose, self.door_box)

    def suffix(self) -> str | None:
        """Return the suffix of the file from `format`, or else from `filename`; None leaves it to the body.

        Raises:
            HTTPException: 415, not a format that can be read.
        """
        if self.format is not None:
            suffix = f".{self.format.lower().lstrip('.')}"
        else:
            suffix = format_suffix(self.filename or "")
        if suffix and suffix not in CLOUD_SUFFIXES:
            raise unknown_format(suffix)
        return suffix or None


def format_parameter(name: str, value: object = None) -> str:
    """Return a library parameter as a query parameter, such as `units=mm`; without a value only its name."""
    if name == "units_m" and isinstance(value, float):
        value = unit_name(value)
    name = _NAMES.get(name, name)
    if value is True:
        value = "true"
    return name if value is None else f"{name}={value}"

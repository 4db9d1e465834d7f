# SPDX-License-Identifier: Apache-2.0
"""Settings of a watch over a door, in values that ROS parameters can have: no value is None."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeVar

from pydantic import ConfigDict, Field, ValidationError

from doorstate._models import FrozenModel
from doorstate.errors import CameraError, ConfigError, unknown_name
from doorstate.inference.gate import DEFAULT_GATE
from doorstate.inference.known import DoorKnown, door_known
from doorstate.inference.predictor import DEFAULT_NETWORK, Predictor
from doorstate.io.messages import CLOUD, COMPRESSED_IMAGE, IMAGE
from doorstate.io.options import ReadOptions
from doorstate.io.rotations import parse_quaternion
from doorstate.types import UNITS_M

MESSAGE_TYPES = {"cloud": CLOUD, "depth": IMAGE, "compressed_depth": COMPRESSED_IMAGE}  # by input


class WatchSettings(FrozenModel):
    """Parameters of the node; `ros2 param describe` shows their descriptions."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    input: Literal["cloud", "depth", "compressed_depth"] = Field(
        "cloud", description="Messages to read: PointCloud2, Image or CompressedImage."
    )
    network: str = Field(DEFAULT_NETWORK, description="Name of packaged weights.")
    weights: str = Field("", description="Weights file, .safetensors or .onnx, in place of packaged weights.")
    rule: str = Field("", description="Rule in place of a network, such as plane_state.")
    points: int = Field(0, ge=0, description="Points that the network evaluates; 0: as trained.")
    budget_ms: float = Field(
        0.0, ge=0, description="In place of points: as many as this time allows; 0: no budget."
    )
    threads: int = Field(
        0, ge=0, description="Processor threads of one call to a network; 0: one a processor, at most 4."
    )
    door_known: bool = Field(
        False, description="A door is known to be in view, so that no door is no answer."
    )
    door_pose: str = Field(
        "",
        description="Rough place of that door for weights of doorways and a camera that stands still: x y, x y yaw or"
        " x y yaw width of its opening, in metres forward and left of the camera and degrees; empty: none.",
    )
    door_box: str = Field(
        "", description="In place of door_pose: left top right bottom of a box around the door, in pixels."
    )
    require_leaf: bool = Field(
        True, description="Report an open door without a visible leaf, which may be glass, as not free."
    )
    gate: bool = Field(True, description="Report clouds in which too much is missing as unknown.")
    axes: str = Field(
        "auto",
        description="Axes of clouds: ros, optical, opengl, or three letters such as flu; auto: optical if the name of"
        " their frame contains it, else ros.",
    )
    roll: float = Field(0.0, description="Clockwise rotation of the camera, seen from behind, in degrees.")
    pitch: float = Field(0.0, description="Angle by which the camera looks down, in degrees.")
    quaternion: str = Field(
        "",
        description="In place of roll and pitch: x, y, z, w of the rotation from the frame of the messages to a level"
        " frame, as tf2_echo prints; empty: none.",
    )
    tilt: Literal["auto", "given"] = Field(
        "auto",
        description="Tilt of the camera; auto: as roll, pitch or quaternion say if one of them is set, else weights for"
        " doorways find it themselves; given: as they say, zero too.",
    )
    camera_height: float = Field(
        0.0, ge=0, description="Height of the camera above the floor in metres; 0: not known."
    )
    rectified: Literal["auto", "yes", "no"] = Field(
        "auto", description="Images are rectified; auto: as the name of their topic tells, rect or raw."
    )
    units: Literal["m", "mm"] = Field("m", description="Unit of clouds and of floating point depth.")
    depth_scale: float = Field(0.001, gt=0, description="Metres per unit of integer depth.")
    reliable: bool = Field(
        False, description="Request lost messages again; the publisher must be reliable too."
    )
    max_hz: float = Field(10.0, ge=0, description="Largest rate of reports; 0: no limit.")
    hold_s: float = Field(1.0, ge=0, description="Time for which open must have held before the way is free.")
    silence_s: float = Field(1.0, gt=0, description="Time without a state after which the door is unknown.")

    def read_options(self) -> ReadOptions:
        """Return the options of messages, without a camera.

        Raises:
            CameraError: an impossible value.
        """
        is_set = bool(self.roll or self.pitch) or (self.tilt == "given" and not self.quaternion)
        return ReadOptions(
            axes=self.axes,
            roll_deg=self.roll if is_set else None,
            pitch_deg=self.pitch if is_set else None,
            quaternion=parse_quaternion(self.quaternion) if self.quaternion else None,
            camera_height_m=self.camera_height or None,
            rectified={"auto": None, "yes": True, "no": False}[self.rectified],
            depth_scale_m=self.depth_scale,
            units_m=UNITS_M[self.units],
        )

    def known_door(self) -> DoorKnown:
        """Return True, or the rough place, where a door is known to be in view.

        Raises:
            ConfigError: no place of a door.
        """
        return door_known(self.door_known, self.door_pose or None, self.door_box or None)

    def load_predictor(self) -> Predictor:
        """Load and warm up the network or rule that is named.

        Raises:
            DoorstateError: as in `Predictor.load`.
        """
        predictor = Predictor.load(
            None if self.rule and not self.weights else self.weights or self.network,
            rule=self.rule or None,
            num_points=self.points or None,
            budget_ms=self.budget_ms or None,
            gate=DEFAULT_GATE if self.gate else None,
            threads=self.threads or None,
        )
        predictor.warm_up()
        return predictor


Settings = TypeVar("Settings", bound=WatchSettings)


def parse_settings(parameters: Mapping[str, Any]) -> WatchSettings:
    """Return the settings with these parameters, the others by default.

    Raises:
        ConfigError: a parameter does not exist, or cannot have this value.
    """
    return parse_settings_as(WatchSettings, parameters)


def parse_settings_as(kind: type[Settings], parameters: Mapping[str, Any]) -> Settings:
    """Return settings with more parameters than those of a watch; errors are those of `parse_settings`."""
    try:
        settings = kind(**parameters)
        settings.read_options()
        settings.known_door()
    except ValidationError as error:
        problem = error.errors()[0]
        name = str(problem["loc"][0])
        if problem["type"] == "extra_forbidden":
            raise unknown_name("parameter", name, list(kind.model_fields)) from error
        raise ConfigError(f"{problem['input']!r}: {problem['msg'].lower()}", field=name) from error
    except CameraError as error:
        name = (error.field or "").removesuffix("_deg").removesuffix("_m")
        raise ConfigError(error.message, field=name, expected=error.expected) from error
    return settings

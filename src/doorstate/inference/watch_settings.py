# SPDX-License-Identifier: Apache-2.0
"""What a node that watches a door may be told, in values that ROS parameters can have: none of them is None."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError

from doorstate._models import FrozenModel
from doorstate.errors import ConfigError
from doorstate.inference.gate import DEFAULT_GATE
from doorstate.inference.predictor import DEFAULT_NETWORK, Predictor
from doorstate.io.messages import CLOUD, COMPRESSED_IMAGE, IMAGE
from doorstate.io.options import ReadOptions
from doorstate.types import UNITS_M

MESSAGE_TYPES = {"cloud": CLOUD, "depth": IMAGE, "compressed_depth": COMPRESSED_IMAGE}  # by input


class WatchSettings(FrozenModel):
    """Parameters of the node; the text of each is what `ros2 param describe` shows."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    input: Literal["cloud", "depth", "compressed_depth"] = Field(
        "cloud", description="What is read: PointCloud2, Image or CompressedImage."
    )
    network: str = Field(DEFAULT_NETWORK, description="Network whose packaged weights answer.")
    weights: str = Field(
        "", description="A weights file, .safetensors or .onnx, in place of the packaged ones."
    )
    rule: str = Field("", description="A rule that answers in place of a network, such as plane_state.")
    points: int = Field(0, ge=0, description="Points to look at; 0: as trained.")
    budget_ms: float = Field(
        0.0, ge=0, description="In place of points: as many as take no longer; 0: no budget."
    )
    gate: bool = Field(True, description="Whether clouds in which too much is missing are unknown.")
    frame: Literal["auto", "body", "optical"] = Field(
        "auto", description="Axes of clouds; auto: optical if the name of their frame says so, else body."
    )
    roll: Literal[0, 90, 180, 270] = Field(
        0, description="How far the camera was turned clockwise, seen from behind, in degrees."
    )
    units: Literal["m", "mm"] = Field("m", description="Unit of clouds and of floating point depth.")
    depth_scale: float = Field(0.001, gt=0, description="Metres per unit of integer depth.")
    reliable: bool = Field(
        False, description="Whether lost messages are asked for again; the publisher must be reliable too."
    )
    max_hz: float = Field(10.0, ge=0, description="Most answers a second; 0: as many as can be.")
    hold_s: float = Field(1.0, ge=0, description="How long open must have held before the way is free.")
    silence_s: float = Field(
        1.0, gt=0, description="After so long without a cloud that tells a state all is unknown."
    )

    def read_options(self, optical: bool) -> ReadOptions:
        """How messages are read whose frame is, by its name, an optical one or not."""
        named: Literal["body", "optical"] = "optical" if optical else "body"
        frame = named if self.frame == "auto" else self.frame
        return ReadOptions(frame, self.roll, None, self.depth_scale, UNITS_M[self.units])

    def load_predictor(self) -> Predictor:
        """Load and warm up the network or rule that is named.

        Raises:
            DoorstateError: as of `Predictor.load`.
        """
        predictor = Predictor.load(
            None if self.rule and not self.weights else self.weights or self.network,
            rule=self.rule or None,
            num_points=self.points or None,
            budget_ms=self.budget_ms or None,
            gate=DEFAULT_GATE if self.gate else None,
        )
        predictor.warm_up()
        return predictor


def parse_settings(given: Mapping[str, Any]) -> WatchSettings:
    """Parameters as they were given, the others by default.

    Raises:
        ConfigError: one of them does not exist, or cannot have this value.
    """
    try:
        return WatchSettings(**given)
    except ValidationError as error:
        first = error.errors()[0]
        name = first["loc"][0]
        if first["type"] == "extra_forbidden":
            known = ", ".join(WatchSettings.model_fields)
            raise ConfigError(f"no parameter {name}: there are {known}") from error
        raise ConfigError(f"parameter {name} = {first['input']!r}: {first['msg'].lower()}") from error

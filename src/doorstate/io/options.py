# SPDX-License-Identifier: Apache-2.0
"""Reading options: what files and messages leave open, and their user has to state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from doorstate.errors import CameraError, unknown_name
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import check_roll
from doorstate.types import UNITS_M


@dataclass(frozen=True)
class ReadOptions:
    """Frame, units and camera of a file or message.

    Args:
        frame: frame of clouds, `body` (x forward, y left, z up) or `optical` (x right, y down, z forward); depth
            images are always optical.
        roll_deg: clockwise rotation of the camera, seen from behind: 0, 90, 180 or 270.
        intrinsics: camera of depth images; a `Pinhole` fits every image size.
        depth_scale_m: metres per unit of integer depth images.
        units_m: metres per unit of clouds and of floating point depth images (metres by ROS REP 118).

    Raises:
        CameraError: an impossible value.
    """

    frame: Literal["body", "optical"] = "body"
    roll_deg: int = 0
    intrinsics: Intrinsics | Pinhole | None = None
    depth_scale_m: float = 0.001
    units_m: float = 1.0

    def __post_init__(self) -> None:
        if self.frame not in ("body", "optical"):
            raise CameraError(f"no frame {self.frame!r}", field="frame", expected="body or optical")
        for field in ("depth_scale_m", "units_m"):
            scale_m = getattr(self, field)
            if not (math.isfinite(scale_m) and scale_m > 0):
                raise CameraError(
                    f"{scale_m} metres per unit is impossible", field=field, expected="a positive number"
                )
        check_roll(self.roll_deg)
        if isinstance(self.intrinsics, Pinhole):
            Intrinsics(1, 1, *self.intrinsics)  # checks the four numbers
        elif not isinstance(self.intrinsics, Intrinsics | None):
            raise CameraError(
                f"{self.intrinsics!r} is not a camera", field="intrinsics", expected="Intrinsics or Pinhole"
            )


DEFAULT_OPTIONS = ReadOptions()


def unit_name(units_m: float) -> str:
    """Return the name of a unit of `UNITS_M`, or the number itself for any other unit."""
    return next((name for name, metres in UNITS_M.items() if metres == units_m), f"{units_m:g}")


def metres_per_unit(name: str) -> float:
    """Return the size of a unit of `UNITS_M`.

    Raises:
        ConfigError: no such unit.
    """
    if name not in UNITS_M:
        raise unknown_name("unit", name, UNITS_M, field="units")
    return UNITS_M[name]

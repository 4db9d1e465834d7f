# SPDX-License-Identifier: Apache-2.0
"""What weights say of themselves, in every kind of file; apart from `weights`, which needs torch."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from doorstate import __version__
from doorstate._models import FrozenModel
from doorstate.clouds.normalization import SCALE_M
from doorstate.clouds.preparation import CloudSpec
from doorstate.types import STATES


class WeightsCard(FrozenModel):
    """What a weights file says of itself."""

    network: str
    network_options: dict[str, Any] = Field(default_factory=dict)
    num_points: int  # trained with
    default_points: int | None = Field(default=None, gt=0)  # fewer, that lose nothing
    heads: tuple[str, ...] = ()  # answers besides the state
    scale_m: float = SCALE_M
    states: tuple[str, ...] = STATES
    max_depth_m: float | None = Field(default=None, gt=0)  # how far the camera of the training clouds saw
    temperature: float = Field(default=1.0, gt=0)  # logits are divided by it (training.calibration)
    abstain_below: float = Field(default=0.0, ge=0, lt=1)  # no state from a probability below this
    trained_on: str = ""
    doorstate_version: str = __version__

    @property
    def points(self) -> int:
        """How many points to look at unless told otherwise."""
        return self.default_points or self.num_points

    @property
    def spec(self) -> CloudSpec:
        """Preparation of the clouds that these weights take by default."""
        return CloudSpec(num_points=self.points, max_depth_m=self.max_depth_m)

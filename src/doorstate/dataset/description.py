# SPDX-License-Identifier: Apache-2.0
"""Description of a prepared data set: `dataset.json`, which marks its folder as complete."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from doorstate._files import write_text
from doorstate._models import FrozenModel
from doorstate.clouds.normalization import Input
from doorstate.clouds.preparation import MAX_NUM_POINTS, CloudSpec
from doorstate.dataset.crops import Crops

DESCRIPTION_FILE = "dataset.json"
_MAX_SAMPLES = 100_000_000


class DatasetDescription(FrozenModel):
    """Contents of a prepared folder, as in `dataset.json`."""

    kind: Literal["simulated", "imported"]
    source: str
    num_points: int = Field(ge=1, le=MAX_NUM_POINTS)
    samples: int = Field(ge=0, le=_MAX_SAMPLES)
    doorstate_version: str
    clouds: Literal["stored", "replayed"] = "stored"  # replayed: rendered from the manifest
    max_depth_m: float | None = Field(default=None, gt=0)  # points farther ahead were left out
    thin: bool = False  # sampled from some rows and columns of each image, as a predictor does
    remove_outliers: bool = False  # not in data sets of version 0.1
    crops: Crops | None = None  # of doorways, in the frame of each; None for whole clouds in the sensor frame
    # Clouds that could not be prepared (rejected.csv), by state.
    left_out: dict[str, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)

    @property
    def input(self) -> Input:
        """Clouds that a network gets."""
        return "whole" if self.crops is None else "doorway"

    @property
    def spec(self) -> CloudSpec:
        """Settings the clouds were prepared with."""
        return CloudSpec(
            num_points=self.num_points,
            thin=self.thin,
            max_depth_m=self.max_depth_m,
            remove_outliers=self.remove_outliers,
        )

    def save(self, folder: Path) -> None:
        """Write `dataset.json`, which marks the folder as complete."""
        write_text(folder / DESCRIPTION_FILE, self.model_dump_json(indent=2) + "\n")

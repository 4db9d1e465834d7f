# SPDX-License-Identifier: Apache-2.0
"""Options of prepared clouds, which `prepare` and `simulate` share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.choices import INPUT, KEPT_CROPS
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.clouds.preparation import CloudSpec
    from doorstate.dataset.crops import Crops

PreparedPoints = Annotated[
    int | None,
    typer.Option(
        "--points", help="Points of each prepared cloud. [default: 4096, of doorways 1024]", min=128
    ),
]
MaxDepth = Annotated[
    float | None,
    typer.Option("--max-depth-m", help="Drop points farther ahead than this, in metres.", min=0.5),
]
Thin = Annotated[
    bool,
    typer.Option(
        "--thin", help="Sample from every second, third, ... row and column of an image, as predict does."
    ),
]
KeepOutliers = Annotated[
    bool,
    typer.Option(
        "--keep-outliers", help="Keep pixels and small blobs that float before or behind every surface."
    ),
]
InputName = Annotated[
    str,
    typer.Option(
        "--input",
        parser=INPUT,
        metavar="NAME",
        help="Clouds that networks get: {inputs}. A doorway is cropped from the view, in its own frame.",
    ),
]
KeptCrops = Annotated[
    str,
    typer.Option(
        "--crops",
        parser=KEPT_CROPS,
        metavar="NAME",
        help="Doorways: {kept_crops}. The best one of each cloud gets the label of the cloud, for one answer a cloud.",
    ),
]
AddMissed = Annotated[
    bool,
    typer.Option("--add-missed", help="Doorways: add the visible doors that were not found, for training."),
]


def prepared_clouds(
    points: int | None,
    max_depth: float | None,
    thin: bool,
    keep_outliers: bool,
    input_name: str,
    crops: str,
    add_missed: bool,
) -> tuple[CloudSpec, Crops | None]:
    """Return the preparation of clouds, and the crops of doorways; None for whole clouds.

    Raises:
        ConfigError: options of the other input.
    """
    from doorstate.clouds.preparation import NUM_POINTS, CloudSpec
    from doorstate.dataset.crops import Crops
    from doorstate.doorways.crop import CROP_POINTS

    if input_name == "whole":
        if crops != "all" or add_missed:
            raise ConfigError("--crops and --add-missed need --input doorway")
        spec = CloudSpec(
            num_points=points or NUM_POINTS,
            thin=thin,
            max_depth_m=max_depth,
            remove_outliers=not keep_outliers,
        )
        return spec, None
    if thin or max_depth is not None:
        raise ConfigError("--thin and --max-depth-m are for whole clouds: doorways have limits of their own")
    spec = CloudSpec(num_points=points or CROP_POINTS, thin=True, remove_outliers=not keep_outliers)
    return spec, Crops.model_validate({"kept": crops, "add_missed": add_missed})

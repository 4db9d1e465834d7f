# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from doorstate.errors import ConfigError

LayoutName = Annotated[
    str | None,
    typer.Option("--layout", help="Folder layout of a published data set: deepdoors2 (or DeepDoors)."),
]

# The network or rule that predicts.
Network = Annotated[
    str | None,
    typer.Option(help="Name of packaged weights (doorstate info lists them). [default: pointnet2]"),
]
Weights = Annotated[
    Path | None, typer.Option(help="Weights file (.safetensors or .onnx), instead of --network.")
]
RuleName = Annotated[
    str | None, typer.Option(help="Name of a rule (doorstate info lists them), instead of a network.")
]
PointCount = Annotated[
    int | None, typer.Option(help="Points that the network gets. [default: as trained]", min=128)
]
BudgetMs = Annotated[
    float | None,
    typer.Option(
        help="Instead of --points: as many points as this machine processes in this time, measured at the start.",
        min=1,
    ),
]

# Recordings.
Bag = Annotated[
    Path | None,
    typer.Option(help="ROS recording instead of files: .bag, .db3, .mcap or a ROS 2 bag folder."),
]
Topic = Annotated[
    str | None, typer.Option(help="PointCloud2 or depth image topic, if the bag has several of them.")
]
CameraInfoTopic = Annotated[
    str | None,
    typer.Option(help="CameraInfo topic of a depth image topic. [default: camera_info in its namespace]"),
]

# Data sets and training.
PreparedPoints = Annotated[int, typer.Option(help="Points of each prepared cloud.", min=128)]
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
ShardOption = Annotated[
    str | None,
    typer.Option(help="Process only this part of the work, such as 2/8; without it, all parts are joined."),
]
Workers = Annotated[int | None, typer.Option(help="Worker processes. [default: one a processor]", min=1)]
Jobs = Annotated[int, typer.Option(help="Number of runs at the same time.", min=1)]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help="Change a field of the recipe, such as --set batch_size=32; repeatable."),
]
Heads = Annotated[
    str | None,
    typer.Option(
        help="Heads besides the state, separated by commas: door, angle, hinge, frame, widths, parts."
    ),
]


def check_source(files: list[Path] | None, bag: Path | None) -> None:
    """Check that either files or a bag were given.

    Raises:
        ConfigError: none or both were given.
    """
    if bool(files) == (bag is not None):
        raise ConfigError("give either files or --bag")


def split_names(text: str | None) -> tuple[str, ...] | None:
    """Return names that are separated by commas."""
    return None if text is None else tuple(name.strip() for name in text.split(",") if name.strip())


def recipe_changes(settings: list[str] | None, epochs: int | None) -> dict[str, Any]:
    """Return fields of the recipe from FIELD=VALUE, with values as in TOML; a bare word is a string.

    Raises:
        ConfigError: a setting has another form.
    """
    changes: dict[str, Any] = {} if epochs is None else {"epochs": epochs}
    for setting in settings or []:
        name, equals, value = setting.partition("=")
        if not equals:
            raise ConfigError(f"--set {setting}: expected FIELD=VALUE")
        try:
            changes[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            changes[name.strip()] = value.strip()
    return changes

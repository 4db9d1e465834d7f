# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share, and what they mean to the library."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.errors import CameraError, ConfigError

if TYPE_CHECKING:
    from doorstate.io.readers import ReadOptions

# What a cloud file does not say about itself: the same options for `predict` and `prepare`.
Frame = Annotated[
    str,
    typer.Option(help="Frame of cloud files: body (x forward, y left, z up) or optical (z forward, y down)."),
]
Roll = Annotated[
    int, typer.Option(help="How far the camera was turned clockwise, seen from behind: 0, 90, 180, 270.")
]
Units = Annotated[str, typer.Option(help="Unit of cloud files: m, dm, cm, mm or km.")]
DepthScale = Annotated[float, typer.Option(help="Metres per unit of depth images.")]
IntrinsicsFile = Annotated[
    Path | None, typer.Option("--intrinsics", help="Camera of depth images: JSON or ROS camera_info YAML.")
]
Focal = Annotated[
    float | None, typer.Option(help="Focal length or centre in pixels, in place of --intrinsics.")
]
LayoutName = Annotated[
    str | None,
    typer.Option(
        "--layout", help="A published data set as it is laid out: deepdoors2 (also its predecessor)."
    ),
]
# Who answers, and recordings to answer: the same options for `predict`, `view` and `serve`.
Network = Annotated[
    str | None, typer.Option(help="Network whose packaged weights to use; pointnet2 if not given.")
]
Weights = Annotated[Path | None, typer.Option(help="A weights file of your own, in place of --network.")]
RuleName = Annotated[
    str | None, typer.Option(help="Answer by this rule instead of a network: doorstate info lists them.")
]
PointCount = Annotated[
    int | None, typer.Option(help="Points to look at; as the weights ask for if not given.", min=128)
]
BudgetMs = Annotated[
    float | None,
    typer.Option(
        help="In place of --points: as many as this machine answers in so many milliseconds, measured now.",
        min=1,
    ),
]
Bag = Annotated[
    Path | None, typer.Option(help="A ROS recording in place of files: .bag, .db3, .mcap, or ROS 2 folder.")
]
Topic = Annotated[
    str | None, typer.Option(help="PointCloud2 or depth image topic of the bag, if there are several.")
]
CameraInfoTopic = Annotated[
    str | None, typer.Option(help="Camera of a depth image topic, if not camera_info beside it.")
]
Workers = Annotated[int | None, typer.Option(help="Processes; all processors if not given.", min=1)]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help="A field of the recipe, such as --set batch_size=32; repeatable."),
]


def files_or_bag(files: list[Path] | None, bag: Path | None) -> None:
    """Raise ConfigError unless there are files or a recording, and not both."""
    if bool(files) == (bag is not None):
        raise ConfigError("give files, or a recording by --bag: one of the two")


def read_options(
    frame: str,
    roll: int,
    units: str,
    depth_scale: float,
    intrinsics_file: Path | None,
    flags: tuple[float | None, float | None, float | None, float | None],
    layout: str | None = None,
) -> ReadOptions:
    """What the options say of cloud files; one error line for what does not fit together."""
    from doorstate.io.camera import read_intrinsics
    from doorstate.io.readers import options_from_flags

    if layout is not None and (frame, roll, units, depth_scale) != ("body", 0, "m", 0.001):
        raise ConfigError(
            "--layout says how its files are read: leave --frame, --roll, --units and --depth-scale out"
        )
    intrinsics = None if intrinsics_file is None else read_intrinsics(intrinsics_file)
    try:
        return options_from_flags(frame, roll, units, depth_scale, intrinsics, flags)
    except CameraError as error:  # of what was typed, and of no file
        raise ConfigError(str(error)) from error


Heads = Annotated[
    str | None,
    typer.Option(
        help="Answers besides the state, separated by commas: door, angle, hinge, frame, widths, parts."
    ),
]


def recipe_changes(settings: list[str] | None, epochs: int | None) -> dict[str, Any]:
    """Fields of the recipe given as FIELD=VALUE, values as in TOML; a bare word is a string."""
    changes: dict[str, Any] = {} if epochs is None else {"epochs": epochs}
    for setting in settings or []:
        name, equals, value = setting.partition("=")
        if not equals:
            raise ConfigError(f"--set {setting}: write it as FIELD=VALUE")
        try:
            changes[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            changes[name.strip()] = value.strip()
    return changes

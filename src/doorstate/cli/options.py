# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.errors import CameraError, ConfigError

if TYPE_CHECKING:
    from doorstate.io.options import ReadOptions

# How cloud files and depth images are read.
Frame = Annotated[
    str,
    typer.Option(help="Axes of cloud files: body (x forward, y left, z up) or optical (z forward, y down)."),
]
Roll = Annotated[
    int, typer.Option(help="Clockwise rotation of the camera, seen from behind: 0, 90, 180 or 270 degrees.")
]
Units = Annotated[str, typer.Option(help="Length unit of cloud files: m, dm, cm, mm or km.")]
DepthScale = Annotated[float, typer.Option(help="Metres per unit of depth images.")]
IntrinsicsFile = Annotated[
    Path | None,
    typer.Option("--intrinsics", help="Camera of depth images: a JSON file, or a ROS camera_info YAML file."),
]
Fx = Annotated[float | None, typer.Option(help="Horizontal focal length in pixels, instead of --intrinsics.")]
Fy = Annotated[float | None, typer.Option(help="Vertical focal length in pixels.")]
Cx = Annotated[float | None, typer.Option(help="Horizontal image centre in pixels.")]
Cy = Annotated[float | None, typer.Option(help="Vertical image centre in pixels.")]
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


def read_options(
    frame: str,
    roll: int,
    units: str,
    depth_scale: float,
    intrinsics_file: Path | None,
    flags: tuple[float | None, float | None, float | None, float | None],
    layout: str | None = None,
) -> ReadOptions:
    """Return the reading options that a user typed.

    Args:
        flags: --fx, --fy, --cx and --cy in pixels.

    Raises:
        ConfigError: an option has no such value, or options exclude each other.
    """
    from doorstate.io.camera import pinhole_from_numbers, read_intrinsics
    from doorstate.io.options import ReadOptions, metres_per_unit

    if layout is not None and (frame, roll, units, depth_scale) != ("body", 0, "m", 0.001):
        raise ConfigError("--frame, --roll, --units and --depth-scale cannot be combined with --layout")
    intrinsics = None if intrinsics_file is None else read_intrinsics(intrinsics_file)
    try:
        pinhole = pinhole_from_numbers(*flags)
        if intrinsics is not None and pinhole is not None:
            raise ConfigError("give either --intrinsics or --fx --fy --cx --cy")
        camera = intrinsics or pinhole
        return ReadOptions(frame, roll, camera, depth_scale, metres_per_unit(units))  # type: ignore[arg-type]
    except CameraError as error:  # typed values are usage errors, unlike those of a camera file
        raise ConfigError(error.message, field=error.field, expected=error.expected) from error


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

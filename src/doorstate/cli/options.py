# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share: one name means the same everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from doorstate._devices import check_device_name
from doorstate._documents import parse_toml
from doorstate.cli.choices import HEAD, LAYOUT, NETWORK, PACKAGED, PROTOCOL, RECIPE, RULE
from doorstate.errors import ConfigError

# Networks and rules that predict.
NetworkNames = Annotated[
    list[str] | None,
    typer.Option(
        "--network",
        parser=PACKAGED,
        metavar="NAME",
        help="Packaged weights: {packaged}; repeatable if several make sense. [default: pointnet2]",
    ),
]
WeightsFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--weights", metavar="FILE", help="Weights file (.safetensors or .onnx), in place of --network."
    ),
]
RuleNames = Annotated[
    list[str] | None,
    typer.Option(
        "--rule",
        parser=RULE,
        metavar="NAME",
        help="Rule in place of a network: {rules}; repeatable.",
    ),
]
PointCount = Annotated[
    int | None,
    typer.Option("--points", help="Points that the network gets. [default: as trained]", min=128),
]
BudgetMs = Annotated[
    float | None,
    typer.Option(
        help="Instead of --points: as many points as this machine processes in this time, measured at the start.",
        min=1,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, one object a line, in place of a table.")]
Threads = Annotated[
    int | None,
    typer.Option(
        help="Processor threads of one call to a network. [default: one a processor, at most 4; in serve, shared]",
        min=1,
    ),
]

Device = Annotated[
    str,
    typer.Option(
        parser=check_device_name,
        metavar="DEVICE",
        help="Device of the networks: auto, cpu, cuda or cuda:N; auto is a CUDA device if torch finds one.",
    ),
]

Every = Annotated[int, typer.Option("--every", help="Use only every Nth file or message.", min=1)]

OpenBrowser = Annotated[
    bool, typer.Option("--open/--no-open", help="Open the page in the browser, or only print its address.")
]

# Doors that are known to be in view.
DoorKnownFlag = Annotated[
    bool, typer.Option("--door-known", help="A door is known to be in view: no door is no answer.")
]
DoorPose = Annotated[
    str | None,
    typer.Option(
        metavar="PLACE",
        help="Rough place of that door, as from a map: 'x y', 'x y yaw' or 'x y yaw width' of its opening, in metres"
        " forward and left of the camera and degrees. For weights of doorways.",
    ),
]
DoorBox = Annotated[
    str | None,
    typer.Option(
        metavar="BOX",
        help="In place of --door-pose: 'left top right bottom' of a box around the door, in pixels.",
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
LayoutName = Annotated[
    str | None,
    typer.Option(
        "--layout", parser=LAYOUT, metavar="NAME", help="Folder layout of a published data set: {layouts}."
    ),
]

# Data sets.
ShardOption = Annotated[
    str | None,
    typer.Option(help="Process only this part of the work, such as 2/8; without it, all parts are joined."),
]

# Training.
TrainedNetwork = Annotated[
    str, typer.Option("--network", parser=NETWORK, metavar="NAME", help="Network to train: {networks}.")
]
ComparedNetworks = Annotated[
    list[str] | None,
    typer.Option(
        "--network",
        parser=NETWORK,
        metavar="NAME",
        help="Network to train: {networks}; repeatable. [default: the five of the paper]",
    ),
]
TrainingPoints = Annotated[
    int | None, typer.Option("--points", help="Points of each cloud. [default: all of the data]", min=128)
]
Protocol = Annotated[
    str | None,
    typer.Option(
        "--protocol", parser=PROTOCOL, metavar="NAME", help="Split protocol: {protocols}. [default: paper]"
    ),
]
RecipeName = Annotated[
    str | None,
    typer.Option(
        "--recipe", parser=RECIPE, metavar="NAME", help="Training recipe: {recipes}. [default: common]"
    ),
]
Seed = Annotated[
    int | None, typer.Option("--seed", help="Seed of the split and of training. [default: 0]", min=0)
]
Epochs = Annotated[int | None, typer.Option("--epochs", help="Epochs. [default: as in the recipe]", min=1)]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Change a field of the recipe, such as --set batch_size=32; repeatable.",
    ),
]
HeadNames = Annotated[
    list[str] | None,
    typer.Option("--head", parser=HEAD, metavar="NAME", help="Head besides the state: {heads}; repeatable."),
]


def check_source(files: list[Path] | None, bag: Path | None) -> None:
    """Check that either files or a bag were given.

    Raises:
        ConfigError: none or both were given.
    """
    if bool(files) == (bag is not None):
        raise ConfigError("give either files or --bag")


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
            changes[name.strip()] = parse_toml(f"value = {value}")["value"]
        except ConfigError:
            changes[name.strip()] = value.strip()
    return changes

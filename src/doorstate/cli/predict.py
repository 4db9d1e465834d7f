# SPDX-License-Identifier: Apache-2.0
"""Commands that answer: of clouds, and of the installation itself."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import (
    Bag,
    BudgetMs,
    CameraInfoTopic,
    DepthScale,
    Focal,
    Frame,
    IntrinsicsFile,
    Network,
    PointCount,
    Roll,
    RuleName,
    Topic,
    Units,
    Weights,
    files_or_bag,
    read_options,
)
from doorstate.cli.output import WRITERS, destination
from doorstate.errors import ConfigError, DoorstateError, MissingExtraError
from doorstate.inference.serialization import described_file

if TYPE_CHECKING:
    from doorstate.io.readers import ReadOptions


def predict(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Clouds, depth images, or folders of them.")
    ] = None,
    network: Network = None,
    weights: Weights = None,
    rule: RuleName = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    every: Annotated[int, typer.Option(help="Answer every Nth message of the bag.", min=1)] = 1,
    out: Annotated[Path | None, typer.Option(help="Write the answers to this .csv or .jsonl file.")] = None,
    frame: Frame = "body",
    roll: Roll = 0,
    units: Units = "m",
    depth_scale: DepthScale = 0.001,
    intrinsics: IntrinsicsFile = None,
    fx: Focal = None,
    fy: Focal = None,
    cx: Focal = None,
    cy: Focal = None,
) -> None:
    """Tell the state of the door in each file (.pcd .ply .npy .npz .xyz .txt .csv, depth .png) or message of a ROS bag.

    \b
    Examples:
      doorstate predict cloud.pcd
      doorstate predict --frame optical --json recordings/
      doorstate predict recordings/ --out states.csv
      doorstate predict --rule plane_state cloud.pcd
      doorstate predict --network ogurob-dgcnn --budget-ms 33 recordings/
      doorstate predict depth.png --fx 385.9 --fy 385.4 --cx 317.8 --cy 243.7
      doorstate predict depth.png --intrinsics camera_info.yaml --roll 90
      doorstate predict --bag run.bag --topic /camera/depth/points --frame optical --out run.csv
    """
    from doorstate.cli.bags import predict_bag
    from doorstate.inference.loading import load_predictor
    from doorstate.io.readers import find_clouds

    files_or_bag(files, bag)
    if bag is None and (topic, camera_info_topic, every) != (None, None, 1):
        raise ConfigError("--topic, --camera-info-topic and --every are for --bag")
    if out is not None and as_json:
        raise ConfigError("--out writes JSON lines to a file that ends in .jsonl: leave --json out")
    if out is not None and out.suffix not in WRITERS:
        raise ConfigError(f"--out {out}: name a {' or '.join(WRITERS)} file")
    options = read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy))
    found = find_clouds(files or [])
    load = partial(load_predictor, network, weights, rule, points, budget_ms=budget_ms)
    if bag is None:
        _predict_files(load(), found, options, out, as_json)
    else:
        predict_bag(load, bag, options, topic, camera_info_topic, every, out, as_json)


def info(as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False) -> None:
    """Versions, networks, packaged weights, rules and what this machine offers.

    \b
    Examples:
      doorstate info
      doorstate info --json
    """
    from doorstate.cli.console import print_table
    from doorstate.clouds.sampling import HAS_FPSAMPLE
    from doorstate.networks.packaged import packaged_networks
    from doorstate.rules import create_rule, list_rules
    from doorstate.training.environment import describe_environment

    try:
        from doorstate.networks import create_network, list_networks
    except ImportError as error:
        raise MissingExtraError(
            f"info tells of networks, which need the package {error.name}: install it"
        ) from error

    environment = describe_environment() | {"fpsample": HAS_FPSAMPLE}
    networks = [
        (
            name,
            sum(p.numel() for p in create_network(name).parameters()),
            [weights for weights in packaged_networks() if weights.rpartition("-")[2] == name],
        )
        for name in list_networks()
    ]
    if as_json:
        listed = [{"network": n, "parameters": p, "packaged_weights": w} for n, p, w in networks]
        print(json.dumps(environment | {"networks": listed, "rules": list_rules()}))  # noqa: T201
        return
    print_table("", ["", "value"], [[name, str(value)] for name, value in environment.items()])
    rows = [[name, f"{count:,}", ", ".join(weights) or "none"] for name, count, weights in networks]
    print_table("", ["network", "parameters", "weights in the package"], rows)
    print_table("", ["rule", "after"], [[name, create_rule(name).source] for name in list_rules()])


def _predict_files(
    predictor: Any, paths: list[Path], options: ReadOptions, out: Path | None, as_json: bool
) -> None:
    from doorstate.cli.console import err, progress_bar

    failures = 0
    with destination("file", out, as_json) as write, progress_bar("Predicting") as progress:
        for number, path in enumerate(paths):
            answer = _answer(predictor, path, options)
            failures += "error" in answer
            write(answer)
            progress(number + 1, len(paths))
    if failures:
        err.print(f"{failures} of {len(paths)} files could not be answered")
        raise typer.Exit(1)


def _answer(predictor: Any, path: Path, options: ReadOptions) -> dict[str, Any]:
    from doorstate.io.readers import read_cloud

    # A name may hold bytes that are no text, which cannot be printed.
    file = {"file": str(path).encode(errors="backslashreplace").decode()}
    try:
        return file | described_file(predictor(read_cloud(path, options)))
    except DoorstateError as error:
        return file | {"error": str(error).removeprefix(f"{path.name}: ")}

# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.flags import format_flag
from doorstate.cli.options import (
    Bag,
    BudgetMs,
    CameraInfoTopic,
    Network,
    PointCount,
    RuleName,
    Topic,
    Weights,
    check_source,
)
from doorstate.cli.prediction_output import WRITERS, open_output
from doorstate.cli.reading_options import with_reading_options
from doorstate.errors import ConfigError, DoorstateError

if TYPE_CHECKING:
    from doorstate.inference.predictor import Predictor
    from doorstate.io.options import ReadOptions


@with_reading_options
def predict(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Clouds, depth images, or folders of them.")
    ] = None,
    network: Network = None,
    weights: Weights = None,
    rule: RuleName = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object a line.")] = False,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    every: Annotated[int, typer.Option(help="Use only every Nth message of the bag.", min=1)] = 1,
    out: Annotated[
        Path | None, typer.Option(help="Write the predictions to this .csv or .jsonl file.")
    ] = None,
    *,
    options: ReadOptions,
) -> None:
    """Predict the state of the door in clouds.

    Clouds come from files, depth images or the messages of a ROS bag. Files: .pcd .ply .npy .npz .xyz .txt .csv,
    depth .png. The exit code is 1 if there was no prediction for a file or message.

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
    from doorstate.cli.predict_bag import predict_bag
    from doorstate.cli.predictors import load_predictor
    from doorstate.io.find import find_clouds

    check_source(files, bag)
    if bag is None and (topic, camera_info_topic, every) != (None, None, 1):
        raise ConfigError("--topic, --camera-info-topic and --every need --bag")
    if out is not None and as_json:
        raise ConfigError("--json cannot be combined with --out; a .jsonl file holds JSON lines")
    if out is not None and out.suffix not in WRITERS:
        raise ConfigError(f"--out {out}: expected a {' or '.join(WRITERS)} file")
    paths = find_clouds(files or [])
    load = partial(load_predictor, network, weights, rule, points, budget_ms=budget_ms)
    if bag is None:
        _predict_files(load(), paths, options, out, as_json)
    else:
        predict_bag(load, bag, options, topic, camera_info_topic, every, out, as_json)


def _predict_files(
    predictor: Predictor,
    paths: list[Path],
    options: ReadOptions,
    out: Path | None,
    as_json: bool,
) -> None:
    from doorstate.cli.console import progress_bar, stderr

    failures = 0
    with open_output("file", out, as_json) as write, progress_bar("Predicting") as progress:
        for number, path in enumerate(paths, 1):
            row = _predict_file(predictor, path, options)
            failures += "error" in row
            write(row)
            progress(number, len(paths))
    if failures:
        stderr.print(f"no prediction for {failures} of {len(paths)} files")
        raise typer.Exit(1)


def _predict_file(predictor: Predictor, path: Path, options: ReadOptions) -> dict[str, Any]:
    from doorstate.inference.serialization import prediction_to_dict, require_points
    from doorstate.io.readers import read_cloud

    # A file name may hold bytes that are not text and cannot be printed.
    row = {"file": str(path).encode(errors="backslashreplace").decode()}
    try:
        return row | prediction_to_dict(require_points(predictor(read_cloud(path, options))), format_flag)
    except DoorstateError as error:
        return row | {"error": error.describe(format_flag, with_path=False)}

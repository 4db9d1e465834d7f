# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.flags import format_flag
from doorstate.cli.named_options import with_named_options
from doorstate.cli.options import (
    AsJson,
    Bag,
    BudgetMs,
    CameraInfoTopic,
    Device,
    DoorBox,
    DoorKnownFlag,
    DoorPose,
    Every,
    NetworkNames,
    PointCount,
    RuleNames,
    Threads,
    Topic,
    WeightsFiles,
    check_source,
)
from doorstate.cli.predicted_values import Asked, Moment, predicted_values
from doorstate.cli.prediction_output import WRITERS, Output, Rows
from doorstate.cli.reading_options import with_reading_options
from doorstate.errors import CloudReadError, ConfigError, DoorstateError

if TYPE_CHECKING:
    from doorstate.cli.named_options import NamedOptions
    from doorstate.dataset.frame_index import IndexedOptions
    from doorstate.inference.predictor import Predictor
    from doorstate.io.options import ReadOptions
    from doorstate.io.sensor_pose import PosedCloud


@with_reading_options
@with_named_options
def predict(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Clouds, depth images, or folders of them.")
    ] = None,
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    rule: RuleNames = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    threads: Threads = None,
    device: Device = "cpu",
    door_known: DoorKnownFlag = False,
    door_pose: DoorPose = None,
    door_box: DoorBox = None,
    as_json: AsJson = False,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    every: Every = 1,
    out: Annotated[
        Path | None, typer.Option(help="Write the predictions to this .csv or .jsonl file.")
    ] = None,
    draw: Annotated[
        bool | None,
        typer.Option(
            "--draw/--no-draw",
            help="Draw the doors of each cloud from above. [default: those of a single cloud]",
            show_default=False,
        ),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            help="Write the doors of a single cloud from above, with walls and view, to this .svg file."
        ),
    ] = None,
    *,
    named: NamedOptions,
    options: ReadOptions,
) -> None:
    """Predict the states of the doors in clouds.

    Clouds come from files, depth images or the messages of a ROS bag. Files: .pcd .ply .npy .npz .xyz .txt .csv,
    depth .png. Several networks and rules answer side by side. The exit code is 1 if a file or message could not be
    predicted; all others are, and --out is written.

    \b
    Examples:
      doorstate predict cloud.pcd
      doorstate predict --axes optical --json recordings/
      doorstate predict recordings/ --out states.csv
      doorstate predict --network pointnet2 --rule plane_state --rule angle_bins cloud.pcd
      doorstate predict --network ogurob-dgcnn --budget-ms 33 recordings/
      doorstate predict --door-known cloud.pcd
      doorstate predict depth.png --fx 385.9 --fy 385.4 --cx 317.8 --cy 243.7
      doorstate predict depth.png --intrinsics camera_info.yaml --roll 90
      doorstate predict --bag run.bag --topic /camera/depth/points --out run.csv
      doorstate predict cloud.pcd --plan cloud.svg
      doorstate predict --bag run.bag --doors doors.yaml --poses poses.csv --history doors.sqlite
    """
    from doorstate._files import check_writable
    from doorstate.cli.predict_bag import predict_bag
    from doorstate.cli.predictors import Methods, load_predictors, only_method
    from doorstate.dataset.frame_index import IndexedOptions
    from doorstate.inference.known import door_known as known_door

    check_source(files, bag)
    if bag is None and (topic, camera_info_topic) != (None, None):
        raise ConfigError("--topic and --camera-info-topic need --bag")
    if out is not None and as_json:
        raise ConfigError("--json cannot be combined with --out; a .jsonl file holds JSON lines")
    if out is not None and out.suffix not in WRITERS:
        raise ConfigError(f"--out {out}: expected a {' or '.join(WRITERS)} file")
    methods = Methods(network, weights, rule)
    door = known_door(door_known, door_pose, door_box)
    if named.doors is not None:
        only_method(methods)
        if door is not False:
            raise ConfigError(
                "--doors asks for its own doors: leave --door-known, --door-pose and --door-box out"
            )
    is_named = named.doors is not None
    if bag is not None:
        if plan is not None:
            raise ConfigError("--plan is for a single cloud, not for --bag")
        output = Output("stamp_s", "message", out, as_json, bool(draw), is_named)
        with named.open() as doors:
            # The predictor is loaded after the bag was opened, because it takes longer.
            predict_bag(
                lambda: load_predictors(methods, points, budget_ms=budget_ms, threads=threads, device=device),
                bag,
                options,
                topic,
                camera_info_topic,
                every,
                output,
                Asked(door, doors),
            )
        return
    sources = _find(files or [])[::every]
    is_single = len(sources) == 1 and len(methods.choices()) == 1
    if plan is not None:
        if not is_single:
            raise ConfigError("--plan is for a single cloud and a single network or rule")
        if plan.suffix != ".svg":
            raise ConfigError(f"--plan {plan}: expected a .svg file")
        check_writable(plan)
    output = Output("file", "file", out, as_json, is_single if draw is None else draw, is_named)
    with named.open() as doors:
        predictors = load_predictors(methods, points, budget_ms=budget_ms, threads=threads, device=device)
        indexed = IndexedOptions(options)
        asked = Asked(door, doors, plan)
        clouds = (_predict_file(predictors, source, indexed, asked) for source in sources)
        names = [_name(source) for source in sources if isinstance(source, Path)]
        output.write(clouds, list(predictors), names, len(sources))


def _find(paths: list[Path]) -> list[Path | CloudReadError]:
    """Return the files, and the errors of arguments without any; a single argument must have one."""
    from doorstate.io.find import find_clouds

    if len(paths) == 1:
        return [*find_clouds(paths)]
    found: list[Path | CloudReadError] = []
    for path in paths:
        try:
            found += find_clouds([path])
        except CloudReadError as error:
            found.append(error)
    return found


def _predict_file(
    predictors: Mapping[str, Predictor],
    source: Path | CloudReadError,
    options: IndexedOptions,
    asked: Asked,
) -> Rows:
    from doorstate.io.readers import read_posed_cloud

    if isinstance(source, CloudReadError):
        return [
            {"file": _name(Path(source.path or "")), "error": source.describe(format_flag, with_path=False)}
        ]
    row = {"file": _name(source)}
    try:
        return [*_predict(predictors, read_posed_cloud(source, options.of(source)), asked, source, row)]
    except DoorstateError as error:
        return [row | {"error": error.describe(format_flag, with_path=False)}]
    except MemoryError:
        return [row | {"error": "not enough memory for this file"}]


def _predict(
    predictors: Mapping[str, Predictor], cloud: PosedCloud, asked: Asked, source: Path, row: dict[str, Any]
) -> Iterator[dict[str, Any]]:
    for method, predictor in predictors.items():
        moment = Moment(row["file"])
        if asked.doors is not None:
            moment = Moment(row["file"], *asked.doors.poses.of_file(source))
        yield row | {"method": method} | predicted_values(predictor, cloud, asked, moment, needs_points=True)


def _name(path: Path) -> str:
    """Return a path as text; a file name may hold bytes that are not text."""
    return str(path).encode(errors="backslashreplace").decode()

# SPDX-License-Identifier: Apache-2.0
"""`doorstate evaluate`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, with_engine_options
from doorstate.cli.options import (
    AsJson,
    BudgetMs,
    Device,
    LayoutName,
    NetworkNames,
    PointCount,
    RuleNames,
    Threads,
    WeightsFiles,
)
from doorstate.cli.reading_options import check_layout, with_reading_options
from doorstate.errors import CloudReadError, ConfigError

if TYPE_CHECKING:
    from doorstate.io.options import ReadOptions

_DOOR_COLUMN = "door"


@with_reading_options
@with_engine_options
def evaluate(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder with an index.csv, with one sub-folder for each state, or with the layout of --layout."
        ),
    ],
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    rule: RuleNames = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    threads: Threads = None,
    device: Device = "cpu",
    group: Annotated[
        str | None,
        typer.Option(
            help="Column whose equal values mark dependent frames, for confidence intervals. [default: door, if any]"
        ),
    ] = None,
    by: Annotated[
        list[str] | None,
        typer.Option(
            help="Report scores by the values of a column, or with COLUMN:WORD by whether it holds a word; repeatable."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for predictions.csv, metrics.json, tables/ and frames.html.")
    ] = None,
    all_frames: Annotated[
        bool, typer.Option("--all", help="Show all frames in frames.html, not only errors.")
    ] = False,
    as_json: AsJson = False,
    layout: LayoutName = None,
    *,
    options: ReadOptions,
    engine: EngineOptions,
) -> None:
    """Score networks and rules on labelled recordings.

    Clouds and depth images come with an index of their states, or in one sub-folder for each state. An index.csv has
    one row for each file, with the columns file and state. Optional columns are fx, fy, cx, cy, width, height
    (pixels), depth_unit_m, axes, roll_deg, pitch_deg, door, rgb (a colour image to show) and any others. A state other
    than the three marks a frame without a clear door; such frames are reported separately. The exit code is 1 if a file
    could not be read.

    \b
    Examples:
      doorstate evaluate recordings/
      doorstate evaluate recordings/ --network pointnet2 --rule angle_bins --rule plane_state --out report
      doorstate evaluate recordings/ --by sensor --by door:glass --all --out report
      doorstate evaluate DeepDoors2 --layout deepdoors2 --weights mine.safetensors --by split --json
    """
    from doorstate._files import check_writable
    from doorstate._locks import owned_folder
    from doorstate.cli.console import print_json, stderr
    from doorstate.cli.evaluate_output import PAGE, print_scores, write_frame_report
    from doorstate.cli.prediction_summary import print_errors
    from doorstate.cli.predictors import Methods, arguments_of, load_predictors
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.labelled import check_column, labelled_frames
    from doorstate.evaluation.frame_pieces import evaluate_frames_in_pieces
    from doorstate.evaluation.frame_tables import NO_GROUP, frame_notes, frame_tables
    from doorstate.evaluation.frames import evaluate_frames

    if all_frames and out is None:
        raise ConfigError("--all needs --out")
    if engine.is_cluster and out is None:
        raise ConfigError("machines of a cluster need a folder that they share", field="out")
    check_layout(layout, options)
    frames = labelled_frames(folder, options, layout)
    if group is None and any(frame.columns.get(_DOOR_COLUMN) for frame in frames):
        group = _DOOR_COLUMN
    for column in (*(by or ()), *([group] if group else ())):
        check_column(frames, column.partition(":")[0])
    if out is not None:
        check_writable(out / PAGE)
    with nullcontext() if out is None else owned_folder(out):
        methods = Methods(network, weights, rule)
        predictors = load_predictors(methods, points, budget_ms=budget_ms, threads=threads, device=device)
        if engine.name == "processes" and engine.workers is None:
            with progress_bar("Predicting") as progress:
                results = evaluate_frames(predictors, frames, progress)
        else:
            arguments = arguments_of(predictors, methods, threads, device)
            with engine.open() as workers, progress_bar("Predicting") as progress:
                results = evaluate_frames_in_pieces(arguments, frames, workers, out, progress)
        print_errors([(frame.file, reason) for frame, reason in results.unreadable], "file")
        if not results.frames:
            raise CloudReadError(f"none of {len(frames)} files could be read", path=folder)
        scores = results.score(group, by or ())
        tables, notes = frame_tables(scores, group or NO_GROUP), frame_notes(scores, group or NO_GROUP)
        if as_json:
            print_json(scores.to_json())
        else:
            print_scores(tables, notes)
        if out is not None:
            page = write_frame_report(out, folder, predictors, results, scores, tables, notes, all_frames)
            stderr.print(f"page: {page}")
        if results.unreadable:
            stderr.print(
                f"{len(results.unreadable)} of {len(frames)} files could not be read and are not counted"
            )
            raise typer.Exit(1)

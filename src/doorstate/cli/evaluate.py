# SPDX-License-Identifier: Apache-2.0
"""`doorstate evaluate`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, Gpus, with_engine_options
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
    from doorstate.viewer.frame_page import ShownFrames


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
    gpus: Gpus = None,
    group: Annotated[
        str | None,
        typer.Option(
            help="Column whose equal values mark dependent frames, for intervals. [default: door or moment, if any]"
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
    changed: Annotated[
        bool,
        typer.Option(
            "--changed",
            help="Show in frames.html the frames of which the first and the last method say different things.",
        ),
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
    (pixels), depth_unit_m, axes, roll_deg, pitch_deg, door, moment, rgb (a colour image to show) and any others; label
    writes them. A state other than the three marks a frame without a clear door; such frames are
    reported separately. Of several methods, a table compares each with the first one. The exit code is 1 if a file
    could not be read.

    \b
    Examples:
      doorstate evaluate recordings/
      doorstate evaluate recordings/ --network pointnet2 --rule angle_bins --rule plane_state --out report
      doorstate evaluate recordings/ --network pointnet2 --weights site.safetensors --by door --changed --out report
      doorstate evaluate recordings/ --by sensor --by door:glass --all --out report
      doorstate evaluate DeepDoors2 --layout deepdoors2 --weights mine.safetensors --by split --json
    """
    from doorstate._files import check_writable
    from doorstate._jobs import Resources
    from doorstate._locks import owned_folder
    from doorstate.cli.console import print_json, stderr
    from doorstate.cli.evaluate_output import PAGE, print_scores, write_frame_report
    from doorstate.cli.prediction_summary import print_errors
    from doorstate.cli.predictors import Methods, arguments_of, load_predictors
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.labelled import check_column, labelled_frames
    from doorstate.evaluation.frame_pieces import evaluate_frames_in_pieces
    from doorstate.evaluation.frame_tables import NO_GROUP, frame_notes, frame_tables
    from doorstate.evaluation.frames import default_group, evaluate_frames

    methods = Methods(network, weights, rule)
    shown = _shown_frames(all_frames, changed, out, len(methods.choices()))
    if engine.is_cluster and out is None:
        raise ConfigError("machines of a cluster need a folder that they share", field="out")
    engine = engine.on_device(device, Resources(gpus=gpus) if gpus else None)
    check_layout(layout, options)
    frames = labelled_frames(folder, options, layout)
    group = group or default_group(frames)
    for column in (*(by or ()), *([group] if group else ())):
        check_column(frames, column.partition(":")[0])
    if out is not None:
        check_writable(out / PAGE)
    with nullcontext() if out is None else owned_folder(out):
        predictors = load_predictors(methods, points, budget_ms=budget_ms, threads=threads, device=device)
        if engine.is_default:
            with progress_bar("Predicting") as progress:
                results = evaluate_frames(predictors, frames, progress)
        else:
            arguments = arguments_of(predictors, methods, threads, device)
            with engine.open() as workers, progress_bar("Predicting") as progress:
                results = evaluate_frames_in_pieces(
                    arguments, frames, workers, out, progress, engine.resources
                )
        print_errors([(frame.file, reason) for frame, reason in results.unreadable], "file")
        if not results.frames:
            raise CloudReadError(f"none of {len(frames)} files could be read", path=folder)
        scores = results.score(group, by or ())
        comparison = results.compare(group)
        tables = frame_tables(scores, group or NO_GROUP)
        # The comparison comes second.
        tables = {name: tables[name] for name in ("scores",) if name in tables} | comparison.tables() | tables
        notes, values = frame_notes(scores, group or NO_GROUP), scores.to_json() | comparison.to_json()
        if as_json:
            print_json(values)
        else:
            print_scores(tables, notes)
        if out is not None:
            page = write_frame_report(out, folder, predictors, results, values, tables, notes, shown)
            stderr.print(f"page: {page}")
        if results.unreadable:
            stderr.print(
                f"{len(results.unreadable)} of {len(frames)} files could not be read and are not counted"
            )
            raise typer.Exit(1)


def _shown_frames(all_frames: bool, changed: bool, out: Path | None, methods: int) -> ShownFrames:
    """Return the frames to show on the page.

    Raises:
        ConfigError: two kinds are given, no folder for the page, or one method where two are compared.
    """
    if all_frames and changed:
        raise ConfigError("give either --all or --changed")
    shown: ShownFrames = "all" if all_frames else "changed" if changed else "errors"
    if out is None and shown != "errors":
        raise ConfigError(f"--{shown} needs --out")
    if changed and methods < 2:
        raise ConfigError("--changed compares two methods, such as --network pointnet2 and --weights FILE")
    return shown

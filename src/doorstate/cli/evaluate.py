# SPDX-License-Identifier: Apache-2.0
"""`evaluate`: methods against recorded frames whose states are known."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import (
    DepthScale,
    Focal,
    Frame,
    IntrinsicsFile,
    LayoutName,
    PointCount,
    Roll,
    Units,
    read_options,
)
from doorstate.errors import CloudReadError, ConfigError

if TYPE_CHECKING:
    from doorstate.evaluation.frames import Asked, Methods
    from doorstate.evaluation.table import Table

_DOOR = "door"  # the column that names doors, where there is one
_PAGE = "frames.html"


def evaluate(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder with an index.csv, or with sub-folders named after states, or of a --layout."
        ),
    ],
    network: Annotated[
        list[str] | None, typer.Option(help="Network whose packaged weights to ask; repeatable.")
    ] = None,
    weights: Annotated[
        list[Path] | None, typer.Option(help="A weights file of your own; repeatable.")
    ] = None,
    rule: Annotated[list[str] | None, typer.Option(help="A rule to ask; repeatable.")] = None,
    points: PointCount = None,
    group: Annotated[
        str | None,
        typer.Option(help="Column of the index by which frames depend on each other; door, if there is one."),
    ] = None,
    by: Annotated[
        list[str] | None,
        typer.Option(
            help="Scores apart by this column, or COLUMN:WORD, by whether it has a word; repeatable."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for predictions.csv, metrics.json, tables/ and frames.html.")
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Show all frames in frames.html, not only those with errors.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics as one JSON object.")] = False,
    layout: LayoutName = None,
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
    """Ask networks and rules about recorded clouds or depth images with known states, and count.

    An index.csv has a line for each file: file, state, and where they are known fx, fy, cx, cy, width, height
    (pixels), depth_unit_m, frame, roll_deg, door, rgb (a colour image to show), and whatever else. A state that is
    none of the three marks a frame without a clear door; those are reported apart. Exit code 1: some files could not
    be read.

    \b
    Examples:
      doorstate evaluate recordings/
      doorstate evaluate recordings/ --network pointnet2 --rule angle_bins --rule plane_state --out report
      doorstate evaluate recordings/ --by sensor --by door:glass --all --out report
      doorstate evaluate DeepDoors2 --layout deepdoors2 --weights mine.safetensors --by split --json
    """
    from doorstate._files import check_writable
    from doorstate.cli.console import err, progress_bar
    from doorstate.dataset.labelled import check_column, labelled_frames
    from doorstate.evaluation.frame_tables import NO_GROUP, frame_notes, frame_tables
    from doorstate.evaluation.frames import ask

    if everything and out is None:
        raise ConfigError("--all is for the page of --out FOLDER")
    options = read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy), layout)
    frames = labelled_frames(folder, options, layout)
    if group is None and any(each.columns.get(_DOOR) for each in frames):
        group = _DOOR
    for column in (*(by or ()), *([group] if group else ())):
        check_column(frames, column.partition(":")[0])
    if out is not None:
        check_writable(out / _PAGE)
    methods = _methods(network, weights, rule, points)
    with progress_bar("Asking") as progress:
        asked = ask(methods, frames, progress)
    for each, reason in asked.unreadable:
        message = f"{each.file}: {reason.removeprefix(f'{each.file}: ')}"
        err.print(message, style="red", soft_wrap=True)
    if not asked.frames:
        raise CloudReadError(f"{folder}: none of {len(frames)} files could be read")
    metrics = asked.metrics(group, by or ())
    tables, notes = frame_tables(metrics, group or NO_GROUP), frame_notes(metrics, group or NO_GROUP)
    if as_json:
        print(json.dumps(metrics))  # noqa: T201
    else:
        _print(tables, notes)
    if out is not None:
        page = _write(out, folder, methods, asked, metrics, tables, notes, everything)
        err.print(f"{page} shows the frames", soft_wrap=True)
    if asked.unreadable:
        err.print(f"{len(asked.unreadable)} of {len(frames)} files could not be read and are not counted")
        raise typer.Exit(1)


def _methods(
    networks: Sequence[str] | None,
    weights: Sequence[Path] | None,
    rules: Sequence[str] | None,
    points: int | None,
) -> Methods:
    """Who is asked, by name; the default network if nobody is named."""
    from doorstate.inference.loading import load_predictor
    from doorstate.inference.predictor import DEFAULT_NETWORK

    asked: list[tuple[str | None, Path | None, str | None]] = [
        *((name, None, None) for name in networks or ()),
        *((None, path, None) for path in weights or ()),
        *((None, None, name) for name in rules or ()),
    ] or [(DEFAULT_NETWORK, None, None)]
    names = [rule or (path.stem if path else str(network)) for network, path, rule in asked]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ConfigError(
            f"{twice[0]} is asked for twice: name each method once, and weights files differently"
        )
    mixed = networks or weights  # rules beside them look at all points
    return {
        name: load_predictor(network, path, rule, None if rule and mixed else points)
        for name, (network, path, rule) in zip(names, asked, strict=True)
    }


def _print(tables: Mapping[str, Table], notes: Sequence[str]) -> None:
    from doorstate.cli.console import out, print_table

    for note in notes:
        out.print(note, soft_wrap=True)
    for table in tables.values():
        print_table(table.title, table.columns, table.rows)
        if table.note:
            out.print(table.note, soft_wrap=True)


def _write(
    out: Path,
    folder: Path,
    methods: Methods,
    asked: Asked,
    metrics: Mapping[str, Any],
    tables: Mapping[str, Table],
    notes: Sequence[str],
    everything: bool,
) -> Path:
    from doorstate import __version__
    from doorstate._files import write_csv, write_text
    from doorstate.cli.console import progress_bar
    from doorstate.evaluation.tables import save_tables
    from doorstate.viewer.frame_page import choose_frames, frame_cards, render_frame_page

    name = folder.resolve().name
    write_csv(out / "predictions.csv", asked.rows())
    whole: dict[str, Any] = {
        "doorstate": __version__,
        "folder": name,
        "not_read": {f.file: why for f, why in asked.unreadable},
    }
    write_text(out / "metrics.json", json.dumps({**whole, **metrics}, indent=2) + "\n")
    save_tables(tables, out / "tables")
    chosen = choose_frames(asked, everything)
    with progress_bar("Looking") as progress:
        cards = frame_cards(asked, methods, chosen, progress)
    page = out / _PAGE
    write_text(page, render_frame_page(name, tables, asked, cards, notes))
    return page

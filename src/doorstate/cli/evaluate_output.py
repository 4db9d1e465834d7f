# SPDX-License-Identifier: Apache-2.0
"""Output of `doorstate evaluate`: tables on standard output, and a folder with tables and a page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from doorstate import __version__
from doorstate._files import write_text
from doorstate._paths import csv_name
from doorstate.cli.console import print_table, stdout
from doorstate.cli.progress import progress_bar
from doorstate.evaluation.tables import save_tables
from doorstate.viewer.frame_page import ShownFrames, choose_frames, make_cards, render_frame_page

if TYPE_CHECKING:
    from doorstate.evaluation.frames import FrameResults, Predictors
    from doorstate.evaluation.table import Table

PAGE = "frames.html"


def print_scores(tables: Mapping[str, Table], notes: Sequence[str]) -> None:
    """Print notes and tables on standard output."""
    for note in notes:
        stdout.print(note)
    for table in tables.values():
        print_table(table.title, table.columns, table.rows)
        if table.note:
            stdout.print(table.note)


def write_frame_report(
    out: Path,
    folder: Path,
    predictors: Predictors,
    results: FrameResults,
    values: Mapping[str, Any],
    tables: Mapping[str, Table],
    notes: Sequence[str],
    shown: ShownFrames,
) -> Path:
    """Write predictions, metrics, tables and the page into a folder, and return the path of the page.

    Args:
        out: folder to write.
        folder: folder of the frames.
        predictors: predictors by name.
        results: their predictions.
        values: scores of the predictions as JSON values.
        tables: tables of the scores.
        notes: notes to read before the numbers.
        shown: frames on the page.
    """
    name = folder.resolve().name
    table = results.joined.drop(columns="correct").rename(columns={"sample_id": "file"})
    table["file"] = table["file"].map(csv_name)
    write_text(out / "predictions.csv", table.to_csv(index=False, lineterminator="\n", float_format="%.5g"))
    metrics = {
        "doorstate": __version__,
        "folder": name,
        "unreadable": {frame.file: reason for frame, reason in results.unreadable},
        **values,
    }
    write_text(out / "metrics.json", json.dumps(metrics, indent=2) + "\n")
    save_tables(tables, out / "tables")
    with progress_bar("Writing the page") as progress:
        cards = make_cards(results, predictors, choose_frames(results, shown), progress)
    page = out / PAGE
    write_text(page, render_frame_page(name, tables, results, cards, notes, shown))
    return page

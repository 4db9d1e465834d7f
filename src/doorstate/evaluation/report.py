# SPDX-License-Identifier: Apache-2.0
"""Report of a comparison: tables, figures, and one HTML page that loads nothing from anywhere."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._files import check_writable, write_text
from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate._locks import owned_folder
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.evaluation.caveats import PROTOCOLS, caveats
from doorstate.evaluation.figures.encode import save_figures
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.method_scores import predicted_labels
from doorstate.evaluation.metrics import confusion, ratio
from doorstate.evaluation.predictions import join_results, load_results
from doorstate.evaluation.report_parts import ReportParts, build_parts, draw_dataset_figures
from doorstate.evaluation.results import Results
from doorstate.evaluation.stratum_tables import dataset_tables
from doorstate.evaluation.tables import save_tables
from doorstate.pages.colors import DETECTION_COLORS, STATE_COLORS, STATE_WORDS
from doorstate.pages.encoding import data_uri
from doorstate.pages.render import render_page
from doorstate.types import STATES


def write_report(
    folders: Sequence[Path],
    out: Path,
    dataset: Path | None = None,
    folds: int | None = None,
    workers: WorkersOrEngine = 1,
    progress: Progress = no_progress,
) -> Path:
    """Write `tables/`, `figures/` and `report.html`; the same inputs give the same bytes.

    Args:
        folders: comparisons, finished or partly finished; several on the same samples are shown as one.
        out: folder of the report, made if absent.
        dataset: data set folder, if it was moved.
        folds: number of first folds to show; all if not given.
        workers: number of processes that draw, None for one a processor, or an engine.
        progress: called with parts done and parts in all.

    Returns:
        Path of the page.

    Raises:
        RunError: the comparison cannot be used.
        DatasetError: the data set or the splits cannot be used.
        FolderInUseError: another process writes to `out`.
    """
    results = join_results([load_results(folder, dataset, folds) for folder in folders])
    return write_results_report(results, out, workers, progress)


def write_results_report(
    results: Results, out: Path, workers: WorkersOrEngine = 1, progress: Progress = no_progress
) -> Path:
    """Write the report of loaded results as `write_report` does."""
    page = out / "report.html"
    check_writable(page)
    with owned_folder(out):
        prepared = open_dataset(results.dataset_folder)
        parts = build_parts(results, workers, out, progress)
        save_tables(parts.tables, out / "tables")
        save_figures(parts.figures, out / "figures")
        write_text(page, render_report(results, prepared, parts))
    return page


def write_dataset_report(
    dataset: Path, out: Path, workers: WorkersOrEngine = 1, progress: Progress = no_progress
) -> Path:
    """Write the tables and figures of a prepared data set alone: Table 1, undecidable frames, Figures 1 and 2.

    Args:
        dataset: prepared data set.
        out: folder for `tables/` and `figures/`, made if absent.
        workers, progress: as for `write_report`.

    Returns:
        `out`.

    Raises:
        DatasetError: the data set cannot be used.
        FolderInUseError: another process writes to `out`.
    """
    prepared = open_dataset(dataset)
    with owned_folder(out):
        save_tables(dataset_tables(manifest_frame(prepared.rows)), out / "tables")
        save_figures(draw_dataset_figures(prepared, workers, out, progress), out / "figures")
    return out


def render_report(results: Results, dataset: PreparedDataset, parts: ReportParts) -> str:
    """Fill the template of the page.

    Args:
        results: a checked comparison.
        dataset: data set of the comparison.
        parts: output of `build_parts`.
    """
    return render_page(
        "report.html.j2",
        "doorstate.evaluation",
        results=results,
        config=results.config,
        recipe=json.dumps(results.config.recipe, indent=2, default=str),
        protocol=PROTOCOLS.get(results.config.protocol, ""),
        caveats=caveats(results, dataset.description.left_out),
        facts=_facts(results, dataset),
        environment=_environment(results),
        tables=parts.tables,
        figures={name: data_uri(png, "image/png") for name, png in parts.figures.items()},
        confusions=[(method, _confusion_cells(results, method)) for method in results.methods],
        states=STATES,
        words=STATE_WORDS,
        labels=predicted_labels(results),
        state_colors=STATE_COLORS,
        detection_colors=DETECTION_COLORS,
        gallery=parts.gallery,
        page_data={"clouds": parts.gallery.clouds, "detections": parts.gallery.detections},
    )


def _confusion_cells(results: Results, method: str) -> list[list[tuple[int, float]]]:
    """Return counts with their share of the true state, row by row; an undefined share, which only tints, is 0."""
    counts = confusion(results.tested_by(method))[:, : len(predicted_labels(results))]
    shares = np.nan_to_num(ratio(counts, counts.sum(axis=1, keepdims=True)))
    return [list(zip(*pair, strict=True)) for pair in zip(counts.tolist(), shares.tolist(), strict=True)]


def _facts(results: Results, dataset: PreparedDataset) -> dict[str, str]:
    config = results.config
    states = results.manifest["state"].value_counts()
    roles = [results.role_counts(fold) for fold in range(config.folds)]
    return {
        "Networks": ", ".join(config.networks),
        **({"Rules": ", ".join(config.rules)} if config.rules else {}),
        "Runs": f"{len(results.runs)} of {len(results.runs) + len(results.missing)}",
        "Data": f"{dataset.description.source} ({dataset.description.kind})",
        "Samples": f"{len(results.manifest)}: "
        + ", ".join(f"{states.get(state, 0)} {STATE_WORDS[state]}" for state in STATES),
        "Points per cloud": str(config.num_points),
        "Protocol": f"{config.protocol}, {config.folds} folds",
        **{
            name: _range(count[role] for count in roles)
            for name, role in (
                ("Training samples per fold", "train"),
                ("Validation samples per fold", "val"),
                ("Test samples per fold", "test"),
                ("Unused samples per fold", "unused"),
            )
        },
        "Seed": str(config.seed),
    }


def _range(values: Iterable[int]) -> str:
    numbers = sorted(set(values))
    return str(numbers[0]) if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"


def _environment(results: Results) -> dict[str, str]:
    """Return every value that the runs recorded, once; several where runs differ."""
    values: dict[str, dict[str, None]] = {}
    for run in results.runs:
        for name, value in run.environment.items():
            values.setdefault(name, {})[_text(value)] = None
    return {name: "; ".join(texts) for name, texts in sorted(values.items())}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)

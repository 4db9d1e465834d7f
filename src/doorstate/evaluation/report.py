# SPDX-License-Identifier: Apache-2.0
"""One HTML file that shows a comparison and loads nothing from anywhere."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._files import write_text
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.evaluation.caveats import PROTOCOLS, caveats
from doorstate.evaluation.figures import (
    Drawing,
    draw_dataset,
    save_drawings,
    write_figures,
)
from doorstate.evaluation.gallery import build_gallery
from doorstate.evaluation.join import load_joined
from doorstate.evaluation.metrics import ratio
from doorstate.evaluation.pages import data_uri, render_page
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.score_tables import answers_given, pooled_confusion
from doorstate.evaluation.table import Table
from doorstate.evaluation.tables import dataset_tables, save_tables, write_tables
from doorstate.evaluation.views import DETECTION_COLORS, STATE_COLORS, STATE_WORDS
from doorstate.types import STATES


def write_report(
    comparison_folders: Sequence[Path],
    out_folder: Path,
    dataset_folder: Path | None = None,
    folds: int | None = None,
    of_dataset: Mapping[str, Drawing] | None = None,
) -> Path:
    """Write `tables/`, `figures/` and `report.html`; the same inputs give the same bytes.

    Args:
        comparison_folders: finished or partly finished; several on the same samples are shown as one.
        out_folder: made if absent.
        dataset_folder: its data set, if it is not where the comparison says.
        folds: show the first so many folds only.
        of_dataset: what `draw_dataset` gave, if it is drawn already.

    Returns:
        The report.

    Raises:
        RunError: the comparison cannot be used.
        DatasetError: its data set or splits cannot be used.
    """
    results = load_joined(comparison_folders, dataset_folder, folds)
    dataset = open_dataset(results.dataset_folder)
    tables = write_tables(results, dataset, out_folder / "tables")
    drawings = write_figures(results, dataset, out_folder / "figures", of_dataset)
    report = out_folder / "report.html"
    write_text(report, render_report(results, dataset, tables, drawings))
    return report


def write_dataset_figures(dataset_folder: Path, out_folder: Path) -> Path:
    """Write what can be shown of a prepared data set alone: Table 1, undecidable frames, Figures 1 and 2.

    Args:
        dataset_folder: a prepared data set.
        out_folder: made if absent; gets `tables/` and `figures/`.

    Returns:
        `out_folder`.

    Raises:
        DatasetError: the data set cannot be used.
    """
    dataset = open_dataset(dataset_folder)
    save_tables(dataset_tables(dataset), out_folder / "tables")
    save_drawings(draw_dataset(dataset), out_folder / "figures")
    return out_folder


def render_report(
    results: ComparisonResults,
    dataset: PreparedDataset,
    tables: Mapping[str, Table],
    drawings: Mapping[str, Drawing],
) -> str:
    """Fill the template.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
        tables: what `build_tables` gave.
        drawings: what `draw_figures` gave.
    """
    gallery = build_gallery(results, dataset)
    return render_page(
        "report.html.j2",
        results=results,
        comparison=results.comparison,
        recipe=json.dumps(results.comparison.recipe, indent=2, default=str),
        protocol=PROTOCOLS.get(results.comparison.protocol, ""),
        notes=caveats(results, dataset),
        facts=_facts(results, dataset),
        environment=_environment(results),
        tables=tables,
        figures={name: _image_uri(drawing) for name, drawing in drawings.items()},
        confusions=[(network, _confusion_cells(results, network)) for network in results.networks],
        states=STATES,
        words=STATE_WORDS,
        answers=answers_given(results),
        state_colors=STATE_COLORS,
        shape_colors=DETECTION_COLORS,
        shape_names=sorted(
            {
                s["name"]
                for by_method in gallery.shapes.values()
                for found in by_method.values()
                for s in found
            }
        ),
        gallery=gallery,
        page_data={"clouds": gallery.clouds, "shapes": gallery.shapes},
    )


def _image_uri(drawing: Drawing) -> str:
    """Take whichever file of a figure is smaller."""
    if len(drawing.svg) < len(drawing.png):
        return data_uri(drawing.svg, "image/svg+xml")
    return data_uri(drawing.png, "image/png")


def _confusion_cells(results: ComparisonResults, network: str) -> list[list[tuple[int, float]]]:
    """Counts with their share of the true state, row by row; a share of nothing is 0 here, it only tints."""
    counts = pooled_confusion(results, network)[:, : len(answers_given(results))]
    shares = np.nan_to_num(ratio(counts, counts.sum(axis=1, keepdims=True)))
    return [list(zip(*pair, strict=True)) for pair in zip(counts.tolist(), shares.tolist(), strict=True)]


def _facts(results: ComparisonResults, dataset: PreparedDataset) -> dict[str, str]:
    comparison = results.comparison
    states = [row["state"] for row in dataset.rows]
    roles = [results.role_counts(fold) for fold in range(comparison.folds)]
    return {
        "Networks": ", ".join(comparison.networks),
        **({"Rules": ", ".join(comparison.rules)} if comparison.rules else {}),
        "Runs": f"{len(results.runs)} of {len(results.runs) + len(results.missing)}",
        "Data": f"{dataset.description.source} ({dataset.description.kind})",
        "Samples": f"{len(states)}: " + ", ".join(f"{states.count(state)} {state}" for state in STATES),
        "Points a cloud": str(comparison.num_points),
        "Protocol": f"{comparison.protocol}, {comparison.folds} folds",
        **{
            name: _range(count[role] for count in roles)
            for name, role in (
                ("Training samples a fold", "train"),
                ("Validation samples a fold", "val"),
                ("Test samples a fold", "test"),
                ("Unused samples a fold", "unused"),
            )
        },
        "Seed": str(comparison.seed),
    }


def _range(values: Iterable[int]) -> str:
    numbers = sorted(set(values))
    return str(numbers[0]) if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"


def _environment(results: ComparisonResults) -> dict[str, str]:
    """Every value that the runs recorded, once; several where runs differ."""
    values: dict[str, dict[str, None]] = {}
    for run in results.runs:
        for name, value in run.environment.items():
            values.setdefault(name, {})[_text(value)] = None
    return {name: "; ".join(found) for name, found in sorted(values.items())}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)

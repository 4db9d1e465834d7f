# SPDX-License-Identifier: Apache-2.0
"""Parts of a report that do not depend on each other, made by one process or several."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from doorstate._jobs import Progress, WorkersOrEngine, map_pieces, no_progress
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.evaluation.figures.draw import (
    COMPARISON_FIGURES,
    DATASET_FIGURES,
    draw_dataset_figure,
    draw_figure,
)
from doorstate.evaluation.gallery import Gallery, build_gallery
from doorstate.evaluation.results import Results
from doorstate.evaluation.table import Table
from doorstate.evaluation.tables import build_tables

_TABLES, _GALLERY = "tables", "gallery"
# Long parts first; those that draw the same samples side by side, because a process keeps the last it has rendered.
_ERRORS = ("figure3_misclassified", "figure4_missed_by_most")
_OTHERS = tuple(name for name in (*DATASET_FIGURES, *COMPARISON_FIGURES) if name not in _ERRORS)
_PARTS = (*_ERRORS, _GALLERY, _TABLES, *_OTHERS)


class ReportParts(NamedTuple):
    """Tables, figures as PNG, both by name, and gallery."""

    tables: Mapping[str, Table]
    figures: Mapping[str, bytes]
    gallery: Gallery


def build_parts(
    results: Results, workers: WorkersOrEngine, folder: Path, progress: Progress = no_progress
) -> ReportParts:
    """Build all parts of the report of a comparison; arguments as for `map_pieces`."""
    built = map_pieces(_build, partial(_open, results), _PARTS, workers, folder, progress)
    parts = dict(zip(_PARTS, built, strict=True))
    return ReportParts(parts.pop(_TABLES), gallery=parts.pop(_GALLERY), figures=_without_missing(parts))


def draw_dataset_figures(
    dataset: PreparedDataset, workers: WorkersOrEngine, folder: Path, progress: Progress = no_progress
) -> dict[str, bytes]:
    """Draw the figures of a data set as PNG, by name; arguments as for `map_pieces`."""
    load, names = partial(open_dataset, dataset.folder), tuple(DATASET_FIGURES)
    drawn = map_pieces(draw_dataset_figure, load, names, workers, folder, progress)
    return _without_missing(dict(zip(names, drawn, strict=True)))


def _open(results: Results) -> tuple[Results, PreparedDataset]:
    return results, open_dataset(results.dataset_folder)


def _build(data: tuple[Results, PreparedDataset], name: str) -> Any:
    results, dataset = data
    if name == _TABLES:
        return build_tables(results)
    if name == _GALLERY:
        return build_gallery(results, dataset)
    return draw_figure(results, dataset, name)


def _without_missing(figures: Mapping[str, bytes | None]) -> dict[str, bytes]:
    return {name: png for name, png in figures.items() if png is not None}

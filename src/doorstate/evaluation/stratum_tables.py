# SPDX-License-Identifier: Apache-2.0
"""Tables by where a sample was taken (distance band, angle region) and whether it can be decided at all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import BANDS, REGIONS
from doorstate.evaluation.metrics import accuracy, confusion_matrix, ratio, scores
from doorstate.evaluation.results import Answers, ComparisonResults, Predictions
from doorstate.evaluation.table import UNDEFINED, Table, number
from doorstate.types import NO_DOOR, PREDICTED_LABELS, STATES, Indices

NO_STRATA = "This data set records no distance bands or angle regions."
NO_TWINS = "This data set does not record which frames look the same in another state."

_BAND_TITLES = tuple(f"{band.replace('-', '–')} m" for band in BANDS)
_REGION_TITLES = {name: f"{name} {low}–{high}°" for name, (low, high) in REGIONS.items()}


def has_strata(dataset: PreparedDataset) -> bool:
    """Tell whether at least one sample lies in a known band and region."""
    return any(_stratum(row) is not None for row in dataset.rows)


def _stratum(row: Mapping[str, str]) -> tuple[int, int] | None:
    """Row and column of a sample in a grid of regions by bands."""
    region, band = row.get("region", ""), row.get("distance_band", "")
    if region not in REGIONS or band not in BANDS:
        return None
    return list(REGIONS).index(region), BANDS.index(band)


def rows_of(dataset: PreparedDataset, said: Predictions | Answers) -> list[dict[str, str]]:
    """Find the manifest row of each of N predictions or answers."""
    return [dataset.rows[dataset.index_of(sample_id)] for sample_id in said.sample_ids]


def is_undecidable(row: Mapping[str, str]) -> bool:
    """Tell whether another state of the same pose gives the same image."""
    return bool(row.get("same_image_as"))


def records_twins(dataset: PreparedDataset) -> bool:
    """Tell whether the data set knows which frames are undecidable."""
    return any(row.get("pose_id") and "same_image_as" in row for row in dataset.rows)


def decidable_ceiling(rows: Iterable[Mapping[str, str]]) -> float:
    """Give the highest accuracy any single method can reach: of equal images, it is right on one.

    Args:
        rows: manifest rows with `pose_id`, `state` and `same_image_as`.
    """
    images = [
        (row["pose_id"], frozenset({row["state"], *row["same_image_as"].split()}))
        if is_undecidable(row)
        else (row["sample_id"], frozenset())
        for row in rows
    ]
    return float(ratio(len(set(images)), len(images)))


def samples_table(dataset: PreparedDataset) -> Table:
    """Table 1: samples by state, angle region and distance band."""
    columns = ("state", "region", *_BAND_TITLES, "total")
    title = "Table 1. Samples by state, angle region and distance to the door"
    if not has_strata(dataset):
        return Table(title, columns, (), NO_STRATA, text_columns=2)
    states = [*STATES, *([NO_DOOR] if any(row["state"] == NO_DOOR for row in dataset.rows) else [])]
    labels = [states.index(row["state"]) for row in dataset.rows]
    grid = _with_margins(_stratum_counts(dataset.rows, labels, len(states)))
    grid = np.concatenate([grid, grid.sum(axis=-1, keepdims=True)], axis=-1)  # (6, 5, 4)
    rows = tuple(
        (state, region, *map(str, line))
        for state, lines in zip([*states, "all"], np.moveaxis(grid, -1, 0), strict=True)
        for region, line in zip([*_REGION_TITLES.values(), "all"], lines, strict=True)
    )
    outside = len(dataset.rows) - int(grid[-1, -1, -1])
    note = f"{outside} samples lie outside these strata." if outside else ""
    return Table(title, columns, rows, note, text_columns=2)


def state_table(results: ComparisonResults, dataset: PreparedDataset, state: str, ordinal: int) -> Table:
    """Tables 4 to 6: recall, precision and F1 of one state by network, angle region and distance band."""
    columns = ("network", "metric", "region", *_BAND_TITLES, "all")
    title = f"Table {ordinal}. {state.replace('_', '-').capitalize()} doors by angle region and distance"
    if not has_strata(dataset):
        return Table(title, columns, (), NO_STRATA, text_columns=3)
    rows = [row for network in results.networks for row in _stratum_rows(results, dataset, network, state)]
    note = (
        "Recall: share (and count) of the state's samples in the stratum that were recognised. Precision: "
        f"share of the stratum's samples called {state} that are. {UNDEFINED}: no such sample."
    )
    return Table(title, columns, tuple(rows), note, text_columns=3)


def _stratum_rows(
    results: ComparisonResults, dataset: PreparedDataset, network: str, state: str
) -> list[tuple[str, ...]]:
    confusion = _stratum_confusions(results.pooled(network), dataset)
    index = STATES.index(state)
    hits = confusion[..., index, index]
    cells = {
        "recall": _with_counts(hits, confusion[..., index, :].sum(axis=-1)),
        "precision": _with_counts(hits, confusion[..., :, index].sum(axis=-1)),
        "F1": [[number(value, 3) for value in line] for line in scores(confusion).f1[..., index]],
    }
    regions = [*_REGION_TITLES.values(), "all"]
    return [
        (network, metric, region, *line)
        for metric, grid in cells.items()
        for region, line in zip(regions, grid, strict=True)
    ]


def _stratum_confusions(predictions: Predictions, dataset: PreparedDataset) -> Indices:
    """Confusion matrices (6, 5, 3, 4) by region and band; the last of each is over all of them."""
    states, answers = len(STATES), len(PREDICTED_LABELS)
    cells = predictions.true * answers + predictions.predicted
    counts = _with_margins(_stratum_counts(rows_of(dataset, predictions), cells, states * answers))
    return counts.reshape(*counts.shape[:2], states, answers)  # (6, 5, 3, 4)


def _stratum_counts(rows: Sequence[Mapping[str, str]], kinds: ArrayLike, num_kinds: int) -> Indices:
    """Count N rows by region, band and kind (an integer each); rows outside the strata are left out."""
    counts = np.zeros((len(REGIONS), len(BANDS), num_kinds), dtype=np.int64)
    for row, kind in zip(rows, np.asarray(kinds), strict=True):
        if (stratum := _stratum(row)) is not None:
            counts[(*stratum, kind)] += 1
    return counts


def _with_margins(counts: Indices) -> Indices:
    """Append the sums over regions and over bands: (5, 4, K) to (6, 5, K)."""
    counts = np.concatenate([counts, counts.sum(axis=0, keepdims=True)], axis=0)
    return np.concatenate([counts, counts.sum(axis=1, keepdims=True)], axis=1)


def _with_counts(hits: Indices, totals: Indices) -> list[list[str]]:
    """Format each share as `0.987 (75/76)`."""
    return [
        [_share(int(hit), int(total)) for hit, total in zip(*line, strict=True)]
        for line in zip(hits, totals, strict=True)
    ]


def _share(hits: int, total: int) -> str:
    return f"{number(hits / total, 3)} ({hits}/{total})" if total else UNDEFINED


def undecidable_table(dataset: PreparedDataset) -> Table:
    """Frames that another state of the same pose repeats, by state."""
    columns = ("state", "samples", "undecidable", "share")
    title = "Undecidable frames: another state of the same pose gives the same image"
    if not records_twins(dataset):
        return Table(title, columns, (), NO_TWINS)
    rows = []
    for state, chosen in [*((state, (state,)) for state in STATES), ("all", STATES)]:
        flags = [is_undecidable(row) for row in dataset.rows if row["state"] in chosen]
        share = float(ratio(sum(flags), len(flags)))
        rows.append((state, str(len(flags)), str(sum(flags)), number(share)))
    ceiling = number(decidable_ceiling(dataset.rows))
    note = f"No single method can be right on more than {ceiling} of all samples."
    return Table(title, columns, tuple(rows), note)


def decidable_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Accuracy of each network with and without the undecidable frames, beside the ceiling they put on it."""
    columns = ("network", "all", "decidable", "undecidable", "ceiling")
    title = "Accuracy with and without the undecidable frames"
    if not records_twins(dataset):
        return Table(title, columns, (), NO_TWINS)
    rows = []
    for network in results.networks:
        predictions = results.pooled(network)
        manifest = rows_of(dataset, predictions)
        undecidable = np.array([is_undecidable(row) for row in manifest], dtype=bool)
        parts = [np.ones_like(undecidable), ~undecidable, undecidable]
        shares = [
            accuracy(confusion_matrix(predictions.true[part], predictions.predicted[part])) for part in parts
        ]
        rows.append((network, *map(number, shares), number(decidable_ceiling(manifest))))
    note = (
        "The ceiling holds for one fixed method. Under cross-validation two equal images can fall into "
        "different folds, where differently trained networks answer."
    )
    return Table(title, columns, tuple(rows), note)

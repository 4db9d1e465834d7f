# SPDX-License-Identifier: Apache-2.0
"""What kinds of scenes a network misses: its errors by confusion, with what they have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.table import UNDEFINED, Table
from doorstate.types import PREDICTED_LABELS, STATES

_RANGES = {
    "opening angle, °": ("opening_angle_deg", 0),
    "distance, m": ("distance_m", 1),
    "leaf pixels": ("visible_leaf_px", 0),
}


def error_kinds_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """A line for each network and confusion: how often, where, and at which opening angles."""
    rows = []
    for network in results.networks:
        errors = [error for error in results.error_rows if error.network == network]
        for state in STATES:
            for predicted in PREDICTED_LABELS:
                kind = [e for e in errors if (e.state, e.predicted) == (state, predicted)]
                if kind:
                    found = [dataset.rows[dataset.index_of(error.sample_id)] for error in kind]
                    cells = [_range(found, *column) for column in _RANGES.values()]
                    rows.append((network, state, predicted, str(len(kind)), _regions(found), *cells))
    note = (
        "Ranges: least, median and greatest value. Regions: how many of the errors lie in which angle region. "
        f"{UNDEFINED}: the data set does not know."
    )
    return Table(
        "Errors by kind",
        ("network", "true state", "taken for", "errors", "regions", *_RANGES),
        tuple(rows),
        note,
        text_columns=3,
    )


def _range(rows: Sequence[Mapping[str, str]], column: str, digits: int) -> str:
    values = [float(row[column]) for row in rows if row.get(column)]
    if not values:
        return UNDEFINED
    return " / ".join(f"{value:.{digits}f}" for value in (min(values), np.median(values), max(values)))


def _regions(rows: Sequence[Mapping[str, str]]) -> str:
    counts = Counter(row["region"] for row in rows if row.get("region"))
    return ", ".join(f"{count} {region}" for region, count in sorted(counts.items())) or UNDEFINED

# SPDX-License-Identifier: Apache-2.0
"""What rules say besides the state: opening angles against the truth (heads may say them too), and why no answer."""

from __future__ import annotations

from collections import Counter

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import rows_of
from doorstate.evaluation.table import Table, number
from doorstate.simulation.manifest import numbers
from doorstate.types import STATES

_CLOSED = STATES.index("closed")


def angle_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Error of the opening angle of each method that gives one, by region; doors that are not closed."""
    rows = []
    for method in results.networks:
        predictions = results.pooled(method)
        if np.isnan(predictions.angles_deg).all():
            continue
        manifest = rows_of(dataset, predictions)
        truth = numbers(manifest, "opening_angle_deg")
        region = np.array([row.get("region", "") for row in manifest])
        asked = (predictions.true != _CLOSED) & ~np.isnan(truth)
        error = np.abs(predictions.angles_deg - truth)
        for name in (*REGIONS, "all"):
            chosen = asked if name == "all" else asked & (region == name)
            if chosen.any():
                rows.append((method, name, *_cells(error[chosen])))
    return Table(
        "Error of the opening angle, in degrees",
        ("method", "region", "doors", "angle given", "mean", "median", "95th percentile"),
        tuple(rows),
        "Semi-open and open doors. The simulator knows the angle; where a method gave none, it is not counted.",
        text_columns=2,
    )


def reasons_table(results: ComparisonResults) -> Table:
    """Why methods gave no answer, the most frequent reasons first."""
    rows = []
    for method in results.networks:
        counts = Counter(reason for reason in results.pooled(method).reasons if reason)
        rows += [(method, reason, str(count)) for reason, count in counts.most_common()]
    return Table("No answer, and why", ("method", "reason", "samples"), tuple(rows), text_columns=2)


def _cells(error: Floats) -> tuple[str, ...]:
    given = error[~np.isnan(error)]
    cells = [str(len(error)), str(len(given))]
    if len(given) == 0:
        return (*cells, *(number(float("nan")) for _ in range(3)))
    found = (given.mean(), np.median(given), np.quantile(given, 0.95))
    return (*cells, *(number(float(value), 1) for value in found))

# SPDX-License-Identifier: Apache-2.0
"""What rules say besides the state, or in its place: opening angles (heads may say them too), open or not, why not."""

from __future__ import annotations

from collections import Counter

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.metrics import Floats, ratio
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import rows_of
from doorstate.evaluation.table import Table, number
from doorstate.simulation.manifest import numbers
from doorstate.types import STATES

_CLOSED, _OPEN = STATES.index("closed"), STATES.index("open")


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


def open_table(results: ComparisonResults) -> Table:
    """Open or not, of every method, where a rule tells that and no more; no answer is neither."""
    pooled = {method: results.pooled(method) for method in results.networks}
    rows = []
    for method, predictions in pooled.items():
        if any(predictions.open_or_not):
            answered = np.array([answer != "" for answer in predictions.open_or_not])
            said_open = np.array([answer == "open" for answer in predictions.open_or_not])
        else:
            answered, said_open = predictions.predicted < len(STATES), predictions.predicted == _OPEN
        is_open = predictions.true == _OPEN
        hits = (said_open & is_open).sum()
        right = hits + (answered & ~said_open & ~is_open).sum()
        shares = ratio((hits, hits, right), (is_open.sum(), said_open.sum(), len(predictions)))
        rows.append((method, *(number(float(share)) for share in shares), str((~answered).sum())))
    return Table(
        "Open or not",
        ("method", "recall of open", "precision of open", "accuracy", "no answer"),
        tuple(rows) if any(any(each.open_or_not) for each in pooled.values()) else (),
        "Closed and semi-open are both not open. No answer counts as wrong.",
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

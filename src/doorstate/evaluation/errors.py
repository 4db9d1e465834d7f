# SPDX-License-Identifier: Apache-2.0
"""Misclassified samples: a row each, and the kinds of errors with what their samples have in common."""

from __future__ import annotations

import pandas as pd

from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.results import PROBABILITY_COLUMNS, Results
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.types import PREDICTED_LABELS, STATES

RANGES = ("opening_angle_deg", "distance_m", "visible_leaf_px")
_FACTS = (
    "opening_angle_deg",
    "distance_m",
    "robot_angle_deg",
    "distance_band",
    "region",
    "visible_leaf_px",
    "same_image_as",
)


def list_errors(results: Results) -> pd.DataFrame:
    """Return every misclassified sample of every method, with its probabilities and facts of the manifest."""
    columns = ["method", "fold", "sample_id", "state", "predicted", *PROBABILITY_COLUMNS, *_FACTS]
    return results.errors.reindex(columns=columns)


def summarize_errors(results: Results) -> pd.DataFrame:
    """Summarize the errors of each method by true state and predicted label.

    Returns:
        Columns method, state, predicted, errors, regions (text: errors in each angle region), and least, median and
        greatest value (`_min`, `_median`, `_max`) of each of `RANGES`.
    """
    errors = results.errors
    rows = []
    for method in results.methods:
        for state in STATES:
            for label in PREDICTED_LABELS:
                kind = errors[
                    (errors["method"] == method) & (errors["state"] == state) & (errors["predicted"] == label)
                ]
                if kind.empty:
                    continue
                regions = text_values(kind, "region")
                counts = regions[regions != ""].value_counts().sort_index()
                row: dict[str, object] = {
                    "method": method,
                    "state": state,
                    "predicted": label,
                    "errors": len(kind),
                    "regions": ", ".join(f"{count} {region}" for region, count in counts.items()),
                }
                for name in RANGES:
                    values = number_values(kind, name)
                    row |= {
                        f"{name}_min": values.min(),
                        f"{name}_median": values.median(),
                        f"{name}_max": values.max(),
                    }
                rows.append(row)
    ranges = [f"{name}_{end}" for name in RANGES for end in ("min", "median", "max")]
    return pd.DataFrame(rows, columns=["method", "state", "predicted", "errors", "regions", *ranges])


def order_errors(errors: pd.DataFrame) -> pd.DataFrame:
    """Sort rows of `Results.errors`: decidable ones first, then by falling confidence; states of rules are certain."""
    order = errors.assign(undecidable=is_undecidable(errors), descending=-errors["confidence"].fillna(1.0))
    order = order.sort_values(["undecidable", "descending", "sample_id"], kind="stable")
    return errors.loc[order.index]


def missed_by(count: int, methods: int) -> str:
    """Return the heading of samples that `count` of the methods misclassified."""
    return f"Missed by {count or 'none'} of {methods}"

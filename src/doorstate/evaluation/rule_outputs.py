# SPDX-License-Identifier: Apache-2.0
"""Outputs of rules besides the state: opening angles (heads predict them too), open or not, reasons to abstain."""

from __future__ import annotations

import pandas as pd

from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.metrics import ratio
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import ALL
from doorstate.types import ABSTAINED


def score_angles(results: Results) -> pd.DataFrame:
    """Return the error of the opening angle of doors that are not closed, for each method that measures it.

    Returns:
        Columns method, region, doors, measured, mean_deg, median_deg, p95_deg.
    """
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        if tested["opening_angle_deg_predicted"].isna().all():
            continue
        truth = number_values(tested, "opening_angle_deg")
        error = (tested["opening_angle_deg_predicted"] - truth).abs()
        counted, region = (tested["state"] != "closed") & truth.notna(), text_values(tested, "region")
        for name in (*REGIONS, ALL):
            chosen = error[counted & ((region == name) | (name == ALL))]
            if len(chosen):
                rows.append(
                    {
                        "method": method,
                        "region": name,
                        "doors": len(chosen),
                        "measured": int(chosen.notna().sum()),
                        "mean_deg": chosen.mean(),
                        "median_deg": chosen.median(),
                        "p95_deg": chosen.quantile(0.95),
                    }
                )
    return pd.DataFrame(rows)


def score_open_or_not(results: Results) -> pd.DataFrame:
    """Score every method on open against not open, where a rule tells that and no more; else an empty frame.

    An abstention counts as wrong; a rule that tells open from not open has abstained only where it did not.

    Returns:
        Columns method, recall, precision (of open), accuracy, abstained.
    """
    if results.tested["open_or_not"].isna().all():
        return pd.DataFrame()
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        if tested["open_or_not"].notna().any():
            decided, predicted_open = tested["open_or_not"].notna(), tested["open_or_not"] == "open"
        else:
            decided, predicted_open = tested["predicted"] != ABSTAINED, tested["predicted"] == "open"
        is_open = tested["state"] == "open"
        hits = (predicted_open & is_open).sum()
        correct = hits + (decided & ~predicted_open & ~is_open).sum()
        rows.append(
            {
                "method": method,
                "recall": float(ratio(hits, is_open.sum())),
                "precision": float(ratio(hits, predicted_open.sum())),
                "accuracy": float(ratio(correct, len(tested))),
                "abstained": int((~decided).sum()),
            }
        )
    return pd.DataFrame(rows)


def count_abstentions(results: Results) -> pd.DataFrame:
    """Count the reasons for which methods abstained, the most frequent first: columns method, reason, samples."""
    rows = [
        (method, reason, count)
        for method in results.methods
        for reason, count in results.tested_by(method)["reason"].value_counts(sort=True).items()
    ]
    return pd.DataFrame(rows, columns=["method", "reason", "samples"])

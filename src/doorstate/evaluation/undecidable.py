# SPDX-License-Identifier: Apache-2.0
"""Undecidable frames: another state of the same pose gives the same image, so no method can tell them apart."""

from __future__ import annotations

import pandas as pd

from doorstate.evaluation.manifest import text_values
from doorstate.evaluation.metrics import accuracy, confusion, ratio
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import ALL
from doorstate.types import STATES


def is_undecidable(frame: pd.DataFrame) -> pd.Series[bool]:
    """Return for each row of a manifest, or joined with one, whether another state of its pose looks the same."""
    return text_values(frame, "same_image_as") != ""


def records_twins(manifest: pd.DataFrame) -> bool:
    """Return True if the data set records which samples are undecidable."""
    return "same_image_as" in manifest and bool((text_values(manifest, "pose_id") != "").any())


def decidable_ceiling(frame: pd.DataFrame) -> float:
    """Return the highest accuracy that a single method can reach: of equal images, it is correct on one.

    Args:
        frame: columns `pose_id`, `state` and `same_image_as`.
    """
    undecidable = is_undecidable(frame)
    twins = frame[undecidable]
    images = (
        {
            (pose, frozenset({state, *same.split()}))
            for pose, state, same in zip(
                twins["pose_id"], twins["state"], twins["same_image_as"], strict=True
            )
        }
        if len(twins)
        else set()
    )
    return float(ratio(int((~undecidable).sum()) + len(images), len(frame)))


def count_undecidable(manifest: pd.DataFrame) -> pd.DataFrame:
    """Count undecidable frames: columns state, samples, undecidable, share; last the sum over the states."""
    undecidable = is_undecidable(manifest)
    rows = []
    for name, states in [*((state, [state]) for state in STATES), (ALL, list(STATES))]:
        chosen = undecidable[manifest["state"].isin(states)]
        count = int(chosen.sum())
        rows.append(
            {
                "state": name,
                "samples": len(chosen),
                "undecidable": count,
                "share": float(ratio(count, len(chosen))),
            }
        )
    return pd.DataFrame(rows)


def decidable_accuracy(results: Results) -> pd.DataFrame:
    """Return the accuracy with and without undecidable frames: columns method, all, decidable, undecidable, ceiling."""
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        undecidable = is_undecidable(tested)
        rows.append(
            {
                "method": method,
                "all": accuracy(confusion(tested)),
                "decidable": accuracy(confusion(tested[~undecidable])),
                "undecidable": accuracy(confusion(tested[undecidable])),
                "ceiling": decidable_ceiling(tested),
            }
        )
    return pd.DataFrame(rows)

# SPDX-License-Identifier: Apache-2.0
"""What a reader must know before believing a number: what is missing, reduced, shared or undecidable."""

from __future__ import annotations

from doorstate.clouds.preparation import NUM_POINTS
from doorstate.dataset.splits import NUM_FOLDS
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import (
    NO_STRATA,
    NO_TWINS,
    decidable_ceiling,
    has_strata,
    is_undecidable,
    records_twins,
)
from doorstate.evaluation.table import number

PAPER_SAMPLES = 4059  # Kaleci & Turgut 2021: 1353 of each state

PROTOCOLS = {
    "paper": (
        "Folds are random within state, distance band and angle region, as in the paper. The same pose in "
        "another state, and poses 10 cm away, can be on both sides of a fold: the scores are optimistic for "
        "doors and places never seen."
    ),
    "by-pose": (
        "All states of a pose stay on one side of a fold, and poses within 0.5 m of a tested one are used by "
        "nobody in that fold: no near-copy of a test cloud was trained on."
    ),
    "by-scene": (
        "A door in its room, with all that was seen of it, stays on one side of a fold: tested doors and rooms were "
        "never trained on."
    ),
    "all": "Everything was trained on and nothing tested.",
    "unseen": "Weights were trained on other data; what is tested here shares no scene and no sample with that.",
}


def caveats(results: ComparisonResults, dataset: PreparedDataset) -> list[str]:
    """List the reservations that apply to this comparison, the gravest first."""
    comparison, notes = results.comparison, []
    if results.missing:
        by_network: dict[str, list[str]] = {}
        for network, fold in results.missing:
            by_network.setdefault(network, []).append(str(fold))
        names = "; ".join(f"{network} fold {', '.join(folds)}" for network, folds in by_network.items())
        total = len(results.runs) + len(results.missing)
        notes.append(
            f"Partial: {len(results.missing)} of {total} runs are not finished ({names}). Networks tested on "
            "different folds are not directly comparable."
        )
    if comparison.folds < NUM_FOLDS:
        notes.append(f"Only {comparison.folds} of {NUM_FOLDS} folds are shown; other samples are untested.")
    if len(dataset.rows) < PAPER_SAMPLES:
        notes.append(f"Reduced data: {len(dataset.rows)} samples, the paper has {PAPER_SAMPLES}.")
    if comparison.num_points < NUM_POINTS:
        notes.append(
            f"Reduced resolution: {comparison.num_points} points a cloud, the paper has {NUM_POINTS}."
        )
    unused = [results.role_counts(fold)["unused"] for fold in range(comparison.folds)]
    if any(unused):
        notes.append(
            f"In each fold up to {max(unused)} samples are neither trained on, validated on nor tested."
        )
    if not has_strata(dataset):
        notes.append(NO_STRATA)
    if not records_twins(dataset):
        notes.append(NO_TWINS)
    elif undecidable := sum(is_undecidable(row) for row in dataset.rows):
        notes.append(
            f"{undecidable} frames look the same in another state of their door: no single method can be "
            f"right on more than {number(decidable_ceiling(dataset.rows))} of all samples."
        )
    return notes

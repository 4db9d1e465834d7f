# SPDX-License-Identifier: Apache-2.0
"""Caveats of a comparison: missing runs, reduced data, shared poses, undecidable frames."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from doorstate.clouds.preparation import NUM_POINTS
from doorstate.dataset.splits import NUM_FOLDS
from doorstate.evaluation.metrics import confusion, precision_recall_f1
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import has_strata
from doorstate.evaluation.stratum_tables import NO_STRATA, NO_TWINS
from doorstate.evaluation.table import number
from doorstate.evaluation.undecidable import decidable_ceiling, is_undecidable, records_twins
from doorstate.pages.colors import STATE_WORDS
from doorstate.types import ABSTAINED, PREDICTED_LABELS, STATES

PAPER_SAMPLES = 4059  # Kaleci & Turgut 2021: 1353 of each state

PROTOCOLS = {
    "paper": (
        "Folds are random within state, distance band and angle region, as in the paper. The same pose in "
        "another state, and poses 10 cm away, can be on both sides of a fold: the scores are optimistic for "
        "unseen doors and places."
    ),
    "by-pose": (
        "All states of a pose stay on one side of a fold, and poses within 0.5 m of a tested one are "
        "unused in that fold: no near-copy of a test cloud was trained on."
    ),
    "by-scene": (
        "All samples of a door in its room stay on one side of a fold: tested doors and rooms were not trained on."
    ),
    "all": "Everything was trained on and nothing tested.",
    "unseen": "Weights were trained on other data, which share no scene and no sample with these.",
}


def caveats(results: Results, left_out: Mapping[str, int] = MappingProxyType({})) -> list[str]:
    """List the caveats of a comparison, the gravest first.

    Args:
        results: a checked comparison.
        left_out: clouds by state that its data set does not hold, because they could not be prepared.
    """
    config, manifest = results.config, results.manifest
    notes = []
    if results.missing:
        by_method: dict[str, list[str]] = {}
        for method, fold in results.missing:
            by_method.setdefault(method, []).append(str(fold))
        names = "; ".join(f"{method} fold {', '.join(folds)}" for method, folds in by_method.items())
        total = len(results.runs) + len(results.missing)
        notes.append(
            f"Partial: {len(results.missing)} of {total} runs are not finished ({names}). Methods tested on "
            "different folds are not directly comparable."
        )
    if left_out:
        scores = ", ".join(
            f"{method} {number(_macro_f1_with(results, method, left_out))}" for method in results.methods
        )
        counts = ", ".join(f"{count} {STATE_WORDS.get(state, state)}" for state, count in left_out.items())
        notes.append(
            f"{sum(left_out.values())} clouds could not be prepared, or no doorway was found in them ({counts}). They "
            f"are in no table; macro F1 with them as errors: {scores}."
        )
    if config.folds < NUM_FOLDS:
        notes.append(f"Only {config.folds} of {NUM_FOLDS} folds are shown; other samples are untested.")
    if len(manifest) < PAPER_SAMPLES:
        notes.append(f"Reduced data: {len(manifest)} samples, the paper has {PAPER_SAMPLES}.")
    if config.num_points < NUM_POINTS:
        notes.append(f"Reduced resolution: {config.num_points} points a cloud, the paper has {NUM_POINTS}.")
    unused = [results.role_counts(fold)["unused"] for fold in range(config.folds)]
    if any(unused):
        notes.append(
            f"In each fold up to {max(unused)} samples are neither trained on, validated on nor tested."
        )
    if not has_strata(manifest):
        notes.append(NO_STRATA)
    if not records_twins(manifest):
        notes.append(NO_TWINS)
    elif undecidable := int(is_undecidable(manifest).sum()):
        notes.append(
            f"{undecidable} frames look the same in another state of their door: no single method can be "
            f"correct on more than {number(decidable_ceiling(manifest))} of all samples."
        )
    return notes


def _macro_f1_with(results: Results, method: str, left_out: Mapping[str, int]) -> float:
    """Return the macro F1 of a method with the share of clouds left out that its folds would test as abstentions."""
    counts = confusion(results.tested_by(method)).astype(np.float64)
    has_state = int(results.manifest["state"].isin(STATES).sum())
    missed = np.array([left_out.get(state, 0) for state in STATES])
    counts[:, PREDICTED_LABELS.index(ABSTAINED)] += missed * counts.sum() / max(1, has_state)
    return float(precision_recall_f1(counts).macro.f1)

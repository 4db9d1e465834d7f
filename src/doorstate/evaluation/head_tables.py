# SPDX-License-Identifier: Apache-2.0
"""What further heads say against the simulator's truth: is there a door, how far open, where, how wide, which part."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.results import Answers, ComparisonResults
from doorstate.evaluation.stratum_tables import rows_of
from doorstate.evaluation.table import Table, number
from doorstate.networks.heads import HEADS, POINT_HEADS, head_metrics
from doorstate.types import DECISION_THRESHOLD, NO_DOOR, STATES

_METRICS = [metric for head in HEADS.values() for metric in head.metrics]


def answers_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Errors of every head of every network; of what the manifest does not know of a sample nothing is counted."""
    rows = []
    for method in results.networks:
        given = results.answers(method)
        if given is not None:
            found = answer_errors(given, dataset)
            cells = (number(found[metric.title], metric.digits) for metric in _METRICS)
            rows.append((method, str(len(given.sample_ids)), *cells))
    return Table(
        "Answers of further heads",
        ("network", "samples", *(metric.title for metric in _METRICS)),
        tuple(rows),
        "AUROC: how well the probability of a door puts samples with a door above those without. Hinge: share right; a "
        "flush closed leaf may show its side by nothing but the handle.",
    )


def answer_errors(given: Answers, dataset: PreparedDataset) -> dict[str, float]:
    """Figures of a row of `answers_table` by column, NaN where nothing is known or nothing was said.

    Args:
        given: what one network says.
        dataset: that the samples are of.
    """
    metrics = head_metrics(given.columns, rows_of(dataset, given))
    return {metric.title: metrics[metric.name] for metric in _METRICS}


def _of_doors(results: ComparisonResults) -> Iterator[tuple[str, Answers]]:
    """Networks that say whether there is a door, and what they say."""
    for method in results.networks:
        given = results.answers(method)
        if given is not None and "p_door" in given.columns:
            yield method, given


def presence_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """How often a network says that there is a door, by what is there."""
    rows = []
    for method, given in _of_doors(results):
        manifest = rows_of(dataset, given)
        kinds = np.array([row.get("door_kind") or row.get("scene_kind", "") for row in manifest])
        doors = np.array([row["state"] != NO_DOOR for row in manifest])
        said = given.columns["p_door"] >= DECISION_THRESHOLD
        for is_door, name in ((True, "yes"), (False, "no")):
            for kind in sorted(set(kinds[doors == is_door])):
                chosen = (doors == is_door) & (kinds == kind)
                count, yes = int(chosen.sum()), int(said[chosen].sum())
                rows.append((method, name, kind or "unknown", str(count), str(yes), number(yes / count)))
    return Table(
        "Is there a door?",
        ("network", "a door", "kind", "samples", "said yes", "share"),
        tuple(rows),
        text_columns=3,
    )


def four_answers_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """A state or *no door*, as a predictor answers: of what seems to be no door no state is said."""
    rows = []
    for method, given in _of_doors(results):
        state = np.array([row["state"] for row in rows_of(dataset, given)])
        right_state = results.pooled(method).right_by_sample
        door = given.columns["p_door"] >= DECISION_THRESHOLD
        right = np.where(
            state == NO_DOOR, ~door, door & [right_state.get(name, False) for name in given.sample_ids]
        )
        shares = [_mean(right[state == each].astype(float)) for each in (*STATES, NO_DOOR)]
        rows.append(
            (
                method,
                str(len(state)),
                *(number(share) for share in shares),
                number(float(np.mean(shares))),
                number(float(right.mean())),
            )
        )
    return Table(
        "Four answers: a state, or no door",
        ("network", "samples", *(f"right of {each}" for each in (*STATES, NO_DOOR)), "mean", "of all"),
        tuple(rows),
        "A state is right if it is, and if a door is likelier than none.",
    )


def parts_table(results: ComparisonResults) -> Table:
    """Intersection over union of each part of the scene, points of all folds together."""
    head = POINT_HEADS["parts"]
    rows = []
    for method in results.networks:
        counts = [run.metrics.get("test_part_counts") for run in results.runs_of(method)]
        if not all(counts):
            continue
        joined = np.array(counts).sum(axis=0)  # (parts, parts)
        shares = head.metric(joined)
        mean = float(np.nanmean(shares))
        rows.append((method, *(number(float(share), 3) for share in shares), number(mean, 3)))
    columns = ("network", *head.classes, "mean")
    return Table("Parts of points: intersection over union", columns, tuple(rows))


def _mean(values: Floats) -> float:
    """Of what is known."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan

# SPDX-License-Identifier: Apache-2.0
"""Tables by network: summary, confusion matrices, scores with their uncertainty, folds, and paired tests."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.metrics import (
    F1Intervals,
    accuracy,
    bootstrap_f1,
    confusion_matrix,
    holm,
    mcnemar,
    mean_and_deviation,
    scores,
    wilson_interval,
)
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import rows_of
from doorstate.evaluation.table import UNDEFINED, Table, interval, mean_deviation, number, p_value
from doorstate.types import PREDICTED_LABELS, STATES, Indices


def pooled_confusion(results: ComparisonResults, network: str) -> Indices:
    """Sum the (3, 4) confusion matrices of a network's folds."""
    predictions = results.pooled(network)
    return confusion_matrix(predictions.true, predictions.predicted)


def answers_given(results: ComparisonResults) -> tuple[str, ...]:
    """Names of the columns of a confusion matrix: the states, and no answer if there is such a one."""
    silent = any((run.predictions.predicted >= len(STATES)).any() for run in results.runs)
    return PREDICTED_LABELS if silent else STATES


def fold_f1(results: ComparisonResults, network: str) -> list[float]:
    """Macro-F1 of each finished fold of one network."""
    values: list[float] = scores(_fold_confusions(results, network)).macro.f1.tolist()
    return values


def f1_intervals(results: ComparisonResults, dataset: PreparedDataset, network: str) -> F1Intervals:
    """Bootstrap intervals of a network's F1, poses drawn as a whole where the data set has poses."""
    predictions = results.pooled(network)
    clusters = [row.get("pose_id") or row["sample_id"] for row in rows_of(dataset, predictions)]
    # One seed for all networks: they are compared under the same resamples.
    generator = np.random.default_rng(results.comparison.seed)
    return bootstrap_f1(predictions.true, predictions.predicted, clusters, generator)


def _fold_confusions(results: ComparisonResults, network: str) -> Indices:
    """Confusion matrices (finished folds, 3, 4) of one network."""
    parts = [run.predictions for run in results.runs_of(network)]
    return np.stack([confusion_matrix(part.true, part.predicted) for part in parts])


def summary_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """One line a network: errors, accuracy, macro scores and their uncertainty."""
    columns = (
        "network",
        "samples",
        "errors",
        "accuracy",
        "accuracy 95% CI",
        "macro precision",
        "macro recall",
        "macro F1",
        "macro F1 95% CI",
        "macro F1 over folds",
    )
    rows = []
    for network in results.networks:
        confusion = pooled_confusion(results, network)
        right, total = int(np.trace(confusion)), int(confusion.sum())
        macro = scores(confusion).macro
        rows.append(
            (
                network,
                str(total),
                str(total - right),
                number(accuracy(confusion)),
                interval(wilson_interval(right, total)),
                number(float(macro.precision)),
                number(float(macro.recall)),
                number(float(macro.f1)),
                interval(f1_intervals(results, dataset, network).macro),
                mean_deviation(mean_and_deviation(fold_f1(results, network))),
            )
        )
    note = (
        "Pooled over the test folds. Accuracy: Wilson interval. F1: percentile bootstrap over poses, which "
        "shrinks to a point where a network makes no error; the Wilson interval does not. Over folds: mean "
        "and sample standard deviation."
    )
    return Table("Summary", columns, tuple(rows), note)


def confusion_table(results: ComparisonResults) -> Table:
    """Table 2: confusion matrices pooled over the folds, with a column for no answer where a method gave none."""
    shown = answers_given(results)
    rows = [
        (network, state, *map(str, counts[: len(shown)]), str(counts.sum()))
        for network in results.networks
        for state, counts in zip(STATES, pooled_confusion(results, network), strict=True)
    ]
    return Table(
        "Table 2. Confusion matrices, summed over the test folds",
        (
            "network",
            "true state",
            *(f"as {answer}" if answer in STATES else "no answer" for answer in shown),
            "total",
        ),
        tuple(rows),
        text_columns=2,
    )


def scores_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Table 3: precision, recall and F1 by network and state, with intervals and the spread over folds."""
    columns = (
        "network",
        "state",
        "precision",
        "precision 95% CI",
        "recall",
        "recall 95% CI",
        "F1",
        "F1 95% CI",
        "F1 over folds",
    )
    rows = []
    for network in results.networks:
        confusion = pooled_confusion(results, network)
        score, intervals = scores(confusion), f1_intervals(results, dataset, network)
        folds = scores(_fold_confusions(results, network)).f1  # (folds, 3)
        for i, state in enumerate(STATES):
            hits = confusion[i, i]
            rows.append(
                (
                    network,
                    state,
                    number(score.precision[i]),
                    interval(wilson_interval(hits, confusion[:, i].sum())),
                    number(score.recall[i]),
                    interval(wilson_interval(hits, confusion[i].sum())),
                    number(score.f1[i]),
                    interval(intervals.per_state[i]),
                    mean_deviation(mean_and_deviation(folds[:, i].tolist())),
                )
            )
        rows.append(
            (
                network,
                "macro",
                number(float(score.macro.precision)),
                UNDEFINED,
                number(float(score.macro.recall)),
                UNDEFINED,
                number(float(score.macro.f1)),
                interval(intervals.macro),
                mean_deviation(mean_and_deviation(fold_f1(results, network))),
            )
        )
    note = (
        "Pooled over the test folds. Precision and recall: Wilson intervals. F1: percentile bootstrap over "
        "poses. Recall = TP / (TP + FN), precision = TP / (TP + FP). "
        f"{UNDEFINED}: undefined, or no interval is given."
    )
    return Table("Table 3. Precision, recall and F1", columns, tuple(rows), note, text_columns=2)


def folds_table(results: ComparisonResults) -> Table:
    """Macro-F1 of each fold, with mean and spread."""
    folds = range(results.comparison.folds)
    rows = []
    for network in results.networks:
        values = fold_f1(results, network)
        by_fold = dict(zip((run.fold for run in results.runs_of(network)), values, strict=True))
        mean, deviation = mean_and_deviation(values)
        cells = [number(by_fold.get(fold, float("nan"))) for fold in folds]
        rows.append((network, *cells, number(mean), number(deviation)))
    return Table(
        "Macro F1 by test fold",
        ("network", *(f"fold {fold}" for fold in folds), "mean", "SD"),
        tuple(rows),
        "SD: sample standard deviation over the finished folds.",
    )


def paired_table(results: ComparisonResults) -> Table:
    """Exact McNemar test of each pair of networks on the samples both were tested on."""
    right = {network: results.pooled(network).right_by_sample for network in results.networks}
    pairs, tests = list(combinations(results.networks, 2)), []
    for first, second in pairs:
        shared = sorted(right[first].keys() & right[second].keys())
        one = np.array([right[first][sample_id] for sample_id in shared], dtype=bool)
        other = np.array([right[second][sample_id] for sample_id in shared], dtype=bool)
        tests.append((len(shared), mcnemar(one, other)))
    adjusted = holm([test.p_value for _, test in tests])
    rows = [
        (
            *pair,
            str(samples),
            str(test.only_first_right),
            str(test.only_second_right),
            p_value(test.p_value),
            p_value(holm_p),
        )
        for pair, (samples, test), holm_p in zip(pairs, tests, adjusted, strict=True)
    ]
    return Table(
        "Paired tests between networks",
        ("first", "second", "samples", "only first right", "only second right", "p", "p (Holm)"),
        tuple(rows),
        "Exact McNemar test on the shared test samples, Holm correction over the pairs. It takes samples as "
        "independent; the states of one pose and neighbouring poses are not, so a small p is optimistic.",
        text_columns=2,
    )

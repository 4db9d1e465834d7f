# SPDX-License-Identifier: Apache-2.0
"""Values of docs/results.md: the paper's comparison, unseen poses, the authors' recipes, points and cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from doorstate.evaluation.calibration import score_calibration
from doorstate.evaluation.method_scores import MACRO, score_states, summarize_methods
from doorstate.evaluation.resolution import score_resolution
from doorstate.evaluation.results import Results
from doorstate.evaluation.study import StudyResults
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    deviation_column,
    interval_column,
    label_column,
    number,
    number_column,
)
from doorstate.pages.colors import STATE_WORDS
from doorstate.training.recipes import AUTHORS
from doorstate.types import STATES

from ..paths import TITLES
from ..published import comparison, study
from .cases import accuracy_by_case, count_error_kinds
from .places import place_cases

TARGET_F1, TARGET_UNSEEN_F1 = 0.995, 0.99  # of every network; of the best one on unseen poses
_PROTOCOLS = ("paper", "by-pose", "by-pose-mirrored")
EXPERIMENTS = (*_PROTOCOLS, "authors", "related")


def method_column(title: str = "network") -> Column:
    """Return the column of methods by their titles; rules keep their names, as code."""
    return Column(title, ("method",), lambda name: TITLES.get(name, f"`{name}`"), is_label=True)


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    paper, by_pose, mirrored = (comparison(name) for name in _PROTOCOLS)
    summaries = {name: summary(comparison(name)) for name in _PROTOCOLS}
    states = score_states(paper)
    scores = states[states["state"] != MACRO][["precision", "recall", "f1"]]
    best = {name: frame.sort_values("f1").iloc[-1] for name, frame in summaries.items()}
    return {
        "best": best,
        "below": [
            TITLES[name]
            for name, f1 in zip(summaries["paper"]["method"], summaries["paper"]["f1"], strict=True)
            if f1 < TARGET_F1
        ],
        "target": TARGET_F1,
        "target_unseen": TARGET_UNSEEN_F1,
        "lowest": float(scores.min().min()),
        "lowest_recall": {state: _lowest_recall(states, state) for state in ("open", "semi_open")},
        "hits": _hits(paper, "pointnet2", "open"),
        "errors": {name: count_error_kinds(comparison(name)) for name in ("paper", "by-pose")},
        "least_validation": min(run.metric("val_macro_f1") for run in by_pose.runs),
        "summary": summary_table(paper).to_markdown(),
        "calibration": calibration_table(paper).to_markdown(),
        "protocols": protocols_table(summaries).to_markdown(),
        "places": places_table(by_pose).to_markdown(),
        "authors": authors_table(comparison("authors"), paper).to_markdown(),
        "points": points_table(study("resolution")).to_markdown(),
        "cost": cost_table([comparison(name) for name in EXPERIMENTS]).to_markdown(),
        "mirrored_folds": mirrored.config.folds,
    }


def summary(results: Results) -> pd.DataFrame:
    """Return `summarize_methods` with the recall of each state."""
    recall = score_states(results).pivot(index="method", columns="state", values="recall")
    return summarize_methods(results).join(recall.add_prefix("recall_"), on="method")


def summary_table(results: Results) -> Table:
    """Build the headline table of a comparison."""
    frame = summary(results)
    columns = (
        method_column("method" if results.rules else "network"),
        count_column("errors"),
        number_column("f1", "macro F1"),
        interval_column("f1", "95 %"),
        deviation_column("f1", "over folds"),
        *(number_column(f"recall_{state}", f"recall {STATE_WORDS[state]}") for state in STATES),
    )
    note = (
        f"{frame['samples'].iloc[0]} test samples, pooled over {results.config.folds} folds. 95 %: bootstrap over "
        "poses. Over folds: mean and standard deviation."
    )
    return Table.from_frame("Scores", frame, columns, note)


def calibration_table(results: Results) -> Table:
    """Build the short table of calibration errors."""
    columns = (
        method_column(),
        deviation_column("temperature", "temperature", 3),
        number_column("ece_raw", "calibration error, raw"),
        number_column("ece_scaled", "scaled"),
    )
    return Table.from_frame("Expected calibration error", score_calibration(results), columns)


def protocols_table(summaries: Mapping[str, pd.DataFrame]) -> Table:
    """Build the table of macro F1 and errors of each network under both protocols."""
    paper, by_pose, mirrored = (summaries[name].set_index("method")[["f1", "errors"]] for name in _PROTOCOLS)
    frame = paper.add_suffix("_paper").join([by_pose.add_suffix("_unseen"), mirrored.add_suffix("_mirrored")])
    columns = (
        method_column(),
        number_column("f1_paper", "macro F1, paper"),
        number_column("f1_unseen", "macro F1, by-pose"),
        number_column("f1_mirrored", "by-pose, mirrored"),
        count_column("errors_paper", "errors, paper"),
        count_column("errors_unseen", "errors, by-pose"),
        count_column("errors_mirrored", "by-pose, mirrored"),
    )
    return Table.from_frame("One recipe, two protocols", frame.reset_index(), columns)


def places_table(by_pose: Results) -> Table:
    """Build the table of accuracy by the places trained around the tested one."""
    frame = accuracy_by_case(by_pose, by_pose.networks, place_cases(by_pose))
    return Table.from_frame("Accuracy by place", frame, case_columns(by_pose.networks))


def case_columns(methods: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of `accuracy_by_case`."""
    titles = (TITLES.get(method, f"`{method}`") for method in methods)
    return (
        label_column("case", "samples"),
        count_column("samples", "number"),
        *(number_column(method, title, 3) for method, title in zip(methods, titles, strict=True)),
    )


def authors_table(authors: Results, common: Results) -> Table:
    """Build the table of the authors' shortened recipes beside the common one, on the same fold."""
    scores = {(run.method, run.fold): run.metric("test_macro_f1") for run in common.runs}
    rows = [
        {
            "method": run.method,
            "epochs": len(run.log),
            "published_epochs": AUTHORS[run.method].epochs,
            "authors": run.metric("test_macro_f1"),
            "common": scores[run.method, run.fold],
        }
        for run in authors.runs
    ]
    columns = (
        method_column(),
        Column(
            "epochs", ("epochs", "published_epochs"), lambda epochs, all_epochs: f"{epochs} of {all_epochs}"
        ),
        number_column("authors", "macro F1, authors' recipe"),
        number_column("common", "macro F1, common recipe"),
    )
    return Table.from_frame("Recipes of the authors", pd.DataFrame(rows), columns)


def points_table(resolution: StudyResults) -> Table:
    """Build the table of macro F1 by number of points, as trained and fine-tuned, and of two latencies."""
    scores = score_resolution(resolution)
    counts = sorted(scores["points"].unique())
    wide = scores.pivot(index="method", columns="points").loc[list(dict.fromkeys(scores["method"]))]
    wide.columns = pd.Index(["-".join(map(str, column)) for column in wide.columns.to_flat_index()])
    columns = (
        method_column(),
        *(Column(f"{points}", (f"as_trained-{points}", f"fine_tuned-{points}"), _pair) for points in counts),
        *(number_column(f"milliseconds-{points}", f"ms, {points}", 1) for points in (1024, 4096)),
    )
    return Table.from_frame("Macro F1 by number of points", wide.reset_index(), columns)


def _pair(as_trained: float, fine_tuned: float) -> str:
    return number(as_trained, 3) + ("" if math.isnan(fine_tuned) else f" / {number(fine_tuned, 3)}")


def cost_table(comparisons: Sequence[Results]) -> Table:
    """Build the table of core hours of each experiment."""
    rows = []
    for results in comparisons:
        trained = [run for run in results.runs if len(run.log)]
        hours = sum(run.metric("seconds") * int(run.environment.get("threads", 1)) for run in trained) / 3600
        rows.append({"experiment": results.config.name, "runs": len(trained), "hours": hours})
    frame = pd.DataFrame(rows)
    total = {"experiment": "all", "runs": frame["runs"].sum(), "hours": frame["hours"].sum()}
    frame = pd.concat([frame, pd.DataFrame([total])], ignore_index=True)
    columns = (
        label_column("experiment"),
        count_column("runs", "trained runs"),
        number_column("hours", "core hours", 1),
    )
    return Table.from_frame("Training cost", frame, columns)


def _lowest_recall(states: pd.DataFrame, state: str) -> tuple[list[str], float]:
    recall = states[states["state"] == state].set_index("method")["recall"]
    return list(recall.index[recall == recall.min()]), float(recall.min())


def _hits(results: Results, method: str, state: str) -> tuple[int, int]:
    tested = results.tested_by(method)
    correct = tested.loc[tested["state"] == state, "correct"]
    return int(correct.sum()), len(correct)

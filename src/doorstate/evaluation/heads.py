# SPDX-License-Identifier: Apache-2.0
"""Errors of further heads: presence of a door, opening angle, hinge side, frame pose, widths, parts of points."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd
from sklearn.metrics import roc_auc_score

from doorstate.evaluation.comparison import KEY_COLUMNS, RULE_COLUMNS, Results
from doorstate.evaluation.manifest import number_column, text_column
from doorstate.evaluation.metrics import ratio
from doorstate.types import DECISION_THRESHOLD, NO_DOOR, STATES, Part

PARTS = tuple(part.name.lower() for part in Part if part != Part.NONE)


def head_rows(results: Results, method: str) -> pd.DataFrame | None:
    """Return the test rows of a network's head outputs, with samples without a door; None if it has no such heads."""
    if method not in results.networks:
        return None
    own = results.frame[(results.frame["method"] == method) & (results.frame["role"] == "test")]
    names = [name for name in results.predictions if name not in KEY_COLUMNS and name not in RULE_COLUMNS]
    columns = [name if name in own else predicted(name) for name in names if name.startswith("p_")]
    columns += [predicted(name) for name in (*names, "opening_angle_deg") if not name.startswith("p_")]
    rows = own[own[columns].notna().any(axis=1)]
    return None if rows["fold"].nunique() < len(results.runs_of(method)) else rows


def predicted(column: str) -> str:
    """Return the column of `Results.frame` with the predicted value of a manifest's column."""
    return f"{column}_predicted"


def head_errors(rows: pd.DataFrame) -> dict[str, float]:
    """Return the errors of the heads of one network; NaN where nothing was predicted or the manifest does not know.

    Args:
        rows: of `head_rows`.

    Returns:
        door_auroc, angle_error_semi_open_deg, angle_error_open_deg (means), hinge_accuracy,
        hinge_accuracy_not_closed, position_error_median_m, position_error_p90_m, yaw_error_median_deg,
        opening_width_error_m and passable_width_error_m (means).
    """

    def error(name: str) -> pd.Series[float]:
        return (number_column(rows, predicted(name)) - number_column(rows, name)).abs()

    def turn(name: str) -> pd.Series[float]:
        difference = number_column(rows, predicted(name)) - number_column(rows, name)
        return ((difference + 180) % 360 - 180).abs()

    state = rows["state"]
    angle = turn("opening_angle_deg")
    hinge = hinge_is_correct(rows)
    position = np.hypot(error("door_x_m"), error("door_y_m"))
    return {
        "door_auroc": _door_auroc(rows),
        "angle_error_semi_open_deg": angle[state == "semi_open"].mean(),
        "angle_error_open_deg": angle[state == "open"].mean(),
        "hinge_accuracy": hinge.mean(),
        "hinge_accuracy_not_closed": hinge[state.isin(["semi_open", "open"])].mean(),
        "position_error_median_m": position.quantile(0.5),
        "position_error_p90_m": position.quantile(0.9),
        "yaw_error_median_deg": turn("door_yaw_deg").quantile(0.5),
        "opening_width_error_m": error("opening_width_m").mean(),
        "passable_width_error_m": error("passable_width_m").mean(),
    }


def hinge_is_correct(rows: pd.DataFrame) -> pd.Series[float]:
    """Return 1 or 0 for each row, NaN where the hinge side is unknown or was not predicted."""
    hinge, p_left = text_column(rows, "hinge"), number_column(rows, "p_hinge_left")
    correct = (p_left >= DECISION_THRESHOLD) == (hinge == "left")
    return correct.astype("float64").where((hinge != "") & p_left.notna())


def score_heads(results: Results) -> pd.DataFrame:
    """Return `head_errors` of every network with further heads: columns method, samples, one an error."""
    rows = [
        {"method": method, "samples": len(outputs), **head_errors(outputs)}
        for method, outputs in _with_heads(results)
    ]
    return pd.DataFrame(rows)


def score_presence(results: Results) -> pd.DataFrame:
    """Count how often a network predicts a door: columns method, door (bool), kind, samples, predicted_door, share."""
    rows = []
    for method, outputs in _with_presence(results):
        kinds = text_column(outputs, "door_kind")
        kinds = kinds.where(kinds != "", text_column(outputs, "scene_kind"))
        is_door, predicted_door = outputs["state"] != NO_DOOR, outputs["p_door"] >= DECISION_THRESHOLD
        for door in (True, False):
            for kind in sorted(set(kinds[is_door == door])):
                chosen = predicted_door[(is_door == door) & (kinds == kind)]
                rows.append((method, door, kind or "unknown", len(chosen), int(chosen.sum()), chosen.mean()))
    columns = ["method", "door", "kind", "samples", "predicted_door", "share"]
    return pd.DataFrame(rows, columns=columns)


def score_four_labels(results: Results) -> pd.DataFrame:
    """Score predictors that name a state or no door; a state counts as predicted if a door is likelier than none.

    Returns:
        Columns method, samples, recall of each state and of `no_door`, their mean, and accuracy.
    """
    rows = []
    for method, outputs in _with_presence(results):
        door = outputs["p_door"] >= DECISION_THRESHOLD
        correct = (door & outputs["correct"]).where(outputs["state"] != NO_DOOR, ~door)
        recall = {state: correct[outputs["state"] == state].mean() for state in (*STATES, NO_DOOR)}
        mean = float(np.mean(list(recall.values())))
        rows.append(
            {"method": method, "samples": len(outputs), **recall, "mean": mean, "accuracy": correct.mean()}
        )
    return pd.DataFrame(rows)


def score_parts(results: Results) -> pd.DataFrame:
    """Return the intersection over union of each part of the scene, points of all folds together, and their mean."""
    rows = []
    for method in results.methods:
        counts = [run.metrics.get("test_part_counts") for run in results.runs_of(method)]
        if not all(counts):
            continue
        joined = np.array(counts).sum(axis=0)  # (parts, parts)
        hits = np.diagonal(joined)
        shares = ratio(hits, joined.sum(axis=0) + joined.sum(axis=1) - hits)
        rows.append(
            {"method": method, **dict(zip(PARTS, shares, strict=True)), "mean": float(np.nanmean(shares))}
        )
    return pd.DataFrame(rows)


def _with_heads(results: Results) -> Iterator[tuple[str, pd.DataFrame]]:
    for method in results.methods:
        rows = head_rows(results, method)
        if rows is not None:
            yield method, rows


def _with_presence(results: Results) -> Iterator[tuple[str, pd.DataFrame]]:
    for method, rows in _with_heads(results):
        if number_column(rows, "p_door").notna().any():
            yield method, rows


def _door_auroc(rows: pd.DataFrame) -> float:
    doors = rows["state"] != NO_DOOR
    if number_column(rows, "p_door").isna().any() or doors.all() or not doors.any():
        return math.nan
    return float(roc_auc_score(doors, rows["p_door"]))

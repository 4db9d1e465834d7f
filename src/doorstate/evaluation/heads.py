# SPDX-License-Identifier: Apache-2.0
"""Errors of the heads besides the state: door, opening angle, hinge side, frame pose, widths, parts of points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from doorstate.dataset.crops import FINDER_SCORE
from doorstate.doorways.candidate_errors import ONE_SIGMA
from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.results import KEY_COLUMNS, RULE_COLUMNS, Results, predicted_column
from doorstate.networks.card import HeadErrors
from doorstate.networks.door_calibration import DoorCalibration
from doorstate.networks.heads import HEADS, POINT_HEADS, head_metrics
from doorstate.training.calibration import fit_door_calibration
from doorstate.types import DECISION_THRESHOLD, NO_DOOR, PARTS, STATES, UNKNOWN_STATE

PART_NAMES = POINT_HEADS[PARTS].classes


def head_rows(results: Results, method: str) -> pd.DataFrame | None:
    """Return the test rows of a network's head outputs, with samples without a door; None if it has no such heads."""
    if method not in results.networks:
        return None
    own = results.joined[(results.joined["method"] == method) & (results.joined["role"] == "test")]
    names = [name for name in map(str, results.predictions) if name not in (*KEY_COLUMNS, *RULE_COLUMNS)]
    columns = [name if name in own else predicted_column(name) for name in names if name.startswith("p_")]
    columns += [predicted_column(name) for name in (*names, "opening_angle_deg") if not name.startswith("p_")]
    rows = own[own[columns].notna().any(axis=1)]
    return None if rows["fold"].nunique() < len(results.runs_of(method)) else rows


def head_errors(rows: pd.DataFrame) -> dict[str, float]:
    """Return the figures of merit of the heads of one network, by the names of `HeadSpec.metrics`.

    A figure is NaN where the network has no such head or the manifest does not record the true values.

    Args:
        rows: result of `head_rows`.
    """
    outputs = {}
    for name in (column for head in HEADS.values() for column in head.column_names):
        own = name if name.startswith("p_") else predicted_column(name)
        if own in rows and rows[own].notna().any():
            outputs[name] = rows[own].to_numpy(dtype=np.float64)
    sources = sorted({column.source for head in HEADS.values() for column in head.columns} & {*rows})
    truth = rows[sources].astype("object")
    records = truth.where(truth.notna(), None).to_dict("records")
    return head_metrics(outputs, [{str(name): value for name, value in row.items()} for row in records])


def standard_errors(results: Results, method: str) -> HeadErrors | None:
    """Return the standard errors of a network's heads: 68 % of the validation doors have smaller ones.

    Returns:
        None without the heads `frame`, `widths` and `angle`, or without their outputs for validation doors.
    """
    own = results.joined
    doors = own[(own["method"] == method) & (own["role"] == "val") & (own["state"] != NO_DOOR)]

    def errors(name: str) -> pd.Series[float]:
        return number_values(doors, predicted_column(name)) - number_values(doors, name)

    def standard(values: pd.Series[float], digits: int) -> float:
        return round(float(values.abs().quantile(ONE_SIGMA)), digits)

    angle_deg = errors("opening_angle_deg").groupby(doors["state"])
    if any(errors(name).isna().all() for name in ("door_x_m", "opening_width_m", "opening_angle_deg")):
        return None
    return HeadErrors(
        along_m=standard(errors("door_x_m"), 4),
        across_m=standard(errors("door_y_m"), 4),
        yaw_deg=standard((errors("door_yaw_deg") + 180) % 360 - 180, 3),
        width_m=standard(errors("opening_width_m"), 4),
        angle_deg={str(state): standard(values, 2) for state, values in angle_deg if values.notna().any()},
    )


def score_heads(results: Results) -> pd.DataFrame:
    """Return `head_errors` of every network with further heads: columns method, samples, one an error."""
    rows = [
        {"method": method, "samples": len(outputs), **head_errors(outputs)}
        for method, outputs in _with_heads(results)
    ]
    return pd.DataFrame(rows)


def door_calibration(results: Results, method: str) -> DoorCalibration | None:
    """Return the probability of a door by network and finder, fitted on validation crops of candidates.

    Returns:
        None for whole clouds, and without the head `door`.
    """
    own = results.joined[(results.joined["method"] == method) & (results.joined["role"] == "val")]
    outputs = [np.asarray(number_values(own, name), np.float64) for name in ("p_door", FINDER_SCORE)]
    if np.isnan(outputs).any():
        return None
    return fit_door_calibration(outputs[0], outputs[1], (own["state"] != NO_DOOR).to_numpy())


def with_finder(rows: pd.DataFrame, calibration: DoorCalibration) -> pd.DataFrame:
    """Return rows of crops whose `p_door` is that of network and finder together."""
    outputs = (np.asarray(number_values(rows, name), np.float64) for name in ("p_door", FINDER_SCORE))
    return rows.assign(p_door=calibration.probabilities(*outputs))


def score_presence(results: Results) -> pd.DataFrame:
    """Count how often a network predicts a door: columns method, door (bool), kind, samples, predicted_door, share."""
    rows = []
    for method, outputs in _with_presence(results):
        kinds = text_values(outputs, "door_kind")
        kinds = kinds.where(kinds != "", text_values(outputs, "scene_kind"))
        is_door, predicted_door = outputs["state"] != NO_DOOR, outputs["p_door"] >= DECISION_THRESHOLD
        for door in (True, False):
            for kind in sorted(set(kinds[is_door == door])):
                chosen = predicted_door[(is_door == door) & (kinds == kind)]
                rows.append((method, door, kind or "unknown", len(chosen), int(chosen.sum()), chosen.mean()))
    columns = ["method", "door", "kind", "samples", "predicted_door", "share"]
    return pd.DataFrame(rows, columns=columns)


def score_four_labels(results: Results) -> pd.DataFrame:
    """Score predictors that name a state or no door; a state counts as predicted if a door is likelier than none.

    Doors of unknown state are left out.

    Returns:
        Columns method, samples, recall of each state and of `no_door`, their mean, and accuracy.
    """
    rows = []
    for method, outputs in _with_presence(results):
        outputs = outputs[outputs["state"] != UNKNOWN_STATE]
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
        shares = POINT_HEADS[PARTS].metric(joined)
        rows.append(
            {
                "method": method,
                **dict(zip(PART_NAMES, shares, strict=True)),
                "mean": float(np.nanmean(shares)),
            }
        )
    return pd.DataFrame(rows)


def _with_heads(results: Results) -> Iterator[tuple[str, pd.DataFrame]]:
    for method in results.methods:
        rows = head_rows(results, method)
        if rows is not None:
            yield method, rows


def _with_presence(results: Results) -> Iterator[tuple[str, pd.DataFrame]]:
    for method, rows in _with_heads(results):
        if number_values(rows, "p_door").notna().any():
            yield method, rows

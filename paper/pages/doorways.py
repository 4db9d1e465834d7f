# SPDX-License-Identifier: Apache-2.0
"""Values of docs/doorways.md: states and places of doors in crops, by kind of room and sensor."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from doorstate.dataset.crops import FINDER_SCORE
from doorstate.evaluation.factors import preset_of
from doorstate.evaluation.heads import head_errors, head_rows, with_finder
from doorstate.evaluation.method_scores import summarize_methods
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.results import Results, RunRecord, predicted_column
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number,
    number_column,
)
from doorstate.inference.pose_errors import Correction, weigh_correction
from doorstate.networks.card import WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.packaged import packaged_weights
from doorstate.types import NO_DOOR

from ..published import comparison
from .results import method_column
from .targets import TARGET_COLUMNS, seen_by_xtion

WEIGHTS = "doorways-longer"  # experiment of the default weights
RULES = "doorways-rules"
NETWORK = "pointnet2"
PROTOCOLS = ("paper", "by-pose")  # of `ogurob`, with crops too
_POSE = ("door_x_m", "door_y_m", "door_yaw_deg", "opening_width_m")


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    results, card = comparison(WEIGHTS), read_card(packaged_weights(NETWORK))
    run, crops = results.runs_of(NETWORK)[0], tested_crops(results, card)
    return {
        "trained": int(run.metric("train_samples")),
        "protocols": protocols_table(PROTOCOLS).to_markdown(),
        "targets": targets_table(results, crops).to_markdown(),
        "sources": sources_table(results, crops).to_markdown(),
        "rules": rules_table(results, comparison(RULES)).to_markdown(),
    }


def protocols_table(protocols: Sequence[str]) -> Table:
    """Build the table of macro F1 with crops and with whole clouds, of the folds that are finished with crops."""
    lines = []
    for network in comparison(protocols[0]).networks:
        line: dict[str, Any] = {"method": network}
        for protocol in protocols:
            crops = comparison(f"doorways-{protocol}").runs_of(network)
            whole = [run for run in comparison(protocol).runs_of(network) if run.fold < len(crops)]
            line |= {f"{protocol}_crop": _mean_f1(crops), f"{protocol}_whole": _mean_f1(whole)}
            line[f"{protocol}_folds"] = len(crops)
        lines.append(line)
    columns = [method_column()]
    for protocol in protocols:
        columns += [
            count_column(f"{protocol}_folds", "folds"),
            number_column(f"{protocol}_whole", f"`{protocol}`, whole"),
            number_column(f"{protocol}_crop", "crop"),
        ]
    return Table.from_frame("Macro F1 of whole clouds and of crops", pd.DataFrame(lines), columns)


def _mean_f1(runs: Sequence[RunRecord]) -> float:
    return float(np.mean([run.metric("test_macro_f1") for run in runs])) if runs else math.nan


def tested_crops(results: Results, card: WeightsCard) -> pd.DataFrame:
    """Return the tested crops, with the probability of a door and the error of its place as a predictor has them.

    Columns of the result besides those of `head_rows`: `preset`, `p_door` by network and finder, and of doors
    `finder_error_m` and `error_m`, the distance of candidate and corrected candidate to the door.
    """
    rows = head_rows(results, NETWORK)
    assert rows is not None
    assert card.door_calibration is not None
    return with_finder(rows, card.door_calibration).assign(
        preset=preset_of(rows),
        finder_error_m=np.hypot(rows["door_x_m"], rows["door_y_m"]),
        error_m=[_error_m(row, card) for row in rows.to_dict("records")],
    )


def _error_m(row: Mapping[Hashable, Any], card: WeightsCard) -> float:
    """Return the distance of a corrected candidate to the door of its crop; NaN without one."""
    own = [float(row[predicted_column(name)]) for name in _POSE]
    own[3] -= float(row["doorway_width_m"])
    along_m, across_m, *_ = weigh_correction(
        Correction(*own), float(row[FINDER_SCORE]), card.errors
    ).correction
    return float(np.hypot(along_m - row["door_x_m"], across_m - row["door_y_m"]))


def targets_table(results: Results, crops: pd.DataFrame) -> Table:
    """Build the table of targets and of the values that are reached."""
    doors = crops["state"] != NO_DOOR
    heads = head_errors(crops)
    tested = results.tested_by(NETWORK)
    xtion = tested[seen_by_xtion(tested)]
    lines = [
        ("macro F1", "`varied` doors seen by an Xtion", len(xtion), 0.94, False, macro_f1(xtion), 4),
        ("AUROC of a door, with the finder", "all crops", len(crops), 0.985, False, heads["door_auroc"], 4),
        ("place, median error, cm", "doors", doors.sum(), 5, True, 100 * crops["error_m"].median(), 1),
        ("yaw, median error, °", "doors", doors.sum(), 1.2, True, heads["frame_yaw_error_median_deg"], 1),
        (
            "opening angle, mean error, °",
            "semi-open hinged doors",
            int(((crops["state"] == "semi_open") & crops["opening_angle_deg"].notna()).sum()),
            6,
            True,
            heads["angle_error_semi_open_deg"],
            1,
        ),
    ]
    columns = ("metric", "samples", "count", "bound", "at_most", "value", "digits")
    return Table.from_frame(
        "Targets",
        pd.DataFrame(lines, columns=columns),
        (*TARGET_COLUMNS, Column("reached", ("value", "digits"), number)),
    )


def sources_table(results: Results, crops: pd.DataFrame) -> Table:
    """Build the table of scores by preset and sensor."""
    tested = results.tested_by(NETWORK)
    lines = []
    for (preset, sensor), rows in crops.groupby(["preset", "sensor"], sort=False):
        doors = tested[tested["sample_id"].isin(rows["sample_id"])]
        lines.append(
            {
                "preset": preset,
                "sensor": sensor,
                "crops": len(rows),
                "doors": len(doors),
                "f1": macro_f1(doors) if len(doors) else np.nan,
                "finder_cm": 100 * rows["finder_error_m"].median(),
                "both_cm": 100 * rows["error_m"].median(),
            }
            | head_errors(rows)
        )
    return Table.from_frame(
        "Crops by kind of room and sensor",
        pd.DataFrame(lines),
        (
            label_column("preset"),
            label_column("sensor"),
            count_column("crops"),
            count_column("doors"),
            number_column("f1", "macro F1", 3),
            number_column("door_auroc", "AUROC of a door", 3),
            number_column("angle_error_semi_open_deg", "angle, semi-open, °", 1),
            number_column("finder_cm", "place by the finder, cm", 1),
            number_column("both_cm", "by both, cm", 1),
        ),
        "Median errors of the place, mean ones of the angle. An AUROC needs crops with a door and without.",
    )


def rules_table(results: Results, rules: Results) -> Table:
    """Build the table of the network and of rules that see the same crops."""
    frame = pd.concat([summarize_methods(results), summarize_methods(rules)], ignore_index=True)
    columns = (
        method_column("method"),
        count_column("samples", "doors"),
        count_column("errors"),
        number_column("f1", "macro F1"),
        interval_column("f1", "95 %"),
    )
    return Table.from_frame("The same doors by rules", frame, columns, "An abstention counts as wrong.")

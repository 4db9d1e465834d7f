# SPDX-License-Identifier: Apache-2.0
"""Values of docs/generalization.md: many doors, noise, clutter, bare walls, and how far weights transfer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from doorstate.evaluation.factors import ANGLE, OCCLUSION, score_factors
from doorstate.evaluation.heads import score_four_labels, score_heads, score_presence
from doorstate.evaluation.method_scores import summarize_methods
from doorstate.evaluation.results import Results
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number,
    number_column,
)
from doorstate.evaluation.transfer import score_transfer, transfer_grid
from doorstate.evaluation.undecidable import decidable_accuracy

from ..definition import read_definition
from ..paths import TITLES
from ..published import comparison, study
from .cases import MIXTURE_CASES, accuracy_by_case
from .results import case_columns, method_column, points_table
from .targets import MIXTURE, targets_table


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    results = comparison(MIXTURE)
    transfer = study("transfer")
    cases = accuracy_by_case(results, results.methods, MIXTURE_CASES)
    untrained = [
        TITLES[name] for name in results.networks if not results.config.recipe[name].get("epochs", 1)
    ]
    undecidable = decidable_accuracy(results).set_index("method")
    return {
        "trained": max(int(run.metric("train_samples")) for run in results.runs if len(run.log)),
        "untrained": untrained,
        "targets": targets_table(results.networks).to_markdown(),
        "summary": summary_table(results).to_markdown(),
        "undecidable": undecidable.loc["pointnet2"],
        "heads": heads_table(results).to_markdown(),
        "presence": presence_table(results).to_markdown(),
        "rules": results.rules,
        "cases": Table.from_frame(
            "Accuracy by case", cases, case_columns(results.methods), "An abstention counts as wrong."
        ).to_markdown(),
        "rule_ahead": list(
            cases.loc[
                cases[list(results.rules)].max(axis=1) > cases[list(results.networks)].max(axis=1), "case"
            ]
        ),
        "points": points_table(study("mixture-points")).to_markdown(),
        "transfer": transfer_table("transfer").to_markdown(),
        "by_angle": factor_table(transfer.parts["mixture/angles"], ANGLE).to_markdown(),
        "by_occlusion": factor_table(transfer.parts["mixture/cluttered"], OCCLUSION).to_markdown(),
        "augmentation": transfer_table("augmentation").to_markdown(),
    }


def summary_table(results: Results) -> Table:
    """Build the headline table: states of doors, and states or no door."""
    four = score_four_labels(results).set_index("method")
    frame = summarize_methods(results).join(four[["no_door", "mean"]], on="method")
    columns = (
        method_column("method"),
        count_column("errors"),
        number_column("f1", "macro F1"),
        interval_column("f1", "95 %"),
        number_column("mean", "mean recall, four labels"),
        number_column("no_door", "recall of no door"),
    )
    note = (
        f"{frame['samples'].iloc[0]} doors. Four labels: the three states and no door, on all samples; a state counts "
        "if a door is likelier than none."
    )
    return Table.from_frame("Scores on scenes never seen", frame, columns, note)


def heads_table(results: Results) -> Table:
    """Build the short table of errors of the other heads."""
    columns = (
        method_column(),
        number_column("door_auroc", "door, AUROC"),
        number_column("angle_error_semi_open_deg", "opening angle, semi-open, °", 1),
        number_column("hinge_accuracy", "hinge side correct", 3),
        number_column("frame_position_error_median_m", "frame position, m", 3),
        number_column("frame_yaw_error_median_deg", "yaw, °", 1),
        number_column("passable_width_error_m", "passable width, m", 3),
    )
    note = "Angle and width: mean error. Position and yaw: median error."
    return Table.from_frame("Outputs besides the state", score_heads(results), columns, note)


def presence_table(results: Results) -> Table:
    """Build the table of scenes without a door that are taken for one, by kind."""
    frame = score_presence(results)
    without = frame[~frame["door"].astype(bool)]
    wide = without.pivot(index="kind", columns="method", values="share").reset_index()
    samples = without.drop_duplicates("kind").set_index("kind")["samples"]
    wide = wide.assign(samples=wide["kind"].map(samples), kind=wide["kind"].str.replace("_", " "))
    networks = [name for name in results.networks if name in wide]
    columns = (
        label_column("kind", "scene"),
        count_column("samples"),
        *(number_column(name, TITLES[name], 2) for name in networks),
    )
    return Table.from_frame("Share of scenes without a door that are taken for one", wide, columns)


def transfer_table(name: str) -> Table:
    """Build the table of macro F1 by training and test set of a transfer study of one network."""
    content = read_definition(name).content
    scores = score_transfer(study(name), list(content["trained"]), list(content["tested"]))
    columns = (
        label_column("trained", "trained on"),
        *(number_column(tested, tested, 3) for tested in content["tested"]),
    )
    return Table.from_frame("Macro F1 by training and test set", transfer_grid(scores), columns)


def factor_table(results: Results, factor: str) -> Table:
    """Build the table of accuracy by one factor, a column for each bin."""
    bins = score_factors(results)
    bins = bins[bins["factor"] == factor]
    titles = [f"{low:g}–{high:g}" for low, high in zip(bins["low"], bins["high"], strict=True)]
    rows = [
        {"quantity": name, "digits": digits, **dict(zip(titles, bins[name], strict=True))}
        for name, digits in (("samples", 0), ("accuracy", 2))
    ]
    columns = (
        label_column("quantity", factor),
        *(Column(title, (title, "digits"), number) for title in titles),
    )
    return Table.from_frame(f"Accuracy by {factor}", pd.DataFrame(rows), columns)

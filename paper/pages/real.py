# SPDX-License-Identifier: Apache-2.0
"""Values of docs/real.md: networks and rules on recorded frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from doorstate._documents import read_json
from doorstate.evaluation.frame_scores import score_frames
from doorstate.evaluation.results import PROBABILITY_COLUMNS
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number_column,
)
from doorstate.pages.colors import STATE_WORDS
from doorstate.types import ABSTAINED, STATES

from ..paths import RESULTS

FOLDER = RESULTS / "real"


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    experiment = read_json(FOLDER / "experiment.json")
    predictions = read_frames()
    scores = summarize_frames(predictions)
    return {
        "command": experiment["command"],
        "newest": experiment["weights"][0],
        "scores": scores_table(scores, experiment["weights"]).to_markdown(),
        "confusion": confusion_table(predictions, experiment["weights"][0]["experiment"]).to_markdown(),
        "doors": int(scores["frames"].iloc[0]),
    }


def read_frames() -> pd.DataFrame:
    """Read the predictions on recorded frames: one row for each method and frame.

    `method` is a rule, or the experiment that trained the PointNet++; frames of one `door` depend on each other.
    """
    frame = pd.read_csv(FOLDER / "predictions.csv.gz", keep_default_na=False, na_values=[""])
    return frame.assign(correct=frame["predicted"] == frame["state"])


def summarize_frames(predictions: pd.DataFrame) -> pd.DataFrame:
    """Score each method on frames with a door.

    Returns:
        Columns of `FrameScores.scores`, wrong, likeliest (frames whose most probable state is correct; NaN for rules),
        and named (frames without a door that are given a state).
    """
    scores = score_frames(predictions, predictions["door"], {})
    rows = predictions.assign(
        likeliest=np.array(STATES)[predictions[list(PROBABILITY_COLUMNS)].to_numpy().argmax(axis=1)]
        == predictions["state"]
    )
    likeliest = rows[rows["state"].isin(STATES)].groupby("method")["likeliest"].sum()
    networks = rows.loc[rows["p_door"].notna(), "method"].unique()
    without = scores.without_door[scores.without_door["label"] == "no_door"].set_index("method")
    table = scores.scores
    return table.assign(
        wrong=table["frames"] - table["correct"] - table["abstained"],
        likeliest=table["method"].map(likeliest.reindex(networks)),
        named=table["method"].map(without["predicted_states"]),
    )


def scores_table(scores: pd.DataFrame, weights: list[Mapping[str, Any]]) -> Table:
    """Build the table of scores; PointNet++ is listed by the experiment of its weights."""
    titles = {entry["experiment"]: f"PointNet++, `{entry['experiment']}`" for entry in weights}

    def title(name: str) -> str:
        return titles.get(name, name if " " in name else f"`{name}`")

    columns = (
        Column("method", ("method",), title, is_label=True),
        count_column("correct"),
        count_column("wrong"),
        count_column("abstained"),
        number_column("accuracy", digits=2),
        interval_column("accuracy", "95 %", 2),
        interval_column("accuracy_grouped", "95 %, a door as one", 2),
        number_column("f1", "macro F1", 2),
        count_column("likeliest", "most probable state correct"),
        count_column("named", "no door, state given"),
    )
    note = (
        f"{scores['frames'].iloc[0]} frames with a door. 95 %: Wilson, as if frames were independent; *a door as one*: "
        "as if all frames of a door were one frame. The truth lies between."
    )
    return Table.from_frame("Recorded frames", scores, columns, note)


def confusion_table(predictions: pd.DataFrame, method: str) -> Table:
    """Build the confusion matrix of one method."""
    own = predictions[(predictions["method"] == method) & predictions["state"].isin([*STATES, "no_door"])]
    counts = pd.crosstab(own["state"], own["predicted"]).reindex(
        index=[*STATES, "no_door"], columns=[*STATES, ABSTAINED], fill_value=0
    )
    columns = (
        label_column("state", "true state"),
        *(count_column(name, STATE_WORDS[name]) for name in counts.columns),
    )
    return Table.from_frame("PointNet++, newest weights", counts.reset_index(), columns)

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
    own = predictions[predictions["method"] == experiment["network"]]
    return {
        "experiment": experiment,
        "readable": len(own),
        "sensors": own["sensor"].nunique(),
        "by_state": own["state"].value_counts().to_dict(),
        "scores": scores_table(scores).to_markdown(),
        "confusion": confusion_table(predictions, experiment["network"]).to_markdown(),
        "doors": int(scores["frames"].iloc[0]),
    }


def read_frames() -> pd.DataFrame:
    """Read the predictions on recorded frames: one row for each method and frame.

    Frames of one `door` depend on each other; frames without one are each a door of their own.
    """
    frame = pd.read_csv(FOLDER / "predictions.csv.gz", keep_default_na=False, na_values=[""])
    door = frame["door"].where(frame["door"].notna(), "/" + frame["sample_id"])
    return frame.assign(correct=frame["predicted"] == frame["state"], door=door)


def summarize_frames(predictions: pd.DataFrame) -> pd.DataFrame:
    """Score each method on frames with a door.

    Returns:
        Columns of `FrameScores.scores`, wrong, likeliest (frames whose most probable state is correct; NaN for rules),
        and named (frames without a door that are given a state).
    """
    scores = score_frames(predictions, predictions["door"], {})
    rows = predictions.assign(
        likeliest=np.array(STATES)[
            predictions[list(PROBABILITY_COLUMNS)].fillna(-1.0).to_numpy().argmax(axis=1)
        ]
        == predictions["state"]
    )
    evaluated = rows["p_closed"].notna() & rows["state"].isin(STATES)
    likeliest = rows[evaluated].groupby("method")["likeliest"].sum()
    networks = rows.loc[rows["p_door"].notna(), "method"].unique()
    without = scores.without_door[scores.without_door["label"] == "no_door"].set_index("method")
    table = scores.scores
    return table.assign(
        wrong=table["frames"] - table["correct"] - table["abstained"],
        likeliest=table["method"].map(likeliest.reindex(networks)),
        named=table["method"].map(without["predicted_states"]),
    )


def scores_table(scores: pd.DataFrame) -> Table:
    """Build the table of scores, of the default network and the rules."""

    def title(name: str) -> str:
        return name if " " in name else f"`{name}`"

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


def summary_table(scores: pd.DataFrame) -> Table:
    """Build the short table of the README."""
    columns = (
        Column("method", ("method",), lambda name: name if " " in name else f"`{name}`", is_label=True),
        count_column("correct", "right"),
        count_column("wrong"),
        count_column("abstained", "no answer"),
        count_column("named", "no door, yet an answer"),
    )
    return Table.from_frame("Recorded frames", scores, columns)


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
    return Table.from_frame("Predictions of the default network", counts.reset_index(), columns)

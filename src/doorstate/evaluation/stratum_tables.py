# SPDX-License-Identifier: Apache-2.0
"""Tables by distance band and angle region (the paper's Tables 1 and 4 to 6), and of undecidable frames."""

from __future__ import annotations

import math

import pandas as pd

from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import ALL, STRATUM_BANDS, count_samples, has_strata, score_strata
from doorstate.evaluation.table import (
    UNDEFINED,
    Column,
    Table,
    count_column,
    label_column,
    number,
    number_column,
)
from doorstate.evaluation.undecidable import (
    count_undecidable,
    decidable_accuracy,
    decidable_ceiling,
    records_twins,
)

NO_STRATA = "This data set records no distance bands or angle regions."
NO_TWINS = "This data set does not record which frames look the same in another state."

_BAND_TITLES = {band: f"{band.replace('-', '–')} m" if band != ALL else "all" for band in STRATUM_BANDS}
_REGION = Column(
    "region",
    ("region",),
    lambda name: "{} {}–{}°".format(name, *REGIONS[name]) if name in REGIONS else name,
    is_label=True,
)
_METRICS = {
    "recall": ("recall", "state_samples"),
    "precision": ("precision", "predicted_samples"),
    "F1": ("f1", None),
}
"""Rows of a method in Tables 4 to 6: a column of `score_strata`, and the one with what it is a share of."""


def dataset_tables(manifest: pd.DataFrame) -> dict[str, Table]:
    """Build the tables that need no predictions, by the name of their files."""
    return {"table1_samples": samples_table(manifest), "undecidable_frames": undecidable_table(manifest)}


def samples_table(manifest: pd.DataFrame) -> Table:
    """Build Table 1: samples by state, angle region and distance band."""
    recorded = has_strata(manifest)
    frame = count_samples(manifest) if recorded else pd.DataFrame()
    outside = len(manifest) - int(frame[ALL].iloc[-1]) if recorded else 0
    note = f"{outside} samples lie outside these strata." if outside else ""
    titles = {**_BAND_TITLES, ALL: "total"}
    return Table.from_frame(
        "Table 1. Samples by state, angle region and distance to the door",
        frame,
        (label_column("state"), _REGION, *(count_column(band, title) for band, title in titles.items())),
        note if recorded else NO_STRATA,
    )


def state_table(results: Results, state: str, ordinal: int) -> Table:
    """Build Tables 4 to 6: recall, precision and F1 of one state by method, angle region and distance band."""
    recorded = has_strata(results.manifest)
    note = (
        "Recall: share (and count) of the state's samples in the stratum that were recognised. Precision: "
        f"share of the stratum's samples predicted {state} that are. {UNDEFINED}: no such sample."
    )
    return Table.from_frame(
        f"Table {ordinal}. {state.replace('_', '-').capitalize()} doors by angle region and distance",
        _by_band(score_strata(results, state)) if recorded else pd.DataFrame(),
        (
            label_column("method"),
            label_column("metric"),
            _REGION,
            *(_share_column(band, title) for band, title in _BAND_TITLES.items()),
        ),
        note if recorded else NO_STRATA,
    )


def _by_band(scores: pd.DataFrame) -> pd.DataFrame:
    """Lay out `score_strata` as the table: rows method, metric, region; a value, hits and total for each band."""
    rows = []
    for method, of_method in scores.groupby("method", sort=False):
        for metric, (name, total) in _METRICS.items():
            for region, bands in of_method.groupby("region", sort=False):
                row: dict[str, object] = {"method": method, "metric": metric, "region": region}
                for cell in bands.to_dict("records"):
                    band = cell["band"]
                    row[band] = cell[name]
                    row[f"{band}_hits"] = math.nan if total is None else cell["hits"]
                    row[f"{band}_total"] = math.nan if total is None else cell[total]
                rows.append(row)
    return pd.DataFrame(rows)


def _share_column(band: str, title: str) -> Column:
    return Column(title, (band, f"{band}_hits", f"{band}_total"), _share, is_shaded=True)


def _share(value: float, hits: float, total: float) -> str:
    text = number(value, 3)
    return text if math.isnan(total) or math.isnan(value) else f"{text} ({hits:.0f}/{total:.0f})"


def undecidable_table(manifest: pd.DataFrame) -> Table:
    """Build the table of frames that another state of the same pose repeats."""
    recorded = records_twins(manifest)
    ceiling = number(decidable_ceiling(manifest)) if recorded else ""
    return Table.from_frame(
        "Undecidable frames: another state of the same pose gives the same image",
        count_undecidable(manifest) if recorded else pd.DataFrame(),
        (
            label_column("state"),
            count_column("samples"),
            count_column("undecidable"),
            number_column("share"),
        ),
        f"No single method can be correct on more than {ceiling} of all samples." if recorded else NO_TWINS,
    )


def decidable_table(results: Results) -> Table:
    """Build the table of accuracy with and without undecidable frames, beside the ceiling they put on it."""
    recorded = records_twins(results.manifest)
    return Table.from_frame(
        "Accuracy with and without the undecidable frames",
        decidable_accuracy(results) if recorded else pd.DataFrame(),
        (
            label_column("method"),
            *(number_column(name) for name in ("all", "decidable", "undecidable", "ceiling")),
        ),
        "The ceiling holds for one fixed method. Under cross-validation two equal images can fall into "
        "different folds, where differently trained networks predict."
        if recorded
        else NO_TWINS,
    )

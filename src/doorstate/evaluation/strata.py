# SPDX-License-Identifier: Apache-2.0
"""Samples and scores by the paper's strata: angle region and distance band."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from doorstate.dataset.strata import BANDS, REGIONS
from doorstate.evaluation.manifest import text_values
from doorstate.evaluation.metrics import confusion_cells, label_codes, precision_recall_f1
from doorstate.evaluation.results import Results
from doorstate.types import LABELS, PREDICTED_LABELS, STATES, Indices

ALL = "all"
STRATUM_BANDS, STRATUM_REGIONS = (*BANDS, ALL), (*REGIONS, ALL)
"""Distance bands and angle regions, each with the sum over them."""


def has_strata(manifest: pd.DataFrame) -> bool:
    """Return True if at least one sample lies in a known band and region."""
    return bool(_in_strata(manifest).any())


def count_samples(manifest: pd.DataFrame) -> pd.DataFrame:
    """Count samples by state, region and distance band, with sums in rows and columns named `all`.

    Returns:
        Columns state, region, one a band, all.
    """
    present = set(manifest["state"])
    states = [label for label in LABELS if label in STATES or label in present]
    codes = label_codes(manifest["state"], states)
    grid = _with_sums(_count(manifest, codes, len(states)))
    grid = np.concatenate([grid, grid.sum(axis=-1, keepdims=True)], axis=-1)  # (6, 5, states + 1)
    rows = [
        {"state": state, "region": region, **dict(zip(STRATUM_BANDS, counts, strict=True))}
        for state, regions in zip([*states, ALL], np.moveaxis(grid, -1, 0), strict=True)
        for region, counts in zip(STRATUM_REGIONS, regions, strict=True)
    ]
    return pd.DataFrame(rows)


def score_strata(results: Results, state: str) -> pd.DataFrame:
    """Score one state in every stratum.

    Returns:
        Columns method, region, band, hits, state_samples, predicted_samples, recall, precision, f1.
    """
    index = STATES.index(state)
    parts = []
    for method in results.methods:
        tested = results.tested_by(method)
        cells = _with_sums(_count(tested, confusion_cells(tested), len(STATES) * len(PREDICTED_LABELS)))
        counts = cells.reshape(-1, len(STATES), len(PREDICTED_LABELS))  # (30, 3, 4)
        score = precision_recall_f1(counts)
        columns = {
            "region": np.repeat(STRATUM_REGIONS, len(STRATUM_BANDS)),
            "band": np.tile(STRATUM_BANDS, len(STRATUM_REGIONS)),
            "hits": counts[:, index, index],
            "state_samples": counts[:, index, :].sum(axis=-1),
            "predicted_samples": counts[:, :, index].sum(axis=-1),
            "recall": score.recall[:, index],
            "precision": score.precision[:, index],
            "f1": score.f1[:, index],
        }
        parts.append(pd.DataFrame({"method": method, **columns}))
    return pd.concat(parts, ignore_index=True)


def _in_strata(frame: pd.DataFrame) -> pd.Series[bool]:
    return text_values(frame, "region").isin(list(REGIONS)) & text_values(frame, "distance_band").isin(BANDS)


def _count(frame: pd.DataFrame, codes: ArrayLike, num_codes: int) -> Indices:
    """Count N rows by region, band and code (an integer each); rows outside the strata are left out."""
    inside = _in_strata(frame).to_numpy()
    counts = np.zeros((len(REGIONS), len(BANDS), num_codes), dtype=np.int64)
    region = label_codes(frame["region"][inside], list(REGIONS))
    band = label_codes(frame["distance_band"][inside], BANDS)
    np.add.at(counts, (region, band, np.asarray(codes)[inside]), 1)
    return counts


def _with_sums(counts: Indices) -> Indices:
    """Append the sums over regions and over bands: (5, 4, K) to (6, 5, K)."""
    counts = np.concatenate([counts, counts.sum(axis=0, keepdims=True)], axis=0)
    return np.concatenate([counts, counts.sum(axis=1, keepdims=True)], axis=1)

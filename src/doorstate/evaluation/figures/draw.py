# SPDX-License-Identifier: Apache-2.0
"""Every figure of a comparison or data set by name, drawn where its data allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.figures.encode import encode_figure
from doorstate.evaluation.figures.errors import common_errors_figure, surest_errors_figure
from doorstate.evaluation.figures.factors import factors_figure
from doorstate.evaluation.figures.learning import learning_figure
from doorstate.evaluation.figures.poses import errors_figure, poses_figure
from doorstate.evaluation.figures.reliability import reliability_figure
from doorstate.evaluation.figures.samples import samples_figure
from doorstate.evaluation.figures.scores import confusion_figure, spread_figure
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.results import Results

DATASET_FIGURES: Mapping[str, Callable[[PreparedDataset], Figure | None]] = {
    "figure2_samples": samples_figure,
    "figure1_poses": lambda dataset: poses_figure(manifest_frame(dataset.rows)),
}
"""Figures that need no results."""
COMPARISON_FIGURES: Mapping[str, Callable[[Results, PreparedDataset], Figure | None]] = {
    "figure3_misclassified": surest_errors_figure,
    "figure4_missed_by_most": common_errors_figure,
    "learning_curves": lambda results, _: learning_figure(results),
    "reliability": lambda results, _: reliability_figure(results),
    "errors_in_plan": lambda results, _: errors_figure(results),
    "confusion": lambda results, _: confusion_figure(results),
    "factors": lambda results, _: factors_figure(results),
    "spread": lambda results, _: spread_figure(results),
}


def draw_dataset_figure(dataset: PreparedDataset, name: str) -> bytes | None:
    """Draw one of `DATASET_FIGURES` as a PNG; None where its data are missing."""
    return _encode(name, DATASET_FIGURES[name](dataset))


def draw_figure(results: Results, dataset: PreparedDataset, name: str) -> bytes | None:
    """Draw one of `DATASET_FIGURES` or `COMPARISON_FIGURES` as a PNG; None where its data are missing."""
    if name in DATASET_FIGURES:
        return draw_dataset_figure(dataset, name)
    return _encode(name, COMPARISON_FIGURES[name](results, dataset))


def _encode(name: str, figure: Figure | None) -> bytes | None:
    return None if figure is None else encode_figure(name, figure)

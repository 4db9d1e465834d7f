# SPDX-License-Identifier: Apache-2.0
"""Draw every figure of a comparison or data set that its data allow."""

from __future__ import annotations

from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.figures.encode import encode_figures
from doorstate.evaluation.figures.errors import common_errors_figure, surest_errors_figure
from doorstate.evaluation.figures.factors import factors_figure
from doorstate.evaluation.figures.learning import learning_figure
from doorstate.evaluation.figures.poses import errors_figure, poses_figure
from doorstate.evaluation.figures.reliability import reliability_figure
from doorstate.evaluation.figures.samples import samples_figure
from doorstate.evaluation.figures.scores import confusion_figure, spread_figure
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.results import Results


def draw_figures(results: Results, dataset: PreparedDataset) -> dict[str, bytes]:
    """Draw every figure as a PNG, by the name of its file.

    Args:
        results: a checked comparison.
        dataset: data set of the comparison.
    """
    figures: dict[str, Figure | None] = {
        "confusion": confusion_figure(results),
        "spread": spread_figure(results),
        "learning_curves": learning_figure(results),
        "reliability": reliability_figure(results),
        "figure3_misclassified": surest_errors_figure(results, dataset),
        "figure4_missed_by_most": common_errors_figure(results, dataset),
        "errors_in_plan": errors_figure(results),
        "factors": factors_figure(results),
    }
    return draw_dataset_figures(dataset) | encode_figures(figures)


def draw_dataset_figures(dataset: PreparedDataset) -> dict[str, bytes]:
    """Draw Figures 1 and 2, which need no results, as far as the data set has poses."""
    return encode_figures(
        {
            "figure1_poses": poses_figure(manifest_frame(dataset.rows)),
            "figure2_samples": samples_figure(dataset),
        }
    )

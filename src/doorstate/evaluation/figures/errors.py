# SPDX-License-Identifier: Apache-2.0
"""Misclassified samples as pictures and clouds (the paper's Figures 3 and 4)."""

from __future__ import annotations

import textwrap
from collections import defaultdict
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.detections import draw_detections
from doorstate.evaluation.gallery import order_of_errors
from doorstate.evaluation.results import ComparisonResults, ErrorRow
from doorstate.evaluation.samples_figure import draw_cloud, part_legend
from doorstate.evaluation.views import STATE_WORDS, picture_axes

_COLUMNS = 5
_TITLE_LETTERS = 40  # of a line as wide as a picture


def surest_errors_figure(results: ComparisonResults, dataset: PreparedDataset) -> Figure | None:
    """Figure 3: a line for each network with the errors it was surest of; None without errors."""
    by_network = defaultdict(list)
    for error in sorted(results.error_rows, key=order_of_errors(dataset)):
        by_network[error.network].append(error)
    lines = [(network, by_network[network][:_COLUMNS]) for network in results.networks if by_network[network]]
    if not lines:
        return None
    figure, axes = _grid(len(lines))
    for line, (network, errors) in enumerate(lines):
        axes[2 * line][0].set_ylabel(f"{network}\n{len(by_network[network])} errors", fontsize=10)
        for column, error in enumerate(errors):
            title = f"{STATE_WORDS[error.state]} as {STATE_WORDS[error.predicted]}, {error.confidence:.2f}"
            _draw(axes[2 * line][column], axes[2 * line + 1][column], dataset, error, title)
            draw_detections(axes[2 * line + 1][column], results.shapes(network, error.sample_id))
    part_legend(figure, dataset, [dataset.index_of(e.sample_id) for _, errors in lines for e in errors])
    return figure


def common_errors_figure(results: ComparisonResults, dataset: PreparedDataset) -> Figure | None:
    """Figure 4: the samples that most networks missed, at least two; None where there are none."""
    by_sample: dict[str, list[ErrorRow]] = defaultdict(list)
    for error in results.error_rows:
        by_sample[error.sample_id].append(error)
    shared = sorted((e for e in by_sample.values() if len(e) > 1), key=lambda e: (-len(e), e[0].sample_id))
    shown = shared[: 2 * _COLUMNS]
    if not shown:
        return None
    figure, axes = _grid(-(-len(shown) // _COLUMNS))
    for place, errors in enumerate(shown):
        line, column = divmod(place, _COLUMNS)
        said = sorted({STATE_WORDS[error.predicted] for error in errors})
        names = textwrap.fill(f"by {', '.join(each.network for each in errors)}", _TITLE_LETTERS)
        title = f"{STATE_WORDS[errors[0].state]} as {' or '.join(said)}\n{names}"
        _draw(axes[2 * line][column], axes[2 * line + 1][column], dataset, errors[0], title)
    part_legend(figure, dataset, [dataset.index_of(errors[0].sample_id) for errors in shown])
    return figure


def _grid(lines: int) -> tuple[Figure, Sequence[Sequence[Axes]]]:
    """Pairs of lines, pictures above clouds."""
    figure = Figure(figsize=(2.5 * _COLUMNS + 0.3, 3.9 * lines), layout="constrained")
    axes = figure.subplots(2 * lines, _COLUMNS, squeeze=False)
    for axis in axes.ravel():
        picture_axes(axis)
    return figure, axes.tolist()


def _draw(picture: Axes, cloud: Axes, dataset: PreparedDataset, error: ErrorRow, title: str) -> None:
    index = dataset.index_of(error.sample_id)
    image = dataset.image(index)
    if image is not None:
        picture.imshow(image[::2, ::2], interpolation="none")
    picture.set_title(title, fontsize=8)
    draw_cloud(cloud, dataset, index)

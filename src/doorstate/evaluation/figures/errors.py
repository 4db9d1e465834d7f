# SPDX-License-Identifier: Apache-2.0
"""Misclassified samples as pictures and clouds (the paper's Figures 3 and 4)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.detections import draw_detections
from doorstate.evaluation.errors import order_errors
from doorstate.evaluation.figures.samples import draw_cloud, part_legend
from doorstate.evaluation.results import Results
from doorstate.evaluation.views import picture_axes
from doorstate.pages.colors import STATE_WORDS

_COLUMNS = 5
_TITLE_LETTERS = 40  # of a line as wide as a picture


def surest_errors_figure(results: Results, dataset: PreparedDataset) -> Figure | None:
    """Draw Figure 3: a line for each method with its errors of highest confidence; None without errors."""
    errors = order_errors(results.errors)
    lines = [(method, errors[errors["method"] == method]) for method in results.methods]
    lines = [(method, of_method) for method, of_method in lines if len(of_method)]
    if not lines:
        return None
    figure, axes = _grid(len(lines))
    for line, (method, of_method) in enumerate(lines):
        axes[2 * line][0].set_ylabel(f"{method}\n{len(of_method)} errors", fontsize=10)
        for column, (_, error) in enumerate(of_method.head(_COLUMNS).iterrows()):
            words = STATE_WORDS[error["state"]], STATE_WORDS[error["predicted"]]
            confidence = f", {error['confidence']:.2f}" if error["confidence"] > 0 else ""
            title = f"{words[0]} as {words[1]}{confidence}"
            _draw(axes[2 * line][column], axes[2 * line + 1][column], dataset, error["sample_id"], title)
            detections = results.detections.get(method, {}).get(error["sample_id"], ())
            draw_detections(axes[2 * line + 1][column], detections)
    drawn = [sample for _, of_method in lines for sample in of_method["sample_id"].head(_COLUMNS)]
    part_legend(figure, dataset, map(dataset.index_of, drawn))
    return figure


def common_errors_figure(results: Results, dataset: PreparedDataset) -> Figure | None:
    """Draw Figure 4: the samples that most methods misclassified, at least two; None where there are none."""
    by_sample = [errors for _, errors in results.errors.groupby("sample_id", sort=True)]
    shared = sorted((errors for errors in by_sample if len(errors) > 1), key=lambda errors: -len(errors))
    drawn = shared[: 2 * _COLUMNS]
    if not drawn:
        return None
    figure, axes = _grid(-(-len(drawn) // _COLUMNS))
    for place, errors in enumerate(drawn):
        line, column = divmod(place, _COLUMNS)
        first = errors.iloc[0]
        labels = sorted({STATE_WORDS[label] for label in errors["predicted"]})
        names = textwrap.fill(f"by {', '.join(errors['method'])}", _TITLE_LETTERS)
        title = f"{STATE_WORDS[first['state']]} as {' or '.join(labels)}\n{names}"
        _draw(axes[2 * line][column], axes[2 * line + 1][column], dataset, first["sample_id"], title)
    part_legend(figure, dataset, [dataset.index_of(errors["sample_id"].iloc[0]) for errors in drawn])
    return figure


def _grid(lines: int) -> tuple[Figure, Sequence[Sequence[Axes]]]:
    """Return a figure with pairs of lines, pictures above clouds."""
    figure = Figure(figsize=(2.5 * _COLUMNS + 0.3, 3.9 * lines), layout="constrained")
    axes = figure.subplots(2 * lines, _COLUMNS, squeeze=False)
    for axis in axes.ravel():
        picture_axes(axis)
    return figure, axes.tolist()


def _draw(picture: Axes, cloud: Axes, dataset: PreparedDataset, sample_id: str, title: str) -> None:
    index = dataset.index_of(sample_id)
    image = dataset.image(index)
    if image is not None:
        picture.imshow(image[::2, ::2], interpolation="none")
    picture.set_title(title, fontsize=8)
    draw_cloud(cloud, dataset, index)

# SPDX-License-Identifier: Apache-2.0
"""Detections of rules in samples they misclassified: walls, leaves and openings, drawn over the clouds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from pydantic import TypeAdapter, ValidationError

from doorstate._documents import parse_json
from doorstate._input import MAX_TABLE_BYTES, read_input_text
from doorstate.errors import RunError
from doorstate.evaluation.views import oblique_view
from doorstate.pages.colors import DETECTION_COLORS
from doorstate.pages.encoding import closed
from doorstate.rules.base import Detection

Detections = Mapping[str, tuple[Detection, ...]]
"""Detections by sample."""

_LINE = TypeAdapter(tuple[str, list[tuple[str, list[tuple[float, float, float]]]]])


def read_detections(path: Path) -> Detections:
    """Read `detections.jsonl` of a run; empty if the run has no such file.

    Raises:
        RunError: a line is not a record of detections.
    """
    detections: dict[str, tuple[Detection, ...]] = {}
    text = read_input_text(path, MAX_TABLE_BYTES, RunError) if path.exists() else ""
    for number, line in enumerate(text.splitlines(), 1):
        try:
            record = parse_json(line)
            sample, shapes = _LINE.validate_python((record["sample_id"], record["detections"]))
        except (RunError, ValueError, KeyError, TypeError, ValidationError) as error:
            raise RunError(
                f"line {number} is not a record of detections", path=path, hint="run this rule again"
            ) from error
        detections[sample] = tuple(
            Detection(name, np.array(points).reshape(-1, 3)) for name, points in shapes
        )
    return detections


def draw_detections(axis: Axes, detections: Iterable[Detection]) -> None:
    """Draw detections over a cloud: corners as dots, edges as lines, outlines closed."""
    for detection in detections:
        screen, _ = oblique_view(closed(detection).astype(np.float32))
        marker = "o" if len(screen) == 1 else ""
        color = DETECTION_COLORS.get(detection.name, DETECTION_COLORS["edge"])
        axis.plot(*screen.T, marker=marker, markersize=3, linewidth=1.2, color=color, zorder=5)

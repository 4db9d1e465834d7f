# SPDX-License-Identifier: Apache-2.0
"""What rules found where they were wrong: walls, leaves and openings, to be drawn over the clouds."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from pydantic import TypeAdapter, ValidationError

from doorstate.errors import RunError
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.views import DETECTION_COLORS, oblique_view
from doorstate.rules.base import Detection

Detections = Mapping[str, tuple[Detection, ...]]
"""Shapes by sample."""

_LINE = TypeAdapter(tuple[str, list[tuple[str, list[tuple[float, float, float]]]]])


def read_detections(path: Path) -> Detections:
    """Shapes of every line of a run's `detections.jsonl`; none where the run has no such file.

    Raises:
        RunError: a line is no such record.
    """
    found = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines() if path.exists() else (), 1):
        try:
            record = json.loads(line)
            sample, shapes = _LINE.validate_python((record["sample_id"], record["detections"]))
        except (ValueError, KeyError, TypeError, ValidationError) as error:
            raise RunError(
                f"{path}, line {number}: no record of found shapes; run this rule again"
            ) from error
        found[sample] = tuple(Detection(name, np.array(points).reshape(-1, 3)) for name, points in shapes)
    return found


def draw_detections(axis: Axes, shapes: Iterable[Detection]) -> None:
    """Draw shapes over a cloud: corners as dots, edges as lines, outlines closed."""
    for shape in shapes:
        screen, _ = oblique_view(closed(shape).astype(np.float32))
        marker = "o" if len(screen) == 1 else ""
        color = DETECTION_COLORS.get(shape.name, DETECTION_COLORS["edge"])
        axis.plot(*screen.T, marker=marker, markersize=3, linewidth=1.2, color=color, zorder=5)


def encode_detections(shapes: Iterable[Detection]) -> list[dict[str, Any]]:
    """Shapes as the page draws them: name and points in metres, outlines closed."""
    return [{"name": shape.name, "points": np.round(closed(shape), 3).tolist()} for shape in shapes]


def closed(shape: Detection) -> Floats:
    """(K, 3) points of a shape, an outline's first once more at its end."""
    points = shape.points_m
    return np.concatenate([points, points[:1]]) if len(points) > 2 else points

# SPDX-License-Identifier: Apache-2.0
"""Pictures that pages of the documentation show: `python -m paper pictures`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from io import BytesIO
from pathlib import Path

from PIL import Image

from doorstate._files import atomic_path
from doorstate.evaluation.figures.factors import factors_figure
from doorstate.evaluation.figures.poses import errors_figure

from .. import paths
from . import buildings, door_kinds, named_doors, reports, scenes, sensors, states, view

COLORS = 128  # enough for all of them, and a third of the size

PICTURES: Mapping[str, Callable[[], bytes]] = {
    "states": states.draw,
    "varied": partial(scenes.draw, "varied"),
    "cluttered": partial(scenes.draw, "cluttered"),
    "no-door": partial(scenes.draw, "no-door"),
    "corridor": partial(scenes.draw, "corridor"),
    "two-doors": partial(scenes.draw, "two-doors"),
    "door-kinds": door_kinds.draw,
    "buildings": buildings.draw,
    "sensors": sensors.draw,
    "view": view.draw,
    "named-doors": named_doors.draw,
    "results-by-pose-errors": partial(reports.draw, "by-pose", "errors_in_plan", errors_figure),
    "related-factors": partial(reports.draw, "related", "factors", factors_figure),
    "generalization-factors": partial(reports.draw, "mixture-wide", "factors", factors_figure),
}
"""Functions that return a picture as PNG, by the name of its file."""


def draw(names: Iterable[str] = ()) -> list[Path]:
    """Draw pictures into `docs/images` with a small palette, all if none is named; return their paths."""
    written = []
    for name in names or PICTURES:
        path = paths.DOCS / "images" / f"{name}.png"
        image = Image.open(BytesIO(PICTURES[name]())).convert("RGB")
        with atomic_path(path) as temporary:
            image.quantize(COLORS).save(temporary, format="png", optimize=True)
        written.append(path)
    return written

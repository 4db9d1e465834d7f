# SPDX-License-Identifier: Apache-2.0
"""Encode figures as PNG; the same figure gives the same bytes."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from doorstate._files import atomic_path

_DPI = 160
_PICTURE_DPI = 110  # figures full of pictures are megabytes otherwise
_PICTURES = ("figure2_samples", "figure3_misclassified", "figure4_missed_by_most")


def encode_figure(name: str, figure: Figure) -> bytes:
    """Return a figure as a PNG, in the resolution that its name asks for."""
    # `savefig` would go through every artist twice, once only to find the layout again.
    png = io.BytesIO()
    figure.dpi = _PICTURE_DPI if name in _PICTURES else _DPI
    FigureCanvasAgg(figure).print_png(png, metadata={"Software": None})  # type: ignore[no-untyped-call]
    return png.getvalue()


def save_figures(encoded: Mapping[str, bytes], folder: Path) -> None:
    """Write `<name>.png` of every encoded figure."""
    for name, content in encoded.items():
        with atomic_path(folder / f"{name}.png") as temporary:
            temporary.write_bytes(content)

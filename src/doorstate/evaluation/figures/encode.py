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


def encode_figures(figures: Mapping[str, Figure | None]) -> dict[str, bytes]:
    """Return each figure as a PNG; those that are None are left out."""
    return {
        name: _encode(figure, _PICTURE_DPI if name in _PICTURES else _DPI)
        for name, figure in figures.items()
        if figure is not None
    }


def save_figures(encoded: Mapping[str, bytes], folder: Path) -> None:
    """Write `<name>.png` of every encoded figure."""
    for name, content in encoded.items():
        with atomic_path(folder / f"{name}.png") as temporary:
            temporary.write_bytes(content)


def _encode(figure: Figure, dpi: int) -> bytes:
    # `savefig` would go through every artist twice, once only to find the layout again.
    png = io.BytesIO()
    figure.dpi = dpi
    FigureCanvasAgg(figure).print_png(png, metadata={"Software": None})  # type: ignore[no-untyped-call]
    return png.getvalue()

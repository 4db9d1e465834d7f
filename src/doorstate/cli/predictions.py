# SPDX-License-Identifier: Apache-2.0
"""How `predict` shows an answer, of a file or of a message."""

from __future__ import annotations

from typing import Any


def table_cells(answer: dict[str, Any]) -> list[str]:
    """A described prediction as cells: state, probabilities, points, milliseconds."""
    said = answer["state"] or f"none: {answer['reason']}"
    odds = [f"{probability:.3f}" for probability in answer["probabilities"].values()]
    return [said, *odds, str(answer["points"]), f"{answer['milliseconds']:.0f}"]

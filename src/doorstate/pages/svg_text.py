# SPDX-License-Identifier: Apache-2.0
"""Text for SVG pictures."""

from __future__ import annotations

from html import escape

from doorstate._paths import printable


def svg_text(text: str) -> str:
    """Return text for SVG, with control characters, which it cannot hold, as escape sequences."""
    return escape(printable(text))

# SPDX-License-Identifier: Apache-2.0
"""What every page is made of: clouds as text, colours, the drawing library, and templates that load nothing."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from doorstate.evaluation.views import DETECTION_COLORS, PART_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import Part, Points


def render_page(template: str, package: str = "doorstate.evaluation", **values: Any) -> str:
    """Fill a template of a package, which may include those of this one.

    Args:
        template: file name in the package's folder `templates`.
        package: where it is.
        values: what the template needs beside the drawing library; `page_data` gets the colours and the view.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (package, "doorstate.evaluation")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    look = {
        "parts": [{"value": part, "name": part.name.lower(), "color": PART_COLORS[part]} for part in Part],
        "shape_colors": DETECTION_COLORS,
        "elevation": VIEW_ELEVATION_RAD,
    }
    return environment.get_template(template).render(
        **values | {"page_data": values["page_data"] | look},
        # The library is kept as text until the first cloud is opened, so the page itself appears at once.
        plotly=get_plotlyjs().replace("</script", r"<\/script"),
    )


def encode_cloud(points: Points, parts: NDArray[np.uint8] | None) -> dict[str, str | None]:
    """A cloud as `clouds.js` decodes it.

    Args:
        points: (N, 3) metres; rounded to millimetres, and a point beyond 32 m is drawn at 32 m.
        parts: (N,) values of `Part`, or None.
    """
    limit = np.iinfo(np.int16)
    millimetres = np.clip(np.rint(points * 1000.0), limit.min, limit.max).astype("<i2")
    return {
        "points": encode_bytes(millimetres.tobytes()),
        "parts": None if parts is None else encode_bytes(parts.tobytes()),
    }


def data_uri(content: bytes, media_type: str) -> str:
    """Put a file into an address, so that the page needs no other file."""
    return f"data:{media_type};base64,{encode_bytes(content)}"


def encode_bytes(content: bytes) -> str:
    """Bytes as text for a page."""
    return base64.b64encode(content).decode("ascii")

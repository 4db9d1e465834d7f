# SPDX-License-Identifier: Apache-2.0
"""Parts of all HTML pages: templates, Plotly, encoded clouds and pictures; a page loads no other file."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from PIL import Image
from plotly.offline import get_plotlyjs

from doorstate.evaluation.views import DETECTION_COLORS, PART_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import Part, Points

_PICTURE_PX = (400, 300)


def render_page(template: str, package: str = "doorstate.evaluation", **values: Any) -> str:
    """Fill a template of a package, which may include templates of `doorstate.evaluation`.

    Args:
        template: file name in the folder `templates` of the package.
        package: package of the template.
        values: variables of the template; colours and view are added to `page_data`.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (package, "doorstate.evaluation")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = {
        "parts": [{"value": part, "name": part.name.lower(), "color": PART_COLORS[part]} for part in Part],
        "detection_colors": DETECTION_COLORS,
        "elevation": VIEW_ELEVATION_RAD,
    }
    return environment.get_template(template).render(
        **values | {"page_data": values["page_data"] | style},
        # Plotly stays text until the first cloud is opened, so that the page appears at once.
        plotly=get_plotlyjs().replace("</script", r"<\/script"),
    )


def missed_by(count: int, methods: int) -> str:
    """Return the heading of samples that `count` of the methods misclassified."""
    return f"Missed by {count or 'none'} of {methods}"


def encode_cloud(points: Points, parts: NDArray[np.uint8] | None) -> dict[str, str | None]:
    """Return a cloud as `clouds.js` decodes it.

    Args:
        points: (N, 3) metres; rounded to millimetres and limited to 32 m.
        parts: (N,) values of `Part`, or None.
    """
    limit = np.iinfo(np.int16)
    millimetres = np.clip(np.rint(points * 1000.0), limit.min, limit.max).astype("<i2")
    return {
        "points": encode_bytes(millimetres.tobytes()),
        "parts": None if parts is None else encode_bytes(parts.tobytes()),
    }


def picture_uri(picture: NDArray[np.uint8]) -> str:
    """Return (H, W, 3) pixels as a small JPEG in a data URI."""
    image = Image.fromarray(picture)
    image.thumbnail(_PICTURE_PX)
    encoded = io.BytesIO()
    image.save(encoded, format="JPEG", quality=85)
    return data_uri(encoded.getvalue(), "image/jpeg")


def data_uri(content: bytes, media_type: str) -> str:
    """Return the content of a file as a data URI."""
    return f"data:{media_type};base64,{encode_bytes(content)}"


def encode_bytes(content: bytes) -> str:
    """Return bytes in base 64."""
    return base64.b64encode(content).decode("ascii")

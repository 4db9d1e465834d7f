# SPDX-License-Identifier: Apache-2.0
"""HTML pages from templates; the browser is told to load nothing else, and to run only the scripts written here."""

from __future__ import annotations

import base64
import hashlib
import re
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from doorstate.pages.colors import DETECTION_COLORS, PART_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import Part

_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
    "script-src {scripts}; connect-src {connections}"
)
_POLICY_MARK = "content-security-policy-of-this-page"
_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def render_page(template: str, package: str, *, live: bool = False, **values: Any) -> str:
    """Fill a template of a package, which may include templates of `doorstate.pages`.

    The template writes its scripts as `<script>...</script>`, and `{{ policy }}` as its Content-Security-Policy.

    Args:
        template: file name in the folder `templates` of the package.
        package: package of the template.
        live: allow requests to the server of the page.
        values: variables of the template; colours and view are added to `page_data`.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (package, "doorstate.pages")]),
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
    page = environment.get_template(template).render(
        **values | {"page_data": values["page_data"] | style}, live=live, policy=_POLICY_MARK
    )
    return page.replace(_POLICY_MARK, _policy(page, live), 1)


def _policy(page: str, live: bool) -> str:
    """Return a policy that allows the scripts of a page by their digests, and nothing from elsewhere."""
    digests = (hashlib.sha256(script.encode()).digest() for script in _SCRIPT.findall(page))
    return _POLICY.format(
        scripts=" ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests),
        connections="'self'" if live else "'none'",
    )

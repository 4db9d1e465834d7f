# SPDX-License-Identifier: Apache-2.0
"""HTML pages as one file: the browser is told to load nothing else, and to run only the scripts written here."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Template
from typing import Any

from doorstate.pages.colors import DETECTION_COLORS, PART_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import Part

_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
    "script-src {scripts}; connect-src {connections}"
)
POLICY_MARK = "content-security-policy-of-this-page"
_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def fill_page(
    template: str,
    package: str,
    parts: Sequence[str],
    *,
    live: bool = False,
    page_data: Mapping[str, Any],
    **texts: str,
) -> str:
    """Fill a template that has no conditions and no loops, with the standard library alone.

    The template writes `$name` for a text; `$policy`, `$page_data`, `$if_live` (an attribute that hides what only a
    live page has), and parts of pages such as `$view_css`.

    Args:
        template: file name in the folder `templates` of the package.
        package: package of the template.
        parts: names of styles and scripts in the same folder or that of `doorstate.pages`, such as "view.css".
        live: allow requests to the server of the page.
        page_data: values for the scripts; colours and view are added.
        texts: plain texts by name.
    """
    page = Template(_read(template, package)).substitute(
        {name: html.escape(text) for name, text in texts.items()}
        | {part.replace(".", "_"): _read(part, package) for part in parts},
        page_data=_script_json(dict(page_data) | page_style()),
        live=str(live).lower(),
        if_live="" if live else "hidden",
        policy=POLICY_MARK,
    )
    return with_policy(page, live)


def page_style() -> dict[str, Any]:
    """Return colours and view, as the scripts of all pages use them."""
    return {
        "parts": [{"value": part, "name": part.name.lower(), "color": PART_COLORS[part]} for part in Part],
        "detection_colors": DETECTION_COLORS,
        "elevation": VIEW_ELEVATION_RAD,
    }


def with_policy(page: str, live: bool) -> str:
    """Return a page with a policy in place of `POLICY_MARK`.

    The policy allows the scripts of the page, `<script>...</script>`, by their digests, and nothing from elsewhere.
    """
    digests = (hashlib.sha256(script.encode()).digest() for script in _SCRIPT.findall(page))
    policy = _POLICY.format(
        scripts=" ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests),
        connections="'self'" if live else "'none'",
    )
    return page.replace(POLICY_MARK, policy, 1)


def _read(name: str, package: str) -> str:
    """Return a template or part of the package, else that of all pages."""
    places = (files(owner) / "templates" / name for owner in (package, "doorstate.pages"))
    return next(place for place in places if place.is_file()).read_text(encoding="utf-8").rstrip()


def _script_json(value: Any) -> str:
    """Return JSON that can end neither a script nor an attribute."""
    text = json.dumps(value)
    for character in "<>&'":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text

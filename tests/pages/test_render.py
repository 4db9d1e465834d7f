# SPDX-License-Identifier: Apache-2.0
"""Policy of a page."""

from __future__ import annotations

import base64
import hashlib
import re

import pytest

from doorstate.pages.render import render_page


@pytest.mark.parametrize(("live", "connections"), [(False, "'none'"), (True, "'self'")])
def test_policy_allows_the_scripts_of_the_page_alone(live: bool, connections: str) -> None:
    page = render_page(
        "view.html.j2", "doorstate.viewer", live=live, predictor="name", page_data={"text": "</script>"}
    )
    match = re.search(r'http-equiv="Content-Security-Policy" content="(.*?)"', page)
    assert match is not None
    policy = dict(directive.strip().split(" ", 1) for directive in match.group(1).split(";"))
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert policy["script-src"] == " ".join(f"'sha256-{digest}'" for digest in digests)
    assert (policy["default-src"], policy["connect-src"]) == ("'none'", connections)

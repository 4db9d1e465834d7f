# SPDX-License-Identifier: Apache-2.0
"""Pages filled without a template library, and their policy."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.pages.document import fill_page


def fill(live: bool = False, text: str = "</script>") -> str:
    return fill_page(
        "view.html",
        "doorstate.viewer",
        ("page.css", "view.css", "clouds.js", "view.js"),
        live=live,
        page_data={"text": text},
        heading="",
        predictor=text,
    )


@pytest.mark.parametrize(("live", "connections"), [(False, "'none'"), (True, "'self'")])
def test_policy_allows_the_scripts_of_the_page_alone(live: bool, connections: str) -> None:
    page = fill(live)
    match = re.search(r'http-equiv="Content-Security-Policy" content="(.*?)"', page)
    assert match is not None
    policy = dict(directive.strip().split(" ", 1) for directive in match.group(1).split(";"))
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert policy["script-src"] == " ".join(f"'sha256-{digest}'" for digest in digests)
    assert (policy["default-src"], policy["connect-src"]) == ("'none'", connections)


@given(
    text=st.text(max_size=30)
    | st.sampled_from(["</script><!--", "$policy ${live}", "'\"&<>\u2028", "\\u003c"])
)
def test_texts_and_data_stay_what_they_are(text: str) -> None:
    page = fill(text=text)
    assert page.count("</script>") == 2, "of the data and of the scripts"
    data = re.search(r'<script type="application/json" id="page-data">(.*?)</script>', page, flags=re.DOTALL)
    assert data is not None
    assert json.loads(data.group(1))["text"] == text
    assert f"<p>{html.escape(text)} <span" in page

# SPDX-License-Identifier: Apache-2.0
"""HTML pages from templates of Jinja, for reports."""

from __future__ import annotations

from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from doorstate.pages.document import POLICY_MARK, page_style, with_policy


def render_page(template: str, package: str, **values: Any) -> str:
    """Fill a template of a package, which may include templates of `doorstate.pages`.

    The template writes its scripts as `<script>...</script>`, and `{{ policy }}` as its Content-Security-Policy.

    Args:
        template: file name in the folder `templates` of the package.
        package: package of the template.
        values: variables of the template; colours and view are added to `page_data`.
    """
    additions = {"page_data": values["page_data"] | page_style(), "policy": POLICY_MARK}
    return with_policy(fill_template(template, package, **values | additions), live=False)


def fill_template(template: str, package: str, **values: Any) -> str:
    """Fill a template of a package; arguments as in `render_page`, without additions."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (package, "doorstate.pages")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(**values)

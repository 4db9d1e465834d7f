# SPDX-License-Identifier: Apache-2.0
"""Render the templates beside this file, and compare the pages in `docs/` with what they give."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from doorstate._files import write_text

from ..paths import DOCS, TITLES
from . import commands, doorways, generalization, real, related, results, zoo

PAGES: Mapping[str, Callable[[], Mapping[str, Any]]] = {
    "results": results.content,
    "related": related.content,
    "generalization": generalization.content,
    "doorways": doorways.content,
    "real": real.content,
    "zoo": zoo.content,
    "commands": commands.content,
}
"""Values that the template of each page uses."""


def render_page(name: str) -> str:
    """Return a page of `docs/` as Markdown."""
    return render_template(f"{name}.md.j2", PAGES[name]())


def render_template(name: str, values: Mapping[str, Any]) -> str:
    """Fill a template of this folder; a name it uses and is not given is an error."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(name).render(titles=TITLES, **values)
    text = re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def write_pages() -> list[Path]:
    """Write all pages into `docs/` and return their paths."""
    paths = []
    for name in PAGES:
        path = DOCS / f"{name}.md"
        write_text(path, render_page(name))
        paths.append(path)
    return paths


def outdated_pages() -> list[str]:
    """Return the names of the pages in `docs/` that differ from what `results/` gives."""
    return [name for name in PAGES if (DOCS / f"{name}.md").read_text(encoding="utf-8") != render_page(name)]

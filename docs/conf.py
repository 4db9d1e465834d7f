# SPDX-License-Identifier: Apache-2.0
"""Sphinx configuration of the site (`make docs`): the Markdown of this folder, and the API from the docstrings."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from typer.testing import CliRunner

from doorstate import __version__
from doorstate.cli.application import app as command_line

project = "doorstate"
author = copyright = "The doorstate developers"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
html_theme = "furo"
html_title = f"doorstate {__version__}"
html_copy_source = False

myst_heading_anchors = 3  # links to headings by GitHub's rules
myst_links_external_new_tab = False

autodoc_default_options = {
    "members": True,
    "special-members": "__call__",
    "exclude-members": "model_config",
}
autodoc_inherit_docstrings = False
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: f"doorstate.types.{name}" for name in ("Points", "DepthImage", "Indices")}
napoleon_numpy_docstring = False
python_maximum_signature_line_length = 100
python_use_unqualified_type_names = True
# Types in signatures without a target: those of other projects, which would need their sites, and those of packages
# that have no reference page.
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(numpy|np|pandas|pd|torch|pydantic|annotated_types|collections|pathlib|typing|types|datetime|fastapi|enum|abc)\..*",
    ),
    ("py:.*", r"doorstate\.(simulation|dataset|training|evaluation|rules\.walls)\..*"),
    (
        "py:.*",
        r"(doorstate\.rules\.base\.)?P|Points|Indices|Floats|Place|Columns|Quaternion|Crops|LevelingSource|Tensor|NDArray|Path|NoneType",
    ),  # type variables, and bare names in NamedTuples
    # Constraints of pydantic, and their limits.
    (
        "py:class",
        r"FieldInfo|G[et]|L[et]|M(ax|in)Len|_?Pydantic\w+|[\d.e+-]+|doorstate[\w.]*\._(check|lower)\w*",
    ),
]

REPOSITORY = Path(__file__).resolve().parents[1]
# Pages that live outside this folder, where GitHub looks for them, by their name in the site.
_OUTSIDE_PAGES = {
    "changelog": "CHANGELOG.md",
    "contributing": "CONTRIBUTING.md",
    "log": "paper/log.md",
    "ros2": "ros2/README.md",
    "security": "SECURITY.md",
}


def _complete_page(app: Sphinx, page: str, source: list[str]) -> None:
    text = source[0]
    if page in _OUTSIDE_PAGES:
        text = _with_moved_links(_OUTSIDE_PAGES[page])
    for inside, outside in _OUTSIDE_PAGES.items():
        text = text.replace(f"](../{outside})", f"]({inside}.md)")
        text = text.replace(f"](../../{outside})", f"](../{inside}.md)")
    if page == root_doc:
        text += _sidebar(text)
    elif page == "commands":
        text += "\n".join(_command_help())
    elif page == "zoo":
        text = re.sub(r"\]\(\.\./src/[\w/]+/([\w-]+)\.md\)", r"](#card-\1)", text) + _model_cards()
    elif page.startswith("benchmarks/"):
        # Tables as `python -m benchmarks` writes them have no headings and no entry in the sidebar.
        text = "---\norphan: true\n---\n" + re.sub(r"^\*\*(.+)\*\*$", r"# \1", text, flags=re.MULTILINE)
    source[0] = text


def _with_moved_links(file: str) -> str:
    """Return a page of the repository with its relative links rewritten for this folder."""
    path = REPOSITORY / file

    def moved(link: re.Match[str]) -> str:
        address, hash_mark, anchor = link[1].partition("#")
        if "://" in address or not address:
            return link[0]
        return f"]({os.path.relpath(path.parent / address, REPOSITORY / 'docs')}{hash_mark}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", moved, path.read_text(encoding="utf-8"))


def _sidebar(index: str) -> str:
    """Return the sidebar: sections of the index are groups, list items that begin with a link are pages."""
    groups = re.split(r"^## (.+)\n", index, flags=re.MULTILINE)[1:]
    trees = []
    for title, body in zip(groups[::2], groups[1::2], strict=True):
        pages = re.findall(r"^- \[([^\]]+)\]\(([^)]+)\.md\)", body, flags=re.MULTILINE)
        entries = [f"{text} <{page}>" for text, page in pages]
        trees += ["", "```{toctree}", ":hidden:", f":caption: {title}", "", *entries, "```"]
    return "\n".join([*trees, ""])


def _command_help() -> list[str]:
    names = [command.callback.__name__ for command in command_line.registered_commands if command.callback]
    for group in command_line.registered_groups:
        assert group.typer_instance is not None
        names += [
            f"{group.typer_instance.info.name} {command.name}"
            for command in group.typer_instance.registered_commands
        ]
    texts = [
        CliRunner()
        .invoke(command_line, [*name.split(), "--help"], prog_name="doorstate", env={"COLUMNS": "100"})
        .output
        for name in names
    ]
    return [f"\n## {name}\n\n```text\n{text.strip()}\n```\n" for name, text in zip(names, texts, strict=True)]


def _model_cards() -> str:
    """Return the model cards of the packaged weights, one heading level deeper."""
    cards = sorted((REPOSITORY / "src/doorstate/networks/pretrained").glob("*.md"))
    return "".join(
        f"\n(card-{card.stem})=\n" + re.sub("^#", "##", card.read_text(encoding="utf-8"), flags=re.MULTILINE)
        for card in cards
    )


def _unlink_folders(app: Sphinx, document: nodes.document) -> None:
    """Turn links to folders, which GitHub shows and a site does not, into plain text."""
    here = Path(app.env.doc2path(app.env.docname)).parent
    for link in list(document.findall(addnodes.pending_xref)):
        if link["reftype"] == "myst" and (here / link["reftarget"]).is_dir():
            link.replace_self(link.children)


_COLON_PLACEHOLDER = "\N{INFORMATION SEPARATOR ONE}"


def _convert_markdown(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Convert code spans and bars from Markdown to reStructuredText, and hide colons that napoleon takes for types."""
    if any("├──" in line for line in lines):  # a tree is drawn below the first sentence
        lines[2:] = ["::", "", *(f"   {line}" for line in lines[2:])]
        return
    returns = False
    for number, line in enumerate(lines):
        returns = line.strip() == "Returns:" or (returns and line[:1] in ("", " "))
        if returns or (what == "property" and number == 0):
            line = line.replace(
                ": ", f"{_COLON_PLACEHOLDER} "
            )  # napoleon takes what is before a colon for a type
        code = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line)
        lines[number] = re.sub(r"(``.+?``)|\|", lambda match: match[1] or r"\|", code)


def _restore_colons(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    lines[:] = [line.replace(_COLON_PLACEHOLDER, ":") for line in lines]


def _simplify_signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Return signature and result with readable array types."""

    def readable(text: str | None) -> str | None:
        text = text and re.sub(r"TypeAliasForwardRef\('([\w.]+)'\)", r"\1", text)
        any_shape = r"~?numpy\.ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?numpy\.dtype\[(~?[\w.]+)\]\]"
        text = text and re.sub(any_shape, r"~numpy.typing.NDArray[\1]", text)
        return text and text.replace("<factory>", "...")

    return readable(signature), readable(returns)


def _skip_tuple_fields(
    app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any
) -> bool | None:
    """Skip fields of named tuples: the signature lists them already."""
    return True if str(getattr(thing, "__doc__", "")).startswith("Alias for field number") else None


def setup(app: Sphinx) -> None:
    """Register the hooks."""
    app.connect("source-read", _complete_page)
    app.connect("doctree-read", _unlink_folders)
    app.connect("autodoc-process-docstring", _convert_markdown, priority=400)  # napoleon comes at 500
    app.connect("autodoc-process-docstring", _restore_colons, priority=600)
    app.connect("autodoc-process-signature", _simplify_signature)
    app.connect("autodoc-skip-member", _skip_tuple_fields)

# SPDX-License-Identifier: Apache-2.0
"""The site (`make docs`): the Markdown of this folder as GitHub shows it, and the API from the docstrings."""

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
from doorstate.cli import app as command_line

project = "doorstate"
author = copyright = "The doorstate developers"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
html_theme = "furo"
html_title = f"doorstate {__version__}"
html_copy_source = False

myst_heading_anchors = 3  # links such as deployment.md#the-gate, by GitHub's rules
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
# Types in signatures that lead nowhere: those of other projects, as asking their sites for addresses would need the
# network, and those behind the commands. What clouds, rules, networks and deployment take and give has its place here.
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(numpy|np|torch|pydantic|annotated_types|collections|pathlib|typing|types|fastapi|enum|abc)\..*",
    ),
    ("py:.*", r"doorstate\.(simulation|dataset|training|evaluation|rules\.walls)\..*"),
    (
        "py:.*",
        r"(doorstate\.rules\.base\.)?P|Points|Indices|Floats|Tensor|NDArray",
    ),  # variables, and bare names of NamedTuples
]

REPOSITORY = Path(__file__).resolve().parents[1]
# Pages that live where people look for them on GitHub; in here a page of the name in front shows them.
_ELSEWHERE = {"changelog": "CHANGELOG.md", "contributing": "CONTRIBUTING.md", "ros2": "ros2/README.md"}


def _read(app: Sphinx, page: str, source: list[str]) -> None:
    text = source[0]
    if page in _ELSEWHERE:
        text = _seen_from_here(_ELSEWHERE[page])
    for inside, outside in _ELSEWHERE.items():
        text = text.replace(f"](../{outside})", f"]({inside}.md)")
    if page == root_doc:
        text += _contents(text)
    elif page == "commands":
        text += "\n".join(_help_of_commands())
    elif page == "zoo":
        text = re.sub(r"\]\(\.\./src/[\w/]+/([\w-]+)\.md\)", r"](#card-\1)", text) + _model_cards()
    elif page.startswith("benchmarks/"):
        # Tables as `python -m benchmarks` writes them: without headings, reached from the text about them.
        text = "---\norphan: true\n---\n" + re.sub(r"^\*\*(.+)\*\*$", r"# \1", text, flags=re.MULTILINE)
    source[0] = text


def _seen_from_here(file: str) -> str:
    """A page of the repository, its relative links as seen from this folder."""
    path = REPOSITORY / file

    def moved(link: re.Match[str]) -> str:
        address, hash_mark, anchor = link[1].partition("#")
        if "://" in address or not address:
            return link[0]
        return f"]({os.path.relpath(path.parent / address, REPOSITORY / 'docs')}{hash_mark}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", moved, path.read_text(encoding="utf-8"))


def _contents(index: str) -> str:
    """The side bar: a section of the index is a group, a list item that begins with a link is a page."""
    groups = re.split(r"^## (.+)\n", index, flags=re.MULTILINE)[1:]
    trees = []
    for title, body in zip(groups[::2], groups[1::2], strict=True):
        pages = re.findall(r"^- \[([^\]]+)\]\(([^)]+)\.md\)", body, flags=re.MULTILINE)
        entries = [f"{text} <{page}>" for text, page in pages]
        trees += ["", "```{toctree}", ":hidden:", f":caption: {title}", "", *entries, "```"]
    return "\n".join([*trees, ""])


def _help_of_commands() -> list[str]:
    names = [command.callback.__name__ for command in command_line.registered_commands if command.callback]
    texts = [
        CliRunner()
        .invoke(command_line, [name, "--help"], prog_name="doorstate", env={"COLUMNS": "100"})
        .output
        for name in names
    ]
    return [f"\n## {name}\n\n```text\n{text.strip()}\n```\n" for name, text in zip(names, texts, strict=True)]


def _model_cards() -> str:
    """The cards that lie beside the weights in the package, a level deeper."""
    cards = sorted((REPOSITORY / "src/doorstate/networks/pretrained").glob("*.md"))
    return "".join(
        f"\n(card-{card.stem})=\n" + re.sub("^#", "##", card.read_text(encoding="utf-8"), flags=re.MULTILINE)
        for card in cards
    )


def _folders_as_text(app: Sphinx, document: nodes.document) -> None:
    """Links to folders of the repository, which GitHub can show and a site cannot, stay as their text."""
    here = Path(app.env.doc2path(app.env.docname)).parent
    for link in list(document.findall(addnodes.pending_xref)):
        if link["reftype"] == "myst" and (here / link["reftarget"]).is_dir():
            link.replace_self(link.children)


_COLON = "\N{INFORMATION SEPARATOR ONE}"


def _docstring(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Before napoleon: Markdown's code and bars as reStructuredText has them, and prose that is no type."""
    if any("├──" in line for line in lines):  # a tree is drawn below the first sentence
        lines[2:] = ["::", "", *(f"   {line}" for line in lines[2:])]
        return
    returns = False
    for number, line in enumerate(lines):
        returns = line.strip() == "Returns:" or (returns and line[:1] in ("", " "))
        if returns or (what == "property" and number == 0):
            line = line.replace(": ", f"{_COLON} ")  # napoleon takes what is before a colon for a type
        code = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line)
        lines[number] = re.sub(r"(``.+?``)|\|", lambda found: found[1] or r"\|", code)


def _colons(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    lines[:] = [line.replace(_COLON, ":") for line in lines]


def _signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Array types as people write them."""

    def readable(text: str | None) -> str | None:
        text = text and re.sub(r"TypeAliasForwardRef\('([\w.]+)'\)", r"\1", text)
        any_shape = r"~?numpy\.ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?numpy\.dtype\[(~?[\w.]+)\]\]"
        text = text and re.sub(any_shape, r"~numpy.typing.NDArray[\1]", text)
        return text and text.replace("<factory>", "...")

    return readable(signature), readable(returns)


def _is_left_out(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Fields of named tuples, which their signature has already."""
    return True if str(getattr(thing, "__doc__", "")).startswith("Alias for field number") else None


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _read)
    app.connect("doctree-read", _folders_as_text)
    app.connect("autodoc-process-docstring", _docstring, priority=400)  # napoleon comes at 500
    app.connect("autodoc-process-docstring", _colons, priority=600)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _is_left_out)

# SPDX-License-Identifier: Apache-2.0
"""The site builds without a warning, its links and those of the Markdown lead somewhere, its figures are computed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

pytest.importorskip("sphinx")

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make docs` builds."""
    (line,) = re.findall(
        r"-m (sphinx .*) docs build/site$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE
    )
    folder = tmp_path_factory.mktemp("site")
    command = [
        sys.executable,
        "-m",
        *line.split(),
        "--doctree-dir",
        folder / "doctrees",
        DOCS,
        folder / "html",
    ]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    return folder / "html"


@pytest.mark.slow
def test_every_page_is_in_the_site_and_every_link_leads_somewhere(site: Path) -> None:
    # Reports that a page offers to download are no pages of the site.
    files = [path for path in site.rglob("*.html") if "_downloads" not in path.parts]
    pages = {path: path.read_text(encoding="utf-8") for path in files}
    for source in DOCS.rglob("*.md"):
        assert (site / source.relative_to(DOCS)).with_suffix(".html") in pages
    targets = {path: set(re.findall(r'\bid="([^"]+)"', text)) for path, text in pages.items()}
    broken = []
    for path, text in pages.items():
        for address in re.findall(r'\b(?:href|src)="([^"]+)"', text):
            if re.match(r"[a-z]+:", address):
                continue
            file, anchor = urldefrag(unquote(address))
            target = (path.parent / file.partition("?")[0]).resolve() if file else path
            if not target.exists() or (anchor and target in targets and anchor not in targets[target]):
                broken.append(f"{path.relative_to(site)}: {address}")
    assert broken == []


@pytest.mark.slow
def test_the_reference_has_signatures_and_every_command(site: Path) -> None:
    inference = (site / "api" / "inference.html").read_text(encoding="utf-8")
    for name in ("Predictor", "Predictor.__call__", "Predictor.batch", "Gate", "StateFilter.update"):
        assert re.search(rf'id="doorstate\.inference\.\w+\.{re.escape(name)}"', inference), name
    assert "TypeAliasForwardRef" not in inference
    commands = (site / "commands.html").read_text(encoding="utf-8")
    helped = subprocess.check_output([Path(sys.executable).with_name("doorstate"), "--help"], text=True)
    names = re.findall(r"^  ([a-z]+)  ", helped.partition("Commands:")[2], flags=re.MULTILINE)
    assert len(names) > 9
    assert [name for name in names if f"Usage: doorstate {name} " not in commands] == []

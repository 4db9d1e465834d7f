# SPDX-License-Identifier: Apache-2.0
"""The report is one self-contained file, for whole, partial, faultless and imported comparisons."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

from doorstate._jobs import RayEngine
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.gallery import build_gallery
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.report import render_report, write_dataset_report, write_report
from doorstate.evaluation.report_parts import ReportParts
from doorstate.evaluation.tables import build_tables
from tests.evaluation.conftest import MakeComparison

VOID = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Collects tags, addresses, scripts and visible text, and checks that tags are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: dict[str, str] = {}
        self.style = ""
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "script":
            name = self.tags[-1][1].get("id") or "code"
            self.scripts[name] = self.scripts.get(name, "") + data
        elif self._open and self._open[-1] == "style":
            self.style += data
        else:
            self.text += data

    def addresses(self) -> list[str]:
        names = ("src", "href", "srcset", "action", "poster", "data")
        return [value or "" for _, attrs in self.tags for name, value in attrs.items() if name in names]

    def classes(self) -> list[str]:
        return [name for _, attrs in self.tags for name in (attrs.get("class") or "").split()]


def _render(results_folder: Path, dataset: PreparedDataset) -> Page:
    results = load_results(results_folder)
    parts = ReportParts(build_tables(results), {}, build_gallery(results, dataset))
    return Page(render_report(results, dataset, parts))


def test_everything_is_written_self_contained_and_the_same_by_two_processes(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    ids = [row["sample_id"] for row in simulated.rows]
    wrong = {"pointnet": {ids[2]: "semi_open", ids[7]: "open"}, "dgcnn": {ids[2]: "semi_open"}}
    folder = make_comparison(simulated, wrong)
    report = write_report([folder], tmp_path / "one")
    steps: list[tuple[int, int]] = []
    write_report([folder], tmp_path / "two", workers=2, progress=lambda *step: steps.append(step))
    assert steps[-1] == (12, 12)
    assert not list((tmp_path / "two").glob(".*"))
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*"))
    assert {str(path.parent) for path in files} == {".", "tables", "figures"}
    for path in files:
        assert (tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes(), path

    page = Page(report.read_text(encoding="utf-8"))
    assert all(address.startswith(("data:image/", "#")) for address in page.addresses())
    assert "url(" not in page.style
    assert "@import" not in page.style
    (policy,) = (attrs["content"] or "" for _, attrs in page.tags if "http-equiv" in attrs)
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert not re.search(r"https?://|fetch\(|XMLHttpRequest|import\(", page.scripts["code"])
    targets = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    assert {address[1:] for address in page.addresses() if address.startswith("#")} <= targets

    data = json.loads(page.scripts["page-data"])
    assert set(data["clouds"]) == {ids[2], ids[7]}
    samples = {attrs["data-sample"] for _, attrs in page.tags if "data-sample" in attrs}
    assert samples == {ids[2], ids[7]}
    for table in ("summary", *(f"table{n}" for n in (1, 3)), "table4_closed", "table6_open", "runs"):
        assert any(target and target.startswith(table) for target in targets), table
    assert page.classes().count("picture") == 6
    assert page.classes().count("confusion") == 2
    assert "partial" not in page.text


def test_partial_and_imported(
    imported: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    folder = make_comparison(imported, {"dgcnn": {"open/3": "closed"}}, missing=[("pointnet", 0)])
    report = write_report([folder], tmp_path / "out")
    page = Page(report.read_text(encoding="utf-8"))
    assert all(address.startswith(("data:image/", "#")) for address in page.addresses())
    assert "partial" in page.text
    assert json.loads(page.scripts["page-data"])["clouds"]["open/3"]["parts"] is None
    assert page.classes().count("card") == 1
    assert page.classes().count("picture") == 3


def test_a_data_set_alone(imported: PreparedDataset, tmp_path: Path) -> None:
    out = write_dataset_report(imported.folder, tmp_path / "out")
    found = {str(path.relative_to(out)) for path in out.rglob("*.*")}
    tables = {f"tables/{name}.csv" for name in ("table1_samples", "undecidable_frames")}
    assert found == tables | {"figures/figure2_samples.png"}


def test_ray_draws_the_same_bytes(imported: PreparedDataset, ray_engine: RayEngine, tmp_path: Path) -> None:
    alone, out = tmp_path / "alone", tmp_path / "out"
    write_dataset_report(imported.folder, alone)
    write_dataset_report(imported.folder, out, ray_engine)
    files = [path.relative_to(alone) for path in alone.rglob("*.*")]
    assert len(files) == 3
    assert all((alone / path).read_bytes() == (out / path).read_bytes() for path in files)


def test_without_errors(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    page = _render(make_comparison(simulated), simulated)
    assert json.loads(page.scripts["page-data"])["clouds"] == {}
    assert "card" not in page.classes()


def test_names_from_files_are_text_and_never_markup(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    hostile = "</script><img src=http://example.org/x>"
    name = "<img src=x>"  # names of comparisons are those of folders
    rows = [row | {"sample_id": row["sample_id"].replace("open/3", hostile)} for row in imported.rows]
    dataset = PreparedDataset(imported.folder, imported.description, rows, imported.clouds, None)
    folder = make_comparison(imported, {"dgcnn": {"open/3": "closed"}}, name=name)
    for path in [folder / "splits.csv", *(folder / "runs").rglob("predictions.csv")]:
        path.write_text(path.read_text().replace("open/3,", f"{hostile},"))
    manifest = folder / "data" / "manifest.csv"
    manifest.parent.mkdir()
    manifest.write_text((imported.folder / "manifest.csv").read_text().replace("open/3,", f"{hostile},"))
    document = json.loads((folder / "comparison.json").read_text()) | {"dataset": "data"}
    (folder / "comparison.json").write_text(json.dumps(document))
    page = _render(folder, dataset)
    assert page.addresses() == [address for address in page.addresses() if address.startswith("#")]
    assert hostile in page.text
    assert name in page.text
    assert set(json.loads(page.scripts["page-data"])["clouds"]) == {hostile}

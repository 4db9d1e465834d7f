# SPDX-License-Identifier: Apache-2.0
"""docs/generalization.md: figures of the mixture's weights and of the transfer studies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from doorstate.dataset.store import open_dataset
from doorstate.evaluation.factors import ANGLE, OCCLUSION, factor_bins
from doorstate.evaluation.results import load_results
from doorstate.evaluation.table import Table, number
from doorstate.networks import list_networks
from doorstate.training.run_folder import read_json

from ..publish import rows_of
from .pairwise import FEW_PIXELS, NEARBY_M, cases_table
from .results import NAMES, render, whole_folds
from .targets import AT_4096, CLUTTER, MIXTURE, Published, targets_table

FEW_MEASURED = 150_000  # of the 307,200 pixels of an image
# Where there is little to fit a plane to, or the planes are not those of leaf and wall.
CASES: dict[str, Callable[[Mapping[str, str]], bool]] = {
    "all doors": lambda row: True,
    "a window in the leaf": lambda row: row["door_kind"] == "glazed",
    "a leaf of glass": lambda row: row["door_kind"] == "full_glass",
    "sliding": lambda row: row["door_kind"] == "sliding",
    "two leaves": lambda row: row["door_kind"].startswith("double"),
    "a quarter of the door hidden, or more": lambda row: float(row["occluded_share"]) >= 0.25,
    f"leaf below {FEW_PIXELS} pixels": lambda row: float(row["visible_leaf_px"]) < FEW_PIXELS,
    f"frame below {FEW_PIXELS} pixels": lambda row: float(row["visible_frame_px"]) < FEW_PIXELS,
    f"fewer than {FEW_MEASURED} measured pixels": lambda row: float(row["measured_px"]) < FEW_MEASURED,
    f"from nearer than {NEARBY_M:.0f} m": lambda row: float(row["distance_m"]) < NEARBY_M,
}
STUDIES = ("mixture-points", "transfer", "augmentation")  # shown below, once they are published
ANGLES = "transfer/mixture/angles"


def write_worlds_page(results_folder: Path, reports_folder: Path, page: Path) -> None:
    """Render the page once the mixture is published.

    Args:
        results_folder: holds a folder for each published experiment and each data set, rows alone.
        reports_folder: holds `<experiment>/report` of each, made before.
        page: where to.
    """
    mixture = results_folder / MIXTURE
    if not mixture.is_dir() or not whole_folds(mixture):
        return
    published = {
        where: _open(results_folder / where, results_folder)
        for where in (MIXTURE, ANGLES, CLUTTER, AT_4096)
        if (results_folder / where).is_dir()
    }
    results, dataset = published[MIXTURE]
    tables = {
        name: {
            path.stem: path.read_text(encoding="utf-8").strip()
            for path in (reports_folder / name / "report" / "tables").glob("*.md")
        }
        for name in (MIXTURE, *STUDIES)
    }
    rules = results.comparison.rules
    networks = tuple(method for method in results.networks if method not in rules)
    rows = {row["sample_id"]: row for row in dataset.rows}
    cases = cases_table(results, rows, results.networks, CASES)
    render(
        "generalization.md.j2",
        page,
        results=results,
        targets=targets_table(published, networks).to_markdown().strip(),
        mixture=MIXTURE,
        tables=tables,
        by_angle=_by_factor(published.get(ANGLES), ANGLE),
        by_occlusion=_by_factor(published.get(CLUTTER), OCCLUSION),
        trained=max(int(run.metric("train_samples")) for run in results.runs if run.network in networks),
        cases=cases.to_markdown().strip() if rules else "",
        rules=rules,
        untrained=[
            title for name, title in NAMES.items() if name in list_networks() and name not in networks
        ],
        lost=_lost(cases, rules),
        waiting=[NAMES[name] for name in networks if not _epochs(mixture, name)],
    )


def _epochs(comparison: Path, network: str) -> int:
    """Of training, 0 where weights that were there before are tested; at least one where nobody says."""
    recipes = read_json(comparison / "comparison.json").get("recipe", {})
    return int(recipes.get(network, {}).get("epochs", 1))


def _open(comparison: Path, results_folder: Path) -> Published:
    folder = rows_of(comparison, results_folder)
    return Published(load_results(comparison, folder), open_dataset(folder))


def _by_factor(published: Published | None, factor: str) -> str:
    """Accuracy of every method by a factor, of test clouds made for it, as Markdown; "" until that is published."""
    if published is None:
        return ""
    results, dataset = published
    bins = [each for each in factor_bins(results, dataset) if each.factor == factor]
    accuracy = {(each.method, each.low): number(each.right / each.samples) for each in bins}
    first = [each for each in bins if each.method == results.networks[0]]
    rows = tuple(
        (
            f"{each.low:g} to {each.high:g}",
            str(each.samples),
            *(accuracy[method, each.low] for method in results.networks),
        )
        for each in first
    )
    columns = (factor, "samples", *(NAMES.get(method, method) for method in results.networks))
    return Table(f"Accuracy by {factor}", columns, rows).to_markdown().strip()


def _lost(cases: Table, rules: Sequence[str]) -> list[str]:
    """Cases in which some rule is right more often than every network."""
    shares = [dict(zip(cases.columns, row, strict=True)) for row in cases.rows]
    methods = cases.columns[2:]
    return [
        row["samples"]
        for row in shares
        if rules
        and max(float(row[method]) for method in methods if method in rules)
        > max(float(row[method]) for method in methods if method not in rules)
    ]

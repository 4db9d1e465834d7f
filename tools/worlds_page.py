# SPDX-License-Identifier: Apache-2.0
"""docs/worlds.md, what the mixture's weights reach and how far they carry: words are in the .j2, figures computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from duels import FEW_PIXELS, NEARBY_M, cases_table
from published import rows_of
from results_page import NAMES, render, whole_folds

from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.factors import ANGLE, OCCLUSION, factor_bins
from doorstate.evaluation.head_tables import answer_errors
from doorstate.evaluation.metrics import confusion_matrix, scores
from doorstate.evaluation.results import ComparisonResults, load_results
from doorstate.evaluation.stratum_tables import is_undecidable
from doorstate.evaluation.stratum_tables import rows_of as manifest_of
from doorstate.evaluation.table import Table, number
from doorstate.networks import list_networks

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
MIXTURE = "mixture-1024"  # the comparison of the page
STUDIES = ("mixture-points", "transfer", "augmentation")  # shown below, once they are published
ANGLES, CLUTTER = (f"transfer/mixture/{name}" for name in ("angles", "cluttered"))


class Published(NamedTuple):
    """A published comparison, and the rows of what it tested."""

    results: ComparisonResults
    dataset: PreparedDataset


class Target(NamedTuple):
    """Something that was asked for, and how well a network does at it."""

    words: str
    bound: float
    more_is_better: bool
    digits: int
    found: Callable[[ComparisonResults, PreparedDataset, str], float]
    where: str = MIXTURE  # published comparison that tells

    def reached(self, value: float) -> bool:
        """Whether a figure is good enough; one that nobody knows is not."""
        return bool(value >= self.bound if self.more_is_better else value <= self.bound)


def _noisy_macro_f1(
    results: ComparisonResults, dataset: PreparedDataset, network: str, undecidable: bool = True
) -> float:
    pooled = results.pooled(network)
    chosen = np.array(
        [
            row["sensor"] == "xtion"
            and row["pose_id"].startswith("varied-")
            and (undecidable or not is_undecidable(row))
            for row in manifest_of(dataset, pooled)
        ]
    )
    return float(scores(confusion_matrix(pooled.true[chosen], pooled.predicted[chosen])).macro.f1)


def _points_lost(results: ComparisonResults, dataset: PreparedDataset, network: str) -> float:
    """By clutter that hides up to a quarter of a door, against none of it, in points of accuracy."""
    pooled = results.pooled(network)
    rows = manifest_of(dataset, pooled)
    bins = np.array([row["occluded_bin"] for row in rows])
    free, hidden = (pooled.right[bins == name] for name in ("0", "0-25"))
    return 100 * float(free.mean() - hidden.mean())


def _calibration_error(results: ComparisonResults, dataset: PreparedDataset, network: str) -> float:
    found = calibrate(results, network)
    return float("nan") if found is None else 100 * reliability(found.true, found.scaled).error


def _head(name: str, factor: float = 1.0) -> Callable[[ComparisonResults, PreparedDataset, str], float]:
    def found(results: ComparisonResults, dataset: PreparedDataset, network: str) -> float:
        given = results.answers(network)
        return float("nan") if given is None else factor * answer_errors(given, dataset)[name]

    return found


TARGETS = (
    Target("macro F1 of three states, `varied` as an Xtion sees it", 0.97, True, 4, _noisy_macro_f1),
    Target(
        "the same without frames that look alike in another state",
        0.97,
        True,
        4,
        partial(_noisy_macro_f1, undecidable=False),
    ),
    Target("AUROC of *there is a door*", 0.99, True, 4, _head("door, AUROC")),
    Target("expected calibration error, %", 3, False, 1, _calibration_error),
    Target(
        "opening angle of semi-open doors, mean error, °",
        5,
        False,
        1,
        _head("opening angle, semi-open: mean error, °"),
    ),
    Target("hinge side, % right", 98, True, 1, _head("hinge side", 100)),
    Target("of doors that are not closed", 98, True, 1, _head("of doors not closed", 100)),
    Target("frame position, median error, cm", 8, False, 1, _head("frame position: median error, m", 100)),
    Target("frame yaw, median error, °", 4, False, 1, _head("yaw: median error, °")),
    Target(
        "points of accuracy lost where up to a quarter of the door is hidden",
        3,
        False,
        1,
        _points_lost,
        CLUTTER,
    ),
)


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
        for where in (MIXTURE, ANGLES, CLUTTER)
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
        "worlds.md.j2",
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
    )


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


def targets_table(published: Mapping[str, Published], networks: Sequence[str]) -> Table:
    """What was asked for, and what every network reaches; what is not published yet nobody knows.

    Args:
        published: comparisons by where they lie in the folder of everything published.
        networks: in the order of columns.
    """
    rows = []
    for target in TARGETS:
        found = dict.fromkeys(networks, float("nan"))
        if target.where in published:
            results, dataset = published[target.where]
            found |= {
                network: target.found(results, dataset, network)
                for network in results.networks
                if network in networks
            }
        good = [NAMES[network] for network in networks if target.reached(found[network])]
        rows.append(
            (
                target.words,
                f"{'≥' if target.more_is_better else '≤'} {target.bound:g}",
                *(number(found[network], target.digits) for network in networks),
                "all" if len(good) == len(networks) else ", ".join(good) or "none",
            )
        )
    columns = ("", "asked for", *(NAMES[network] for network in networks), "reached by")
    return Table("What was asked for, and what is reached", columns, tuple(rows))

# SPDX-License-Identifier: Apache-2.0
"""docs/results.md and docs/related.md from the committed predictions: words are in the .j2, figures are computed."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._files import write_text
from doorstate.clouds.preparation import NUM_POINTS
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.join import load_joined
from doorstate.evaluation.metrics import Scores, scores
from doorstate.evaluation.resolution import load_resolution, resolution_table
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.evaluation.table import UNDEFINED, Table, number
from doorstate.training.recipes import AUTHORS
from doorstate.training.run_folder import read_json, run_of
from doorstate.types import STATES

from ..publish import rows_of
from .pairwise import NEARBY_M, cases_table, duels_table, near_the_border, never_seen_table
from .places import places_cases
from .templates import template

# What the page is about, or costs beside it.
SHOWN = ("paper", "by-pose", "by-pose-mirrored", "authors", "related")
ASKED = 0.995  # macro-F1 that every network should reach
ASKED_NEVER_SEEN = 0.99  # that the best should reach on poses never seen
BENCHMARK = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "networks.json"
NAMES = {
    "pointnet": "PointNet",
    "pointnet2": "PointNet++",
    "dgcnn": "DGCNN",
    "pointcnn": "PointCNN",
    "point2sequence": "Point2Sequence",
    "mvcnn": "MVCNN",
    "open_door": "open-door rule",
    "plane_state": "plane state",
    "wall_leaf_angle": "wall and leaf",
    "angle_bins": "angle bins",
    "depth_region": "depth region",
}


@dataclass(frozen=True)
class Published:
    """One comparison as the page speaks of it."""

    results: ComparisonResults
    rows: dict[str, dict[str, str]]  # of the manifest, by sample
    tables: dict[str, str]  # Markdown, by name
    scores: dict[str, Scores]  # pooled, by network
    confusion: dict[str, np.ndarray]

    def macro_f1(self, network: str) -> float:
        return float(self.scores[network].macro.f1)

    def errors(self, network: str) -> int:
        """Test samples that a network got wrong."""
        counts = self.confusion[network]
        return int(counts.sum() - np.trace(counts))

    def silent(self, method: str) -> int:
        """Test samples to which a method gave no answer."""
        return int(self.confusion[method][:, len(STATES) :].sum())

    def best(self) -> str:
        """Name of the network with the largest macro-F1."""
        return max(self.results.networks, key=self.macro_f1)

    def below(self, bound: float) -> list[str]:
        """Networks whose pooled macro-F1 is below a bound."""
        return [name for name in self.results.networks if self.macro_f1(name) < bound]

    def least(self) -> float:
        """Lowest of all precisions, recalls and F1 of all networks and states."""
        return min(float(np.min([s.precision, s.recall, s.f1])) for s in self.scores.values())

    def least_validation(self) -> float:
        """Lowest macro-F1 of all runs on their validation samples."""
        return min(run.metric("val_macro_f1") for run in self.results.runs)

    def lowest_recall(self, state: str) -> tuple[list[str], float]:
        """Networks with the lowest recall of a state, several where they are equal, and that recall."""
        index = STATES.index(state)
        recalls = {name: float(self.scores[name].recall[index]) for name in self.results.networks}
        least = min(recalls.values())
        return [name for name, recall in recalls.items() if recall == least], least

    def kinds_of_errors(self) -> tuple[int, int, int]:
        """Errors of all networks; those whose opening is near the other state's; of the rest those taken nearby."""
        errors = [self.rows[error.sample_id] for error in self.results.error_rows]
        far = [row for row in errors if not near_the_border(row)]
        nearby = sum(float(row["distance_m"]) < NEARBY_M for row in far)
        return len(errors), len(errors) - len(far), nearby

    def hits(self, network: str, state: str) -> tuple[int, int]:
        """Recognised samples of a state, and all of them."""
        row = self.confusion[network][STATES.index(state)]
        return int(row[STATES.index(state)]), int(row.sum())


def write_pages(results_folder: Path, reports_folder: Path, results_page: Path, related_page: Path) -> None:
    """Render both pages; that of the related work once it is published beside the paper's networks.

    Args:
        results_folder: holds one folder for each published experiment, and one for each data set, rows alone.
        reports_folder: holds `<experiment>/report` of each complete one, made before.
        results_page: of the five networks.
        related_page: of the methods beside them.
    """
    found = [path.parent for path in sorted(results_folder.glob("*/comparison.json"))]
    folders = [folder for folder in found if folder.name in SHOWN]
    waiting = {folder.name: unfinished_runs(folder) for folder in folders}
    published = {
        folder.name: _published([folder], reports_folder) for folder in folders if whole_folds(folder)
    }
    resolution = results_folder / "resolution"
    render(
        "results.md.j2",
        results_page,
        published=published,
        waiting={name: runs for name, runs in waiting.items() if runs},
        budget=_table(budget_table(list(published.values()))),
        gap=_both(published, "by-pose", gap_table),
        places=_table(places_table(published["by-pose"])) if "by-pose" in published else None,
        cuts=_both(published, "authors", lambda paper, authors: cuts_table(authors, paper)),
        asked=ASKED,
        asked_never_seen=ASKED_NEVER_SEEN,
        resolution=_table(
            resolution_table(load_resolution(resolution, rows_of(results_folder / "paper", results_folder)))
        )
        if resolution.is_dir()
        else None,
    )
    if "paper" in published and "related" in published:
        both = [results_folder / name for name in ("paper", "related")]
        every = _published(both, reports_folder)
        render("related.md.j2", related_page, all=every, **_duels(every, published.get("by-pose")))


def _duels(every: Published, by_pose: Published | None) -> dict[str, Any]:
    """Rules that tell all three states against networks; nothing where there are none."""
    networks = every.results.comparison.networks
    rules = [name for name in every.results.comparison.rules if every.hits(name, "semi_open")[0]]
    if not rules:
        return {"best_rule": None}
    best_rule = max(rules, key=every.macro_f1)
    return {
        "best_network": max(networks, key=every.macro_f1),
        "best_rule": best_rule,
        "beaten": [name for name in networks if every.macro_f1(name) < every.macro_f1(best_rule)],
        "duels": _table(duels_table(every.results, rules, networks)),
        "cases": _table(cases_table(every.results, every.rows, (*rules, *networks))),
        "never_seen": _table(never_seen_table(every.results, by_pose.results, rules)) if by_pose else None,
    }


def _both(
    published: Mapping[str, Published], name: str, make: Callable[[Published, Published], Table]
) -> str | None:
    """A table of the paper's protocol and another experiment, once both are there."""
    if not {"paper", name} <= set(published):
        return None
    return _table(make(published["paper"], published[name]))


def render(name: str, page: Path, **content: Any) -> None:
    text = template(name).render(
        **content,
        names=NAMES,
        states=STATES,
        percent=lambda value, digits=2: f"{100 * value:.{digits}f} %",
    )
    write_text(page, re.sub(r"\n{3,}", "\n\n", text).strip() + "\n")


def unfinished_runs(folder: Path) -> list[str]:
    """Runs of a published comparison that are not there yet, as `network fold k`."""
    return [
        f"{method} fold {fold}" for method, fold in _runs(folder) if not run_of(folder, method, fold).finished
    ]


def whole_folds(folder: Path) -> int:
    """How many folds, from the first on, all methods of a published comparison have finished: these are shown."""
    missing = [fold for method, fold in _runs(folder) if not run_of(folder, method, fold).finished]
    folds: int = read_json(folder / "comparison.json")["folds"]
    return min(missing, default=folds)


def _runs(folder: Path) -> list[tuple[str, int]]:
    asked = read_json(folder / "comparison.json")
    methods = (*asked["networks"], *asked.get("rules", ()))
    return [(method, fold) for fold in range(asked["folds"]) for method in methods]


def budget_table(published: list[Published]) -> Table:
    """What every network cost, and what the same epochs at all points would cost with a public port."""
    port_ms = _port_milliseconds()
    rows = []
    total_hours = 0.0
    for each in published:
        # Ports were timed at 4096 points.
        at_all_points = each.results.comparison.num_points == NUM_POINTS
        costs = defaultdict(list)
        for run in each.results.runs:
            epochs = len(run.log["epoch"]) if run.log else 0
            threads = int(run.environment.get("threads", 1))
            clouds = epochs * run.metric("train_samples")
            costs[run.network].append((run.metric("seconds"), threads, epochs, clouds))
        for network, runs in costs.items():
            if not any(epochs for _, _, epochs, _ in runs):
                continue  # a rule learns nothing
            seconds, threads, epochs, clouds = (sum(column) for column in zip(*runs, strict=True))
            port = clouds * port_ms[network] / 3.6e6 if network in port_ms and at_all_points else float("nan")
            core_hours = sum(run[0] * run[1] for run in runs) / 3600
            rows.append(
                (
                    each.results.comparison.name,
                    network,
                    str(len(runs)),
                    number(epochs / len(runs), 0),
                    number(seconds / len(runs) / 60, 0),
                    number(core_hours, 1),
                    number(2 * port, 0),
                )
            )
            total_hours += core_hours
    if rows:
        rows.append(("all", *[""] * 4, number(total_hours, 1), ""))
    columns = ("experiment", "network", "runs", "epochs", "minutes a run", "core hours", "core hours, port")
    note = (
        "Port: the same number of epochs at 4096 points with the public port, from its measured training step "
        f"(docs/benchmarks/networks.md, two cores). {UNDEFINED}: no port was measured at these "
        "points. Runs were trained two at a time, mostly beside other work: alone they take less."
    )
    return Table("What the runs cost", columns, tuple(rows), note, text_columns=2)


def gap_table(paper: Published, other: Published) -> Table:
    """Macro-F1 and errors of every network under two protocols."""
    rows = tuple(
        (
            network,
            number(paper.macro_f1(network)),
            number(other.macro_f1(network)),
            number(other.macro_f1(network) - paper.macro_f1(network)),
            f"{paper.errors(network)} of {int(paper.confusion[network].sum())}",
            f"{other.errors(network)} of {int(other.confusion[network].sum())}",
        )
        for network in other.results.networks
        if network in paper.results.networks
    )
    names = [each.results.comparison.name for each in (paper, other)]
    columns = (
        "network",
        *(f"macro F1, {name}" for name in names),
        "difference",
        *(f"errors, {name}" for name in names),
    )
    return Table("The same recipe under both protocols", columns, rows)


def places_table(by_pose: Published) -> Table:
    """Accuracy of every network by what was learned around the tested place."""
    cases = places_cases(by_pose.results, by_pose.rows)
    return cases_table(by_pose.results, by_pose.rows, by_pose.results.networks, cases)


def cuts_table(authors: Published, common: Published) -> Table:
    """What the authors' recipes were cut to, and the common recipe on the same fold."""
    rows = []
    for run in authors.results.runs:
        full = AUTHORS[run.network].epochs
        same = next((r for r in common.results.runs if (r.network, r.fold) == (run.network, run.fold)), None)
        rows.append(
            (
                run.network,
                str(run.fold),
                f"{len(run.log['epoch'])} of {full}" if run.log else UNDEFINED,
                number(run.metric("test_macro_f1")),
                UNDEFINED if same is None else number(same.metric("test_macro_f1")),
            )
        )
    columns = ("network", "fold", "epochs", "macro F1, authors' recipe", "macro F1, common recipe")
    return Table("The authors' recipes beside the common one", columns, tuple(rows))


def _published(folders: Sequence[Path], reports_folder: Path) -> Published:
    rows_folder = rows_of(folders[0], folders[0].parent)
    results = load_joined(folders, rows_folder, min(whole_folds(folder) for folder in folders))
    tables = reports_folder / folders[-1].name / "report" / "tables"
    confusion = {network: pooled_confusion(results, network) for network in results.networks}
    return Published(
        results,
        {row["sample_id"]: row for row in open_dataset(rows_folder).rows},
        {path.stem: path.read_text(encoding="utf-8").strip() for path in tables.glob("*.md")},
        {network: scores(counts) for network, counts in confusion.items()},
        confusion,
    )


def _port_milliseconds() -> dict[str, float]:
    groups = json.loads(BENCHMARK.read_text(encoding="utf-8"))["groups"].values()
    return {
        group["network"]: row["train_ms"]
        for group in groups
        if group["points"] == 4096
        for row in group["rows"]
        if row["form"] == "port"
    }


def _table(table: Table) -> str:
    return table.to_markdown().strip()

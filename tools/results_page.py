# SPDX-License-Identifier: Apache-2.0
"""docs/results.md and docs/related.md from the committed predictions: words are in the .j2, figures are computed."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from templates import template

from doorstate.evaluation.join import load_joined
from doorstate.evaluation.metrics import Scores, scores
from doorstate.evaluation.resolution import load_resolution, resolution_table
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.evaluation.table import UNDEFINED, Table, number
from doorstate.files import write_text
from doorstate.training.comparison import run_of
from doorstate.training.run_folder import read_json
from doorstate.types import STATES

BENCHMARK = Path(__file__).resolve().parents[1] / "docs" / "benchmarks" / "networks.json"
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
    tables: dict[str, str]  # Markdown, by name
    scores: dict[str, Scores]  # pooled, by network
    confusion: dict[str, np.ndarray]

    def macro_f1(self, network: str) -> float:
        return float(self.scores[network].macro.f1)

    def best(self) -> str:
        return max(self.results.networks, key=self.macro_f1)

    def below(self, bound: float) -> list[str]:
        """Names of networks whose pooled macro-F1 is below a bound."""
        return [NAMES[name] for name in self.results.networks if self.macro_f1(name) < bound]

    def least(self) -> float:
        """Lowest of all precisions, recalls and F1 of all networks and states."""
        return min(float(np.min([s.precision, s.recall, s.f1])) for s in self.scores.values())

    def lowest_recall(self, state: str) -> tuple[str, float]:
        """Network with the lowest recall of a state."""
        index = STATES.index(state)
        network = min(self.results.networks, key=lambda name: self.scores[name].recall[index])
        return NAMES[network], float(self.scores[network].recall[index])

    def hits(self, network: str, state: str) -> tuple[int, int]:
        """Recognised samples of a state, and all of them."""
        row = self.confusion[network][STATES.index(state)]
        return int(row[STATES.index(state)]), int(row.sum())


def write_pages(
    results_folder: Path, rows_folder: Path, reports_folder: Path, results_page: Path, related_page: Path
) -> None:
    """Render both pages; that of the related work once it is published beside the paper's networks.

    Args:
        results_folder: holds one folder for each published experiment.
        rows_folder: the data set, rows alone.
        reports_folder: holds `<experiment>/report` of each complete one, made before.
        results_page: of the five networks.
        related_page: of the methods beside them.
    """
    folders = [path.parent for path in sorted(results_folder.glob("*/comparison.json"))]
    waiting = {folder.name: unfinished_runs(folder) for folder in folders}
    published = {
        folder.name: _published([folder], rows_folder, reports_folder)
        for folder in folders
        if whole_folds(folder)
    }
    resolution = results_folder / "resolution"
    _render(
        "results.md.j2",
        results_page,
        published=published,
        waiting={name: runs for name, runs in waiting.items() if runs},
        budget=_table(budget_table(list(published.values()))),
        resolution=_table(resolution_table(load_resolution(resolution, rows_folder)))
        if resolution.is_dir()
        else None,
    )
    if "paper" in published and "related" in published:
        both = [results_folder / name for name in ("paper", "related")]
        _render("related.md.j2", related_page, all=_published(both, rows_folder, reports_folder))


def _render(name: str, page: Path, **content: Any) -> None:
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
    for each in published:
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
            port = clouds * port_ms[network] / 3.6e6 if network in port_ms else float("nan")
            core_hours = sum(run[0] * run[1] for run in runs) / 3600
            rows.append(
                (
                    each.results.comparison.name,
                    NAMES[network],
                    str(len(runs)),
                    number(epochs / len(runs), 0),
                    number(seconds / len(runs) / 60, 0),
                    number(core_hours, 1),
                    number(2 * port, 0),
                )
            )
    columns = ("experiment", "network", "runs", "epochs", "minutes a run", "core hours", "core hours, port")
    note = (
        "Port: the same number of epochs at 4096 points with the public port, from its measured training step "
        f"(docs/benchmarks/networks.md, two cores). {UNDEFINED}: no port was measured."
    )
    return Table("What the runs cost", columns, tuple(rows), note, text_columns=2)


def _published(folders: Sequence[Path], rows_folder: Path, reports_folder: Path) -> Published:
    results = load_joined(folders, rows_folder, min(whole_folds(folder) for folder in folders))
    tables = reports_folder / folders[-1].name / "report" / "tables"
    confusion = {network: pooled_confusion(results, network) for network in results.networks}
    return Published(
        results,
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

# SPDX-License-Identifier: Apache-2.0
"""Accuracy against the number of points, and what each point costs in time, from the folders of a study."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from doorstate._files import read_csv
from doorstate.errors import RunError
from doorstate.evaluation.figures import encode_figures, save_drawings
from doorstate.evaluation.metrics import scores
from doorstate.evaluation.results import load_results
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.evaluation.table import Table, number
from doorstate.evaluation.tables import save_tables
from doorstate.evaluation.views import NETWORK_COLORS, graph_axes
from doorstate.training.run_folder import AS_TRAINED, FINE_TUNED

LATENCY = "latency.csv"
_NAN = float("nan")
_FRAME_MS = 1000 / 30


@dataclass(frozen=True)
class ResolutionResults:
    """Macro-F1 by (network, points), as trained and fine-tuned, and milliseconds from raw cloud to answer."""

    networks: tuple[str, ...]
    points: tuple[int, ...]
    as_trained: dict[tuple[str, int], float]
    fine_tuned: dict[tuple[str, int], float]
    milliseconds: dict[tuple[str, int], float]

    def best(self, network: str, points: int) -> float:
        """Macro-F1 of the weights made for this number of points."""
        return self.fine_tuned.get((network, points), self.as_trained.get((network, points), _NAN))


def load_resolution(folder: Path, dataset_folder: Path | None = None) -> ResolutionResults:
    """Read the folders of a study; what is not there yet, on all folds, is left out.

    Raises:
        RunError: nothing is there, or a comparison cannot be used.
    """
    found: dict[str, dict[tuple[str, int], float]] = {AS_TRAINED: {}, FINE_TUNED: {}}
    networks: dict[str, None] = {}
    for path in sorted(folder.glob("*/comparison.json")):
        kind, _, points = path.parent.name.rpartition("-")
        if kind not in found or not any(path.parent.glob("runs/*/*/predictions.csv")):
            continue
        results = load_results(path.parent, dataset_folder)
        partial = {network for network, _ in results.missing}  # on other folds: another question
        for network in results.networks:
            if network in partial:
                continue
            networks[network] = None
            macro = scores(pooled_confusion(results, network)).macro
            found[kind][network, int(points)] = float(macro.f1)
    if not networks:
        raise RunError(f"{folder}: holds no finished part of a resolution study")
    rows = read_csv(folder / LATENCY) if (folder / LATENCY).is_file() else []
    milliseconds = {(row["network"], int(row["points"])): float(row["median_ms"]) for row in rows}
    points_seen = sorted({points for kind in found.values() for _, points in kind})
    return ResolutionResults(
        tuple(networks), tuple(points_seen), found[AS_TRAINED], found[FINE_TUNED], milliseconds
    )


def fewest_points(
    results: ResolutionResults, network: str, fewest: int, trained: int, lost: float
) -> int | None:
    """The fewest points with which weights do as well as with those of their training, and with all between.

    Args:
        results: of a study.
        network: name.
        fewest: not fewer than these are looked for.
        trained: what the weights were trained with; with more, neither scores nor temperature were found.
        lost: how much less macro-F1 is as well.

    Returns:
        None if the study does not have the network on so many points.
    """
    known = [points for points in results.points if (network, points) in results.as_trained]
    counts = [points for points in known if points <= trained]
    enough = None
    for points in reversed(counts):
        if results.as_trained[network, points] < results.as_trained[network, counts[-1]] - lost:
            break
        if enough is None or points >= fewest:
            enough = points
    return enough


def resolution_table(results: ResolutionResults) -> Table:
    """A line for each network and number of points; a column for the fine-tuned only if there are some."""
    columns = [("macro F1, as trained", results.as_trained, 4)]
    if results.fine_tuned:
        columns.append(("macro F1, fine-tuned", results.fine_tuned, 4))
    columns.append(("ms from cloud to answer", results.milliseconds, 1))
    rows = tuple(
        (
            network,
            str(points),
            *(number(found.get((network, points), _NAN), digits) for _, found, digits in columns),
        )
        for network in results.networks
        for points in results.points
    )
    tuned = (
        "Fine-tuned: the same weights trained a little more on so many points. " if results.fine_tuned else ""
    )
    return Table(
        "Accuracy and time by number of points",
        ("network", "points", *(name for name, _, _ in columns)),
        rows,
        "As trained: finished weights given so many points of each cloud, whatever number they were trained with. "
        f"{tuned}Milliseconds: median from a raw 640 × 480 cloud in memory to the state, float32.",
    )


def resolution_figure(results: ResolutionResults) -> Figure:
    """Macro-F1 against points, and against milliseconds."""
    figure = Figure(figsize=(9.6, 3.9), layout="constrained")
    by_points, by_time = figure.subplots(1, 2, sharey=True)
    for network in results.networks:
        color = NETWORK_COLORS.get(network, "#333333")
        known = [points for points in results.points if (network, points) in results.as_trained]
        by_points.plot(
            known,
            [results.as_trained[network, points] for points in known],
            "o:",
            color=color,
            markerfacecolor="none",
            markersize=4,
            linewidth=1.0,
        )
        by_points.plot(
            known,
            [results.best(network, points) for points in known],
            "o-",
            color=color,
            markersize=4,
            linewidth=1.4,
            label=network,
        )
        timed = [points for points in known if (network, points) in results.milliseconds]
        by_time.plot(
            [results.milliseconds[network, points] for points in timed],
            [results.best(network, points) for points in timed],
            "o-",
            color=color,
            markersize=4,
            linewidth=1.4,
        )
    by_points.set_xscale("log", base=2)
    dotted = " (dotted: as trained, without fine-tuning)" if results.fine_tuned else ""
    by_points.set(xlabel=f"points{dotted}", ylabel="macro F1")
    by_points.set_xticks(results.points, [str(points) for points in results.points], minor=False)
    by_time.set(xlabel="ms from raw cloud to answer")
    by_time.axvline(_FRAME_MS, color="#999999", linewidth=0.8, linestyle="--")
    by_time.annotate(
        "one frame at 30 Hz",
        (_FRAME_MS, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize=8,
        color="#666666",
        xytext=(4, 0),
        textcoords="offset points",
    )
    for axis in (by_points, by_time):
        graph_axes(axis)
    by_points.legend(frameon=False, fontsize=8)
    return figure


def write_resolution(folder: Path, out_folder: Path, dataset_folder: Path | None = None) -> Path:
    """Write the table and the figure of a study.

    Args:
        folder: of the study.
        out_folder: made if absent; gets `tables/` and `figures/`.
        dataset_folder: its data set, if it is not where the comparisons say.

    Returns:
        `out_folder`.
    """
    results = load_resolution(folder, dataset_folder)
    save_tables({"resolution": resolution_table(results)}, out_folder / "tables")
    save_drawings(encode_figures({"resolution": resolution_figure(results)}), out_folder / "figures")
    return out_folder

# SPDX-License-Identifier: Apache-2.0
"""Published results: run them from nothing, publish what a run gave, build every table and figure, check them.

python tools/reproduce.py run paper            # data, all runs, report; goes on where it was stopped
python tools/reproduce.py publish paper        # runs/paper -> results/paper, without weights
python tools/reproduce.py build                # tables, figures, reports and docs/results.md from results/
python tools/reproduce.py restore mixture-wide # results/ -> runs/mixture-wide, with the packaged weights
python tools/reproduce.py again pointnet2 0    # one run from nothing: is it within the published spread?
python tools/reproduce.py check                # the same into a scratch folder: are the committed files those?
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from doorstate._jobs import default_workers
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.figures import Drawing, draw_dataset
from doorstate.evaluation.report import write_report

from .commands import REPOSITORY, doorstate
from .datasets import commands
from .publish import publish, restore, rows_of
from .studies import read_asked, write_study

RESULTS, RUNS, EXPERIMENTS = REPOSITORY / "results", REPOSITORY / "runs", REPOSITORY / "paper" / "experiments"
PAGES = tuple(Path("docs") / name for name in ("results.md", "related.md", "generalization.md"))
BESIDE = {"related": "paper"}  # is shown beside the methods of another comparison


def main(arguments: list[str]) -> None:
    """Dispatch."""
    command, names = (arguments[0], arguments[1:]) if arguments else ("", [])
    if command == "run" and len(names) == 1:
        run(names[0])
    elif command == "publish" and names:
        for name in names:
            publish(RUNS / name, RESULTS / name)
    elif command == "restore" and len(names) in (1, 2):
        restore(RESULTS / names[0], RUNS / names[0], *names[1:])
    elif command == "again" and len(names) == 2 and names[1].isdigit():
        sys.exit(again(names[0], int(names[1])))
    elif command == "build" and not names:
        build(REPOSITORY)
    elif command == "check" and not names:
        sys.exit(check())
    else:
        sys.exit(__doc__)


def run(name: str) -> None:
    """Simulate, prepare and run one experiment, and before it those it begins with; every step prints its command."""
    asked = read_asked(EXPERIMENTS / f"{name}.toml")
    for before in asked.begins_with:
        if not _is_finished(RUNS / before):
            run(before)
    for dataset in asked.datasets:
        for command in commands(REPOSITORY / dataset):
            doorstate(command.arguments, command.makes)
    doorstate(f"{asked.command} paper/experiments/{name}.toml --jobs 2")
    if asked.command == "compare" and asked.content.get("protocol") != "all":
        doorstate(f"report runs/{name}")


def again(network: str, fold: int, name: str = "paper") -> str | None:
    """Train one published run from nothing; a message if its test macro-F1 leaves the published spread.

    The spread is twice the sample standard deviation over the published folds, around the fold's own figure, and not
    less than two samples: another machine rounds differently and so trains other weights.
    """
    from doorstate.cli.run_display import live_runs
    from doorstate.evaluation.metrics import mean_and_deviation
    from doorstate.training.comparison import RunSpec, train_fold
    from doorstate.training.experiment import load_experiment
    from doorstate.training.run_folder import RunFolder, run_of

    experiment = load_experiment(EXPERIMENTS / f"{name}.toml", {})
    published = [run_of(RESULTS / name, network, each) for each in range(experiment.folds)]
    if not all(run.finished for run in published):
        return f"results/{name}: not all folds of {network} are published"
    scores = [run.read_metrics()["test_macro_f1"] for run in published]
    _, deviation = mean_and_deviation(scores)
    spread = max(2 * deviation, 2 / published[fold].read_metrics()["test_samples"])
    folder = RunFolder(RUNS / "again" / name / network / f"fold{fold}")
    with live_runs(
        [RunSpec(network, fold, folder)], {network: experiment.recipe_of(network)}, experiment.num_points, 1
    ):
        found = train_fold(
            experiment,
            folder.path,
            open_dataset(Path(experiment.dataset)),
            network,
            fold,
            RESULTS / name / "splits.csv",
        )["test_macro_f1"]
    line = f"{network}, fold {fold}: {found:.4f}, published {scores[fold]:.4f}, spread {spread:.4f}"
    if abs(found - scores[fold]) > spread:
        return f"{line}: outside"
    print(line)
    return None


def build(root: Path) -> None:
    """Write everything that follows from the committed predictions below `root`."""
    from .pages.generalization import write_worlds_page
    from .pages.results import write_pages

    # spawn: a forked child of a process that runs BLAS threads can hang.
    with ProcessPoolExecutor(default_workers(), multiprocessing.get_context("spawn")) as pool:
        longest_first = sorted(_comparisons(), key=lambda each: len(each[0]) * each[1], reverse=True)
        datasets = {rows_of(folders[-1], RESULTS) for folders, _ in longest_first}
        drawn = {dataset: pool.submit(_draw_dataset, dataset) for dataset in sorted(datasets)}
        waiting = [
            pool.submit(write_study, asked, RESULTS, root / "results" / asked.name / "report")
            for asked in map(read_asked, sorted(EXPERIMENTS.glob("*.toml")))
            if asked.command != "compare" and (RESULTS / asked.name).is_dir()
        ]
        for folders, folds in longest_first:
            dataset = rows_of(folders[-1], RESULTS)
            out = root / "results" / folders[-1].name / "report"
            of_dataset = drawn[dataset].result()
            waiting.append(pool.submit(write_report, folders, out, dataset, folds, of_dataset))
        for each in waiting:
            each.result()
    results_page, related_page, worlds_page = (root / page for page in PAGES)
    write_pages(RESULTS, root / "results", results_page, related_page)
    write_worlds_page(RESULTS, root / "results", worlds_page)


def check() -> str | None:
    """Build anew and compare byte for byte; a message if anything differs."""
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        build(root)
        made = {path.relative_to(root) for path in root.rglob("*") if path.is_file()}
        committed = {
            path.relative_to(REPOSITORY)
            for folder in RESULTS.glob("*/report")
            for path in folder.rglob("*")
            if path.is_file()
        } | {page for page in PAGES if (REPOSITORY / page).is_file()}
        lines = [f"{path}: not made any more" for path in sorted(committed - made)]
        for path in sorted(made):
            published = REPOSITORY / path
            if not published.is_file():
                lines.append(f"{path}: not committed")
            elif published.read_bytes() != (root / path).read_bytes():
                lines.append(f"{path}: differs")
    if lines:
        return "\n".join([*lines, "python tools/reproduce.py build writes them anew"])
    print(f"{len(made)} files follow from the committed predictions, byte for byte")
    return None


def _is_finished(comparison: Path) -> bool:
    """Whether all runs are there, be it that they were restored: what they begin with is then not needed."""
    from .pages.results import unfinished_runs

    return (comparison / "comparison.json").is_file() and not unfinished_runs(comparison)


def _draw_dataset(folder: Path) -> dict[str, Drawing]:
    return draw_dataset(open_dataset(folder))


def _comparisons() -> Iterator[tuple[list[Path], int]]:
    """Published comparisons, those shown as one together, and how many folds all have finished; at least one."""
    from .pages.results import whole_folds

    for path in sorted(RESULTS.glob("*/comparison.json")):
        beside = BESIDE.get(path.parent.name)
        folders = [*([RESULTS / beside] if beside else []), path.parent]
        if folds := min(whole_folds(folder) for folder in folders):
            yield folders, folds


if __name__ == "__main__":
    main(sys.argv[1:])

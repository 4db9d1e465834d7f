# SPDX-License-Identifier: Apache-2.0
"""Command line of the paper: run, publish and render experiments, package weights, write pages, check all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__)

Name = Annotated[str, typer.Argument(help="File of paper/experiments/, without .toml.")]


@app.command()
def run(experiment: Name) -> None:
    """Make the data of an experiment and run it, from nothing or from where it stopped."""
    from .run import run as run_experiment

    run_experiment(experiment)


@app.command()
def repeat(
    network: Annotated[str, typer.Argument(help="Network of the experiment.")],
    fold: Annotated[int, typer.Argument(help="Fold, from 0.")],
    experiment: Annotated[str, typer.Option(help="Published comparison.")] = "paper",
) -> None:
    """Train one published run from nothing; exit code 1 if its score leaves the published spread."""
    from .run import repeat_run

    now, before, allowed = repeat_run(network, fold, experiment)
    print(
        f"{network}, fold {fold}: macro F1 {now:.4f}, published {before:.4f}, allowed difference {allowed:.4f}"
    )
    if abs(now - before) > allowed:
        raise typer.Exit(1)


@app.command()
def publish(experiments: Annotated[list[str], typer.Argument(help="Experiments in runs/.")]) -> None:
    """Write finished runs into results/."""
    from .publish import publish as publish_experiment

    for name in experiments:
        print(publish_experiment(name))


@app.command()
def report(
    experiment: Name,
    out: Annotated[Path | None, typer.Option(help="Folder; build/EXPERIMENT if not given.")] = None,
) -> None:
    """Render tables, figures and HTML of a published experiment."""
    from .report import write_published_report

    print(write_published_report(experiment, out))


@app.command()
def cost(
    experiment: Annotated[str, typer.Argument(help="Published comparison.")] = "paper",
    places: Annotated[
        list[int] | None, typer.Option(help="Cores or GPUs, each with one run; repeatable.", min=1)
    ] = None,
    speedup: Annotated[float, typer.Option(help="Speed of a place, in cores of the published runs.")] = 1.0,
    price: Annotated[float, typer.Option(help="Price of one place for an hour.", min=0)] = 0.0,
) -> None:
    """Reckon time and money of an experiment's trainings on other machines, from the seconds that they took."""
    from .cost import reckon_cost

    for number in places or (2, 64):
        reckoned = reckon_cost(experiment, number, speedup)
        money = f", {number * reckoned.hours * price:.2f} for all places" if price else ""
        print(f"{number} places: {reckoned.hours:.1f} h ({reckoned.run_hours:.1f} h of runs){money}")


@app.command()
def pages() -> None:
    """Write the pages of docs/ that are computed."""
    from .pages.render import write_pages

    for path in write_pages():
        print(path)


@app.command()
def pictures(
    names: Annotated[
        list[str] | None, typer.Argument(help="Pictures of docs/images; all if not given.")
    ] = None,
) -> None:
    """Draw the pictures of docs/images."""
    from .pictures import draw

    for path in draw(names or ()):
        print(path)


@app.command()
def weights(
    experiment: Name,
    prefix: Annotated[str, typer.Option(help="Prefix of the names of the files.")] = "",
    networks: Annotated[
        str, typer.Option(help="Networks, separated by commas; all that are trained if empty.")
    ] = "",
    out: Annotated[Path | None, typer.Option(help="Folder; that of the package if not given.")] = None,
) -> None:
    """Store trained weights as float16 with calibration and model cards."""
    from .weights import package_weights

    chosen = [name.strip() for name in networks.split(",") if name.strip()]
    for path in package_weights(experiment, prefix, chosen, out):
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


@app.command()
def graphs(
    names: Annotated[list[str] | None, typer.Argument(help="Packaged weights; all if not given.")] = None,
) -> None:
    """Write the ONNX graphs of packaged weights again, after a change of a network or of the exporter."""
    from .weights import package_graphs

    for path in package_graphs(names or ()):
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


@app.command()
def finder(
    folder: Annotated[Path, typer.Option(help="Folder of the simulated walls.")] = Path("data/finder"),
    share: Annotated[float, typer.Option(min=0.001, max=1, help="Share of the scenes.")] = 1.0,
    steps: Annotated[int, typer.Option(min=1, help="Steps of the training.")] = 30_000,
    out: Annotated[Path | None, typer.Option(help="ONNX file; that of the package if not given.")] = None,
) -> None:
    """Simulate walls, and train the network that finds doorways on them."""
    from importlib.resources import files

    from doorstate.cli.progress import progress_bar

    from .finder.samples import make_samples
    from .finder.train import export_scorer, train_scorer

    with progress_bar("Simulating") as progress:
        samples = make_samples(folder, share, progress=progress)
    with progress_bar("Training") as progress:
        network = train_scorer(samples, steps, progress=progress)
    path = out or Path(str(files("doorstate.doorways"))) / "column_scorer.onnx"
    export_scorer(network, path)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


@app.command()
def frames(
    recordings: Annotated[Path, typer.Argument(help="Folder of recorded frames with an index.csv.")],
) -> None:
    """Publish predictions on recorded frames, which are not in the repository, into results/real."""
    from doorstate.cli.progress import progress_bar

    from .frames import publish_frames

    with progress_bar("Predicting") as progress:
        print(publish_frames(recordings, progress))


@app.command()
def answers(
    names: Annotated[
        list[str] | None, typer.Argument(help="Packaged weights; all of them if not given.")
    ] = None,
    count: Annotated[int, typer.Option(help="Number of simulated doors.", min=3)] = 300,
) -> None:
    """Count how often packaged weights answer, and how often rightly, for `doorstate info` and the zoo."""
    from doorstate.cli.progress import progress_bar
    from doorstate.networks.packaged import packaged_networks

    from .answers import write_answers

    with progress_bar("Answers") as progress:
        print(write_answers(names or packaged_networks(), count, progress))


@app.command()
def check() -> None:
    """Compare pages, scores and pictures with what results/ gives; exit code 1 if something differs."""
    from .check import check as check_all

    problems = check_all()
    print("\n".join(problems) or "all published numbers follow from results/")
    if problems:
        raise typer.Exit(1)


if __name__ == "__main__":
    app(prog_name="python -m paper")

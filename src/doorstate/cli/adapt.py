# SPDX-License-Identifier: Apache-2.0
"""`doorstate adapt`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.choices import PACKAGED
from doorstate.cli.engine_options import EngineOptions, with_engine_options
from doorstate.cli.options import AsJson, Changes, Device, Epochs, Seed, recipe_changes
from doorstate.errors import ConfigError


@with_engine_options
def adapt(
    labelled: Annotated[
        list[Path], typer.Argument(help="Folders with labelled frames, as doorstate evaluate reads them.")
    ],
    out: Annotated[
        Path, typer.Option(help="Weights file to write, such as site.safetensors; its card is beside it.")
    ],
    network: Annotated[
        str | None,
        typer.Option(
            parser=PACKAGED,
            metavar="NAME",
            help="Packaged weights to start from: {packaged}. [default: pointnet2]",
        ),
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Weights file to start from, in place of --network.")
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option(help="Folder of the files in between. [default: that of --out, ending in .adapt]"),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            help="Folder of simulated clouds, which later adaptations use again. [default: ~/.cache/doorstate]"
        ),
    ] = None,
    seed: Seed = None,
    epochs: Epochs = None,
    changes: Changes = None,
    device: Device = "auto",
    as_json: AsJson = False,
    *,
    engine: EngineOptions,
) -> None:
    """Adapt weights to the doors of one place.

    Goes on from trained weights with some labelled frames of the place, mixed with simulated doors so that nothing is
    forgotten. A quarter of the frames is held out, whole doors if the index names them (column door), and the card
    beside the weights says how well they were known before and after. Five frames are the fewest; every state is
    needed. An interrupted adaptation continues where it stopped.

    \b
    Examples:
      doorstate adapt recordings/ --out site.safetensors
      doorstate adapt monday/ tuesday/ --out site.safetensors --weights mine.safetensors
      doorstate predict cloud.pcd --weights site.safetensors
    """
    from doorstate._files import check_writable, write_text
    from doorstate._locks import owned_folder
    from doorstate.cli.console import print_json, print_table, stderr, stdout
    from doorstate.cli.progress import progress_bar
    from doorstate.cli.run_display import repeated
    from doorstate.dataset.labelled import labelled_frames
    from doorstate.evaluation.adaptation import (
        adaptation_card,
        before_and_after_table,
        score_before_and_after,
    )
    from doorstate.inference.predictor import DEFAULT_NETWORK
    from doorstate.networks.packaged import packaged_weights
    from doorstate.training.adaptation.adapt import Adaptation
    from doorstate.training.adaptation.simulated import simulate_for

    if network is not None and weights is not None:
        raise ConfigError("give --network or --weights, not both")
    if out.suffix != ".safetensors":
        raise ConfigError(
            f"{out.name} is no name of weights", field="out", expected="a name ending in .safetensors"
        )
    check_writable(out)
    frames = [frame for folder in labelled for frame in labelled_frames(folder)]
    start = weights or packaged_weights(network or DEFAULT_NETWORK)
    adaptation = Adaptation(
        frames,
        start.absolute(),
        work or out.with_suffix(".adapt"),
        seed or 0,
        recipe_changes(changes, epochs),
    )
    run, recipe = adaptation.run, adaptation.recipe
    with owned_folder(adaptation.folder), engine.open() as workers:
        with progress_bar("Preparing frames") as progress:
            site = adaptation.prepare(workers, progress)
        for name, reason in site.left_out.items():
            stderr.print(f"left out {name}: {reason}", markup=False)
        with progress_bar("Simulating") as progress:
            simulated = simulate_for(adaptation.card, cache or _default_cache(), workers, progress)
        with (
            progress_bar("Training") as progress,
            repeated(1.0, lambda: progress(round(1000 * run.read_position()), 1000 * recipe.epochs)),
        ):
            adaptation.train(site.dataset, simulated, device)
        with progress_bar("Testing") as progress:
            adapted = adaptation.finish(site.dataset, simulated, out, device)
            scores = score_before_and_after(
                start.absolute(), out.absolute(), adaptation.held_out, workers, adaptation.folder, progress
            )
    write_text(
        out.with_suffix(".md"), adaptation_card(out.name, adaptation, adapted, scores, len(site.left_out))
    )
    if as_json:
        print_json(
            {
                "weights": str(out),
                "frames": len(adaptation.frames),
                "held_out": len(adaptation.held_out),
                "left_out": site.left_out,
                "simulated_macro_f1": [adapted.simulated_f1_before, adapted.simulated_f1_after],
                "scores": None if scores is None else scores.to_json()["scores"],
            }
        )
        return
    if scores is not None:
        table = before_and_after_table(scores)
        print_table(table.title, table.columns, table.rows)
    stdout.print(
        f"simulated doors: macro-F1 {adapted.simulated_f1_before:.3f} before, {adapted.simulated_f1_after:.3f} after"
    )
    stdout.print(f"weights in {out}, card in {out.with_suffix('.md')}", markup=False)


def _default_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "doorstate"

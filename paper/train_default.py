# SPDX-License-Identifier: Apache-2.0
"""Make the default weights from nothing: data, training, published results, weights and pages.

Every step continues where it was stopped. `python -m paper.train_default --help`
"""

from __future__ import annotations

from typing import Annotated

import typer

EXPERIMENT = "default"

app = typer.Typer(add_completion=False)


@app.command()
def train_default(
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    epochs: Annotated[
        int | None,
        typer.Option(
            min=1, help="Epochs of 20,000 crops; those of paper/experiments/default.toml if not given."
        ),
    ] = None,
) -> None:
    """Make the default weights from nothing, or go on where this was stopped.

    The data are made once. More epochs train better weights; a stopped run continues with the number of epochs that it
    began with.

    Examples:

        python -m paper.train_default

        python -m paper.train_default --device cuda --epochs 120
    """
    from .pages.render import write_pages
    from .publish import publish
    from .run import run
    from .weights import package_weights

    options = f"--device {device}" + (f" --epochs {epochs}" if epochs else "")
    run(EXPERIMENT, options)
    publish(EXPERIMENT)
    for path in (*package_weights(EXPERIMENT), *write_pages()):
        print(path)


if __name__ == "__main__":
    app(prog_name="python -m paper.train_default")

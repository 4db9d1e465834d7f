# SPDX-License-Identifier: Apache-2.0
"""Commands of the program, one module each, and the options before them.

Modules that take long to import are imported inside the commands, so that `--help` is quick.
"""

from __future__ import annotations

from typing import Annotated

import typer

from doorstate import __version__
from doorstate.cli.adapt import adapt
from doorstate.cli.command import Command
from doorstate.cli.compare import compare
from doorstate.cli.doors_app import doors_app
from doorstate.cli.evaluate import evaluate
from doorstate.cli.export import export
from doorstate.cli.export_sdf import export_sdf
from doorstate.cli.info import info
from doorstate.cli.join import join
from doorstate.cli.label import label
from doorstate.cli.predict import predict
from doorstate.cli.prepare import prepare
from doorstate.cli.report import report
from doorstate.cli.resolution import resolution
from doorstate.cli.serve import serve
from doorstate.cli.simulate import simulate
from doorstate.cli.train import train
from doorstate.cli.transfer import transfer
from doorstate.cli.view import view
from doorstate.cli.watch import watch

_COMMANDS = (
    simulate,
    prepare,
    join,
    train,
    adapt,
    compare,
    report,
    resolution,
    transfer,
    predict,
    label,
    evaluate,
    view,
    watch,
    serve,
    export,
    export_sdf,
    info,
)

app = typer.Typer(
    name="doorstate",
    help="Predict the state of a door (open, semi-open, closed) from one depth-camera point cloud.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
for command in _COMMANDS:
    app.command(cls=Command)(command)
app.add_typer(doors_app)


def _print_version(requested: bool) -> None:
    if requested:
        print(__version__)  # noqa: T201
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version),
    ] = False,
) -> None:
    """Parse the options before the command."""

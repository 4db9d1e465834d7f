# SPDX-License-Identifier: Apache-2.0
"""The command `doorstate`: parse, call, print; the only catcher of our own exceptions.

Heavy imports happen inside the commands, so that `--help` answers at once.
Exit codes: 0 all well, 1 something could not be done (said in one line), 2 wrong usage, 130 stopped by the user.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from doorstate import __version__
from doorstate.cli.dataset import join, prepare, simulate
from doorstate.cli.evaluate import evaluate
from doorstate.cli.export import export
from doorstate.cli.export_sdf import export_sdf
from doorstate.cli.predict import info, predict
from doorstate.cli.resolution import resolution
from doorstate.cli.serve import serve
from doorstate.cli.training import compare, report, train
from doorstate.cli.transfer import transfer
from doorstate.cli.view import view
from doorstate.errors import ConfigError, DoorstateError


def _version(wanted: bool) -> None:
    if wanted:
        print(__version__)  # noqa: T201
        raise typer.Exit


app = typer.Typer(
    name="doorstate",
    help="The state of a door (open, semi-open, closed) from one depth-camera point cloud.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
for command in (
    simulate,
    prepare,
    join,
    train,
    compare,
    report,
    resolution,
    transfer,
    predict,
    evaluate,
    view,
    serve,
    export,
    export_sdf,
    info,
):
    app.command()(command)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Say the version and end.", is_eager=True, callback=_version)
    ] = False,
) -> None:
    """What stands before a command."""


_RESUMABLE = {"simulate", "prepare", "train", "compare", "resolution", "transfer"}


def main() -> None:
    """Run the command line; our own exceptions become one line on standard error."""
    try:
        app()
    except DoorstateError as error:
        print(f"doorstate: {error}", file=sys.stderr)  # noqa: T201
        sys.exit(2 if isinstance(error, ConfigError) else 1)
    except KeyboardInterrupt:
        goes_on = "; the same command goes on from here" if _RESUMABLE & set(sys.argv[1:2]) else ""
        print(f"doorstate: stopped{goes_on}", file=sys.stderr)  # noqa: T201
        sys.exit(130)

# SPDX-License-Identifier: Apache-2.0
"""The command `doorstate`: parse, call, print; the only catcher of our own exceptions.

Heavy imports happen inside the commands, so that `--help` answers at once.
Exit codes: 0 all well, 1 something could not be done (said in one line), 2 wrong usage, 130 stopped by the user.
"""

from __future__ import annotations

import sys

import typer

from doorstate.cli.answers import info, predict
from doorstate.cli.data import join, prepare, simulate
from doorstate.cli.evaluation import evaluate
from doorstate.cli.export import export
from doorstate.cli.resolution import resolution
from doorstate.cli.service import serve
from doorstate.cli.training import compare, report, train
from doorstate.cli.transfer import transfer
from doorstate.cli.viewing import view
from doorstate.cli.worlds import export_sdf
from doorstate.errors import DoorstateError

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

_RESUMABLE = {"simulate", "prepare", "train", "compare", "resolution", "transfer"}


def main() -> None:
    """Run the command line; our own exceptions become one line on standard error."""
    try:
        app()
    except DoorstateError as error:
        sys.exit(f"doorstate: {error}")
    except KeyboardInterrupt:
        goes_on = "; the same command goes on from here" if _RESUMABLE & set(sys.argv[1:2]) else ""
        print(f"doorstate: stopped{goes_on}", file=sys.stderr)  # noqa: T201
        sys.exit(130)

# SPDX-License-Identifier: Apache-2.0
"""`doorstate doors`: lists of doors with names, and the history of their states."""

from __future__ import annotations

import typer

from doorstate.cli.command import Command
from doorstate.cli.doors_add import add
from doorstate.cli.doors_history import history
from doorstate.cli.doors_list import check, show

doors_app = typer.Typer(
    name="doors",
    help="Make, check and list doors with names, and show the history of their states.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
doors_app.command("add", cls=Command)(add)
doors_app.command("list", cls=Command)(show)
doors_app.command("check", cls=Command)(check)
doors_app.command("history", cls=Command)(history)

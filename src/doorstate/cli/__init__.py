# SPDX-License-Identifier: Apache-2.0
"""Command line `doorstate`: one module a command, each of which parses, calls the library and prints.

Exit codes: docs/commands.md.
"""

from doorstate.cli.signals import handle_signals, leave_signals


def main() -> None:
    """Run the command line."""
    handle_signals()  # before the imports, which take most of the time of a short command
    try:
        from doorstate.cli.application import app
        from doorstate.cli.command import reported_errors

        with reported_errors():
            app()
    finally:
        leave_signals()

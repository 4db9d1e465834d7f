# SPDX-License-Identifier: Apache-2.0
"""Lists among the options of the benchmarks, and the settings and tables that are stored."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.evaluation.table import Table


def parse_networks(text: str) -> list[str]:
    """Return the names of networks in a list, or of all.

    Raises:
        ConfigError: an unknown name.
    """
    from doorstate.networks import list_networks, network_class

    names = list_networks() if text == "all" else [name.strip() for name in text.split(",")]
    for name in names:
        network_class(name)  # raises for an unknown name
    return names


def parse_points(text: str) -> list[int]:
    """Return the numbers of points in a list.

    Raises:
        ConfigError: no such list, or fewer points than a network takes.
    """
    return parse_integers("points", text, 128)


def parse_integers(option: str, text: str, minimum: int) -> list[int]:
    """Return the numbers in the list of an option.

    Raises:
        ConfigError: no such list, or a number below the minimum.
    """
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() and int(word) >= minimum for word in words):
        raise ConfigError(
            f"cannot use {text!r}",
            field=option,
            expected=f"whole numbers of {minimum} or more, separated by commas",
        )
    return [int(word) for word in words]


def port_checkouts(pointnet: Path | None, dgcnn: Path | None) -> dict[str, Path]:
    """Return the checkouts of ports that were given, by network."""
    ports = {"pointnet": pointnet, "pointnet2": pointnet, "dgcnn": dgcnn}
    return {name: path for name, path in ports.items() if path is not None}


def describe_run(**options: Any) -> dict[str, Any]:
    """Return everything that results depend on: machine, versions and options."""
    from doorstate._environment import describe_environment

    return describe_environment() | options


def store_results(out: Path, name: str, rows: list[dict[str, Any]], table: Table, **options: Any) -> None:
    """Store and print the results of a benchmark that is measured as a whole."""
    from benchmarks.store import save_rows

    save_rows(out, name, describe_run(**options), rows, table)
    print_stored(table, out / f"{name}.md")


def print_stored(table: Table, path: Path, remarks: Sequence[str] = ()) -> None:
    """Print a table, remarks, and where both are stored."""
    from doorstate.cli.console import print_table, stdout

    print_table(table.title, table.columns, table.rows)
    for remark in remarks:
        stdout.print(remark, soft_wrap=True)
    stdout.print(f"stored in {path} and {path.with_suffix('.json').name}", soft_wrap=True)

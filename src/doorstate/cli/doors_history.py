# SPDX-License-Identifier: Apache-2.0
"""`doorstate doors history`."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.options import AsJson
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from doorstate.doors.tracker import DoorEvent


def history(
    file: Annotated[Path, typer.Argument(help="History that --history wrote.", show_default=False)],
    door: Annotated[str | None, typer.Option("--door", metavar="NAME", help="Show only this door.")] = None,
    day: Annotated[str | None, typer.Option(metavar="YYYY-MM-DD", help="Show only this day.")] = None,
    utc: Annotated[
        bool, typer.Option("--utc", help="Times of day are in UTC, not those of this machine.")
    ] = False,
    as_json: AsJson = False,
    csv_out: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write the changes to this .csv file.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw a day to this .svg file. [default: the day of the last change]"
        ),
    ] = None,
) -> None:
    """Show when doors changed, as a table, CSV or a picture of a day.

    A door that is not seen any more has no state: the change to `not_seen` has the time of its last sight.

    \b
    Examples:
      doorstate doors history doors.sqlite
      doorstate doors history doors.sqlite --door kitchen --day 2026-05-04
      doorstate doors history doors.sqlite --csv changes.csv --plot day.svg
    """
    from doorstate.doors.history import read_history

    if plot is not None and plot.suffix != ".svg":
        raise ConfigError(f"--plot {plot}: expected a .svg file")
    if csv_out is not None and csv_out.suffix != ".csv":
        raise ConfigError(f"--csv {csv_out}: expected a .csv file")
    start = None if day is None else _parse_day(day, utc)
    since_s, until_s = -math.inf, math.inf
    if start is not None:
        from doorstate.pages.day_svg import day_bounds

        since_s, until_s = day_bounds(start)
    events = read_history(file, door=door, since_s=since_s, until_s=until_s)
    if csv_out is not None:
        _write_csv(csv_out, events)
    if plot is not None:
        _write_plot(plot, file, door, start, utc)
    if as_json:
        _print_json(events)
    elif csv_out is None and plot is None:
        _print_table(events, utc)


def _print_table(events: Sequence[DoorEvent], utc: bool) -> None:
    from doorstate.cli.console import print_table

    rows = [
        [
            f"{_time(event.time_s, utc):%Y-%m-%d %H:%M:%S}",
            event.door,
            event.from_state,
            event.to_state,
            "" if event.certainty is None else f"{event.certainty:.2f}",
            event.frame,
        ]
        for event in events
    ]
    print_table("", ["time", "door", "from", "to", "certainty", "frame"], rows)


def _print_json(events: Sequence[DoorEvent]) -> None:
    from doorstate.cli.console import print_json

    for event in events:
        print_json(_record(event))


def _record(event: DoorEvent) -> dict[str, object]:
    return {
        "time": datetime.fromtimestamp(event.time_s, UTC).isoformat(timespec="milliseconds"),
        "time_s": round(event.time_s, 6),
        "door": event.door,
        "from": event.from_state,
        "to": event.to_state,
        "certainty": None if event.certainty is None else round(event.certainty, 4),
        "frame": event.frame,
    }


def _write_csv(path: Path, events: Sequence[DoorEvent]) -> None:
    from doorstate._files import write_csv, write_text
    from doorstate._paths import csv_name

    rows = [
        {name: "" if value is None else csv_name(str(value)) for name, value in _record(event).items()}
        for event in events
    ]
    if rows:
        write_csv(path, rows)
    else:
        write_text(path, "time,time_s,door,from,to,certainty,frame\n")


def _write_plot(path: Path, file: Path, door: str | None, start: datetime | None, utc: bool) -> None:
    from doorstate._files import write_text
    from doorstate.doors.history import read_history
    from doorstate.doors.intervals import state_intervals
    from doorstate.pages.day_svg import day_bounds, day_svg

    # A state may have begun on an earlier day.
    events = read_history(file, door=door)
    day = start or _time(events[-1].time_s if events else 0.0, utc)
    doors = sorted({event.door for event in events})
    last_s = min(day_bounds(day)[1], events[-1].time_s if events else 0.0)
    write_text(path, day_svg(state_intervals(events, last_s), doors, day))


def _time(time_s: float, utc: bool) -> datetime:
    return datetime.fromtimestamp(time_s, UTC) if utc else datetime.fromtimestamp(time_s).astimezone()


def _parse_day(text: str, utc: bool) -> datetime:
    try:
        day = datetime.strptime(text, "%Y-%m-%d")
    except ValueError as error:
        raise ConfigError(f"--day {text!r}: expected a day such as 2026-05-04") from error
    return day.replace(tzinfo=UTC) if utc else day.astimezone()

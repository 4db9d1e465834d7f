# SPDX-License-Identifier: Apache-2.0
"""History of the doors of a list: events in a file of SQLite, on the disk before `record` returns.

The file also holds when each door was last seen, at most a few seconds old: after a crash the next writer ends the
states that nobody watched any more, so that no old state is read as a new one.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from doorstate._files import check_writable
from doorstate._input import check_input
from doorstate.doors.sighting import NOT_SEEN
from doorstate.doors.tracker import DoorEvent
from doorstate.errors import DoorFileError

SCHEMA_VERSION = 1
RETENTION_DAYS = 365.0
_APPLICATION_ID = 0x444F4F52  # "DOOR", in the header of the file
_DAY_S = 86_400.0
_SEEN_PERIOD_S = 5.0  # between two notes of when doors were last seen
_BUSY_S = 10.0
_SCHEMA = """
CREATE TABLE event (
  id INTEGER PRIMARY KEY,
  time_s REAL NOT NULL,
  door TEXT NOT NULL,
  from_state TEXT NOT NULL,
  to_state TEXT NOT NULL,
  certainty REAL,
  frame TEXT NOT NULL
) STRICT;
CREATE INDEX event_by_time ON event (time_s);
CREATE TABLE last_seen (door TEXT PRIMARY KEY, state TEXT NOT NULL, time_s REAL NOT NULL) STRICT;
CREATE TABLE setting (name TEXT PRIMARY KEY, value REAL NOT NULL) STRICT;
"""


class DoorHistory:
    """Writer of a history, as a context manager; one process writes, others may read meanwhile.

    Args:
        path: file; it is made if it does not exist.
        retention_days: events that are older than the newest by more are deleted, when the file is opened and once a
            day of its events.

    Raises:
        DoorFileError: another kind of file, a damaged one, or one of a newer version; or no such time.
        OutputError: it cannot be written.
    """

    def __init__(self, path: Path, retention_days: float = RETENTION_DAYS) -> None:
        if not retention_days > 0:
            raise DoorFileError("no time", field="retention_days", expected="days, more than 0")
        check_writable(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            check_input(path, error=DoorFileError)
        self._path, self._retention_s = path, retention_days * _DAY_S
        self._noted_s = self._cleaned_s = -math.inf
        with _errors(path):
            self._database = _connect(path, read_only=False)
            try:
                with _transaction(self._database):
                    _prepare(self._database, path)
                    self._database.execute(
                        "INSERT OR REPLACE INTO setting VALUES ('retention_days', ?)", (retention_days,)
                    )
                    self._end_unwatched()
                    self._clean()
            except BaseException:
                self._database.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def record(
        self,
        events: Sequence[DoorEvent],
        last_seen: Mapping[str, tuple[str, float]] | None = None,
        now_s: float | None = None,
    ) -> None:
        """Write events; when this returns they are on the disk.

        Args:
            events: events, in order.
            last_seen: state and time of the last sight of each door that is seen (`DoorTracker.last_seen`).
            now_s: time of the cloud; without events, the last sights are written every few seconds of it.

        Raises:
            DoorFileError: the file cannot be written any more.
        """
        # A clock that goes back must not stop the notes.
        is_due = last_seen is not None and (
            now_s is None or abs(now_s - self._noted_s) >= _SEEN_PERIOD_S or not math.isfinite(self._noted_s)
        )
        if not events and not is_due:
            return
        with _errors(self._path), _transaction(self._database):
            self._database.executemany(
                "INSERT INTO event (door, from_state, to_state, time_s, certainty, frame) VALUES (?, ?, ?, ?, ?, ?)",
                [tuple(event) for event in events],
            )
            if last_seen is not None:
                self._database.execute("DELETE FROM last_seen")
                self._database.executemany(
                    "INSERT INTO last_seen VALUES (?, ?, ?)",
                    [(door, *seen) for door, seen in last_seen.items()],
                )
                self._noted_s = self._noted_s if now_s is None else now_s
            if events and abs(events[-1].time_s - self._cleaned_s) >= _DAY_S:
                self._clean()

    def close(self) -> None:
        """Close the file; what was recorded is on the disk already."""
        with _errors(self._path):
            self._database.close()

    def _end_unwatched(self) -> None:
        """Write that doors are not seen from their last sight on, which a process that was killed could not."""
        self._database.execute(
            "INSERT INTO event (door, from_state, to_state, time_s, certainty, frame)"
            " SELECT door, state, ?, time_s, NULL, '' FROM last_seen",
            (NOT_SEEN,),
        )
        self._database.execute("DELETE FROM last_seen")

    def _clean(self) -> None:
        (newest_s,) = self._database.execute("SELECT max(time_s) FROM event").fetchone()
        if newest_s is not None:
            self._cleaned_s = newest_s
            self._database.execute("DELETE FROM event WHERE time_s < ?", (newest_s - self._retention_s,))


def read_history(
    path: Path, *, door: str | None = None, since_s: float = -math.inf, until_s: float = math.inf
) -> list[DoorEvent]:
    """Return the events of a history by time.

    Args:
        path: file that `DoorHistory` writes, also at this moment.
        door: name of the only door; None: all.
        since_s, until_s: first time, and the time before which events are.

    Raises:
        DoorFileError: no history, or a damaged one.
    """
    check_input(path, error=DoorFileError)
    # SQLite knows no infinity that compares as one in every version.
    bounds = [max(-1e300, since_s), min(1e300, until_s)]
    with _errors(path):
        database = _connect(path, read_only=True)
        try:
            _check(database, path)
            rows = database.execute(
                "SELECT door, from_state, to_state, time_s, certainty, frame FROM event"
                " WHERE time_s >= ? AND time_s < ? AND (? IS NULL OR door = ?) ORDER BY time_s, id",
                (*bounds, door, door),
            ).fetchall()
        finally:
            database.close()
    return [DoorEvent(*row) for row in rows]


def _connect(path: Path, *, read_only: bool) -> sqlite3.Connection:
    mode = "ro" if read_only else "rwc"
    address = f"{path.absolute().as_uri()}?mode={mode}"
    database = sqlite3.connect(address, uri=True, timeout=_BUSY_S, isolation_level=None)
    if not read_only:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA synchronous = FULL")  # each event survives a power cut
    return database


@contextmanager
def _transaction(database: sqlite3.Connection) -> Iterator[None]:
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        database.execute("ROLLBACK")
        raise
    database.execute("COMMIT")


def _prepare(database: sqlite3.Connection, path: Path) -> None:
    """Make the tables of a new file, or check an old one."""
    (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if tables:
        _check(database, path)
        return
    for statement in _SCHEMA.split(";"):
        database.execute(statement)
    database.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
    database.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")


def _check(database: sqlite3.Connection, path: Path) -> None:
    (application,) = database.execute("PRAGMA application_id").fetchone()
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if application != _APPLICATION_ID:
        raise DoorFileError("is no history of doors", path=path)
    if version > SCHEMA_VERSION:
        raise DoorFileError(
            f"is of version {version}", path=path, expected=f"{SCHEMA_VERSION}; a newer doorstate wrote it"
        )


@contextmanager
def _errors(path: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as error:
        raise DoorFileError(f"cannot be used as a history ({error})", path=path) from error

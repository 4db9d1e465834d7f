# SPDX-License-Identifier: Apache-2.0
"""History of doors: on the disk at once, readable meanwhile, bounded in time, and ended after a crash."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from doorstate.doors.history import SCHEMA_VERSION, DoorHistory, read_history
from doorstate.doors.intervals import StateInterval, state_intervals
from doorstate.doors.tracker import DoorEvent
from doorstate.errors import DoorFileError, OutputError

DAY_S = 86_400.0
OPENED = DoorEvent("kitchen", "closed", "open", 100.0, 0.91, "frame 7")
LOST = DoorEvent("kitchen", "open", "not_seen", 130.0)


def test_events_are_read_while_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "doors.sqlite"
    with DoorHistory(path) as history:
        history.record([OPENED])
        assert read_history(path) == [OPENED]
        history.record([LOST, DoorEvent("hall", "not_seen", "closed", 90.0, 0.8, "x")])
        assert [event.time_s for event in read_history(path)] == [90.0, 100.0, 130.0]
        history.record([])
    assert read_history(path, door="kitchen") == [OPENED, LOST]
    assert read_history(path, since_s=100.0, until_s=130.0) == [OPENED]


CRASH = """
import os, signal, sys
from pathlib import Path
from doorstate.doors.history import DoorHistory
from doorstate.doors.tracker import DoorEvent
history = DoorHistory(Path(sys.argv[1]))
history.record([DoorEvent("kitchen", "not_seen", "open", 100.0, 0.9, "a")], {"kitchen": ("open", 100.0)}, 100.0)
history.record([], {"kitchen": ("open", 103.0)}, 103.0)
history.record([], {"kitchen": ("open", 106.0)}, 106.0)
history.record([], {"kitchen": ("open", 108.0)}, 108.0)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_nothing_is_lost_when_the_writer_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "doors.sqlite"
    ended = subprocess.run([sys.executable, "-c", CRASH, path], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert [event.to_state for event in read_history(path)] == ["open"]
    with DoorHistory(path):
        pass
    # It was last noted 106 s; the 2 s after it are unknown.
    assert read_history(path)[1:] == [DoorEvent("kitchen", "open", "not_seen", 106.0)]
    with DoorHistory(path):
        assert len(read_history(path)) == 2


def test_old_events_are_deleted(tmp_path: Path) -> None:
    path = tmp_path / "doors.sqlite"
    days = [OPENED._replace(time_s=day * DAY_S) for day in range(10)]
    with DoorHistory(path, retention_days=3) as history:
        for event in days:
            history.record([event])
        assert [event.time_s / DAY_S for event in read_history(path)] == [6, 7, 8, 9]
    with DoorHistory(path, retention_days=1):
        assert [event.time_s / DAY_S for event in read_history(path)] == [8, 9]
    value = sqlite3.connect(path).execute("SELECT value FROM setting").fetchone()
    assert value == (1.0,)
    with pytest.raises(DoorFileError) as caught:
        DoorHistory(path, retention_days=0)
    assert caught.value.field == "retention_days"


def test_other_files_are_refused_and_left_alone(tmp_path: Path) -> None:
    text, foreign, newer = (tmp_path / name for name in ("text", "foreign", "newer"))
    text.write_text("no database " * 100)
    sqlite3.connect(foreign).execute("CREATE TABLE t (x)")
    DoorHistory(newer).close()
    sqlite3.connect(newer).execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    for path in (text, foreign, newer):
        for use in (DoorHistory, read_history):
            with pytest.raises(DoorFileError) as caught:
                use(path)
            assert caught.value.path == path
    assert text.read_text() == "no database " * 100
    with pytest.raises(DoorFileError):
        read_history(tmp_path / "none")
    assert not (tmp_path / "none").exists()
    with pytest.raises(OutputError):
        DoorHistory(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_is_no_history(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DoorFileError):
        DoorHistory(tmp_path / "pipe")


def test_a_reader_in_another_thread_sees_whole_transactions(tmp_path: Path) -> None:
    path = tmp_path / "doors.sqlite"
    counts = []
    with DoorHistory(path) as history:

        def read() -> None:
            counts.extend(len(read_history(path)) for _ in range(20))

        reader = threading.Thread(target=read)
        reader.start()
        for second in range(20):
            history.record([OPENED._replace(time_s=second), LOST._replace(time_s=second)])
        reader.join()
    assert all(count % 2 == 0 for count in counts)


def test_intervals_end_where_a_door_is_lost() -> None:
    events = [
        DoorEvent("a", "not_seen", "closed", 1.0, 0.9),
        DoorEvent("b", "not_seen", "open", 2.0, 0.9),
        DoorEvent("a", "closed", "open", 5.0, 0.9),
        DoorEvent("b", "open", "not_seen", 6.0),
        DoorEvent("b", "not_seen", "open", 9.0, 0.9),
    ]
    assert state_intervals(events, 10.0) == [
        StateInterval("a", "closed", 1.0, 5.0),
        StateInterval("b", "open", 2.0, 6.0),
        StateInterval("a", "open", 5.0, 10.0),
        StateInterval("b", "open", 9.0, 10.0),
    ]
    assert state_intervals([], 10.0) == []

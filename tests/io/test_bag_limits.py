# SPDX-License-Identifier: Apache-2.0
"""Limits on what a bag may unpack to, and what its database and metadata may hold."""

from __future__ import annotations

import os
import sqlite3
import time
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")


from doorstate.errors import CloudReadError
from doorstate.io import bag_limits
from tests.bag_writer import cloud, text, write_bag
from tests.error_fields import about
from tests.io.test_bags import COMPRESSED, ORGANIZED, read, read_one


@pytest.mark.parametrize(("kind", "compression"), COMPRESSED)
def test_data_that_unpacks_to_more_than_a_message_is_refused(
    kind: str, compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path, kind, [cloud("/points", np.zeros((60, 80, 3)))], compression)
    monkeypatch.setattr(bag_limits, "MAX_UNPACKED", 2000)
    with pytest.raises(CloudReadError, match="unpacks to more than"):
        read_one(path)


@pytest.mark.parametrize(("kind", "compression"), COMPRESSED)
def test_truncated_packed_data_is_refused(
    kind: str, compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path, kind, [cloud("/points", ORGANIZED)], compression)
    unpack = bag_limits._unpack
    monkeypatch.setattr(bag_limits, "_unpack", lambda new, packed: unpack(new, packed[:-5]))
    with pytest.raises(CloudReadError, match="truncated"):
        read_one(path)


def test_files_that_fill_the_disk_are_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)], "FILE")
    (packed,) = folder.glob("*.zstd")
    monkeypatch.setattr(bag_limits, "MAX_UNPACKED", 2000)
    np.testing.assert_array_equal(read_one(folder), ORGANIZED)
    packed.write_bytes(bag_limits._zstd().compress(bytes(1 << 22)))
    for limit in ("_MAX_RATIO", "_MAX_DISK_SHARE"):
        monkeypatch.setattr(bag_limits, limit, 0)
        with pytest.raises(CloudReadError, match="unpacks to more than"):
            read_one(folder)
        monkeypatch.undo()


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
def test_gigabytes_of_zeros_are_no_bag(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    path.touch()
    os.truncate(path, 200 << 30)
    started = time.process_time()
    with pytest.raises(CloudReadError, match="no bag", check=about(path)):
        read_one(path)
    assert time.process_time() - started < 1


@pytest.mark.parametrize("target", ["/dev/zero", "pipe", "../outside"])
def test_bag_folders_hold_regular_files_of_their_own(target: str, tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)], "FILE")
    (packed,) = folder.glob("*.zstd")
    packed.rename(tmp_path / "outside")
    name = "other.name"  # of a file that only the metadata names
    metadata = folder / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(packed.name, name))
    if target == "pipe":
        os.mkfifo(folder / name)
    else:
        (folder / name).symlink_to(target)
    with pytest.raises(CloudReadError) as caught:
        read_one(folder)
    assert caught.value.path == folder / name


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("UPDATE messages SET timestamp = NULL", "damaged from here on"),
        ("UPDATE messages SET timestamp = 'now'", "damaged, or no bag"),
        ("UPDATE messages SET data = 'text'", "damaged message"),
        ("UPDATE topics SET name = NULL WHERE name = '/points'", "none of the 1 topics"),
        ("UPDATE topics SET type = 3", "none of the 2 topics"),
        # A view may compute without end.
        (
            "DROP TABLE schema; CREATE VIEW schema AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
            " SELECT i AS schema_version FROM n WHERE i < 0",
            "damaged, or no bag",
        ),
    ],
)
def test_databases_with_other_types_and_views_are_refused(change: str, reason: str, tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED), text("/chatter")])
    file = folder / f"{folder.name}.db3"
    with closing(sqlite3.connect(file)) as database:
        database.executescript(_LOOSE + change)
        database.commit()
    with pytest.raises(CloudReadError, match=reason):
        read_one(file)


# The same tables as recorders make, without NOT NULL and types.
_LOOSE = """
CREATE TABLE new AS SELECT * FROM messages; DROP TABLE messages; ALTER TABLE new RENAME TO messages;
CREATE TABLE new AS SELECT * FROM topics; DROP TABLE topics; ALTER TABLE new RENAME TO topics;
"""


@pytest.mark.parametrize(
    "added", ["  x: [&a 1, *a]", "  x: &a [1]\n  y: {<<: *a}"], ids=["an alias", "a merge of one"]
)
def test_metadata_with_aliases_are_refused(added: str, tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "mcap", [cloud("/points", ORGANIZED)])
    metadata = folder / "metadata.yaml"
    metadata.write_text(metadata.read_text() + f"{added}\n")
    with pytest.raises(CloudReadError, match="refers to itself", check=about(metadata)):
        read(folder)


def test_metadata_of_megabytes_are_refused_at_once(tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "mcap", [cloud("/points", ORGANIZED)])
    metadata = folder / "metadata.yaml"
    metadata.write_text(metadata.read_text() + "  x:\n" + "  - a: 1\n" * 250_000)
    started_s = time.process_time()
    with pytest.raises(CloudReadError, check=about(metadata)):
        read(folder)
    assert time.process_time() - started_s < 1


def test_quality_of_service_in_a_database_is_not_parsed(tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)])
    (store,) = folder.glob("*.db3")
    names = "abcdefghijklmnop"
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    lines += [f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in pairwise(names)]
    with closing(sqlite3.connect(store)) as database, database:
        database.execute("UPDATE topics SET offered_qos_profiles = ?", ["\n".join(lines)])
    started = time.process_time()
    np.testing.assert_array_equal(read_one(store), ORGANIZED)
    assert time.process_time() - started < 1

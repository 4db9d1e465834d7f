# SPDX-License-Identifier: Apache-2.0
"""Results of pieces: in order on every engine, from what each process loads once, and nothing is left behind."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import pytest

from doorstate._jobs import Engine, Resources, map_pieces
from doorstate.errors import DatasetError
from tests._jobs.work import load_offset, plus_offset, visible_gpus


def test_results_are_in_order_and_each_process_loads_once(tmp_path: Path, engine: Engine) -> None:
    loads, folder = tmp_path / "loads", tmp_path / "folder"
    loads.mkdir()
    (folder / ".pieces-of-a-killed-program").mkdir(parents=True)
    steps: list[tuple[int, int]] = []
    load = partial(load_offset, 100, loads)
    got = map_pieces(plus_offset, load, range(40), engine, folder, lambda *step: steps.append(step))
    assert got == [(number, number + 100) for number in range(40)]
    assert steps[-1] == (40, 40)
    assert 1 <= len(list(loads.iterdir())) <= 2
    assert not list(folder.iterdir())


def test_what_is_loaded_belongs_to_one_job(tmp_path: Path) -> None:
    for offset in (1, 2):
        load = partial(load_offset, offset, tmp_path)
        assert map_pieces(plus_offset, load, [5], 1) == [(5, 5 + offset)]
    assert len(list(tmp_path.iterdir())) == 2


def test_an_error_is_raised_as_it_is_and_leaves_nothing(tmp_path: Path, engine: Engine) -> None:
    with pytest.raises(DatasetError) as caught:
        map_pieces(plus_offset, partial(load_offset, 1, tmp_path / "absent"), [1, 2], engine, tmp_path)
    assert caught.value.path == tmp_path / "absent"
    assert not list(tmp_path.iterdir())


def test_pieces_get_the_resources_that_they_ask_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("doorstate._jobs.resources.default_workers", lambda: 2)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "4,7")
    seen = map_pieces(visible_gpus, os.getpid, range(2), resources=Resources(gpus=1))
    assert set(seen) <= {"4", "7"}

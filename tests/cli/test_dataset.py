# SPDX-License-Identifier: Apache-2.0
"""Many scenes on the command line: shares, joining, worlds for Gazebo, and what is refused."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

from doorstate._files import read_csv

Run = Callable[..., tuple[int, str, str]]


def test_scenes_in_shares_and_as_worlds(run: Run, tmp_path: Path) -> None:
    folder, worlds = tmp_path / "scenes", tmp_path / "worlds"
    simulate = ("simulate", "--preset", "no-door", "--scenes", 9, "--out", folder, "--workers", 1)
    code, out, _ = run(*simulate, "--shard", "1/2")
    assert code == 0
    assert "share 1/2 is in" in out
    assert not (folder / "manifest.csv").exists()
    code, out, _ = run(*simulate)
    assert code == 0
    assert "9 samples in" in out
    names = [row["sample_id"] for row in read_csv(folder / "manifest.csv")]
    assert names == [f"no-door-0-{number:05d}-no_door" for number in range(9)]
    assert run("export-sdf", folder, names[0], names[8], "--out", worlds)[0] == 0
    assert sorted(path.name for path in worlds.iterdir()) == [f"{names[0]}.sdf", f"{names[8]}.sdf"]
    assert ET.parse(worlds / f"{names[8]}.sdf").getroot().tag == "sdf"
    code, _, err = run("export-sdf", folder, "no-door-0-00009-no_door", "--out", tmp_path / "none")
    assert code == 2
    assert err.count("\n") == 1
    assert "holds no sample 'no-door-0-00009-no_door'" in err
    assert not (tmp_path / "none").exists()
    clouds = tmp_path / "clouds"
    code, out, _ = run("prepare", folder, "--out", clouds, "--points", 128, "--workers", 1)
    assert code == 0
    assert "9 clouds of 128 points" in out
    assert "9 no_door" in out


def test_scenes_are_prepared_as_they_are_rendered(run: Run, tmp_path: Path) -> None:
    folder, clouds = tmp_path / "scenes", tmp_path / "clouds"
    simulate = ("simulate", "--preset", "varied", "--scenes", 3, "--out", folder, "--workers", 1)
    prepared = ("--prepared", clouds, "--points", 128, "--thin", "--max-depth-m", 5)
    code, out, _ = run(*simulate, *prepared)
    assert code == 0
    assert "9 clouds of 128 points" in out
    assert run("prepare", folder, "--out", clouds, *prepared[2:])[0] == 0, "it is there already"
    code, _, err = run(*simulate, "--thin")
    assert code == 2
    assert "are for --prepared FOLDER" in err


def test_what_cannot_be_simulated_is_one_line(run: Run, tmp_path: Path) -> None:
    for options, reason in (
        (("--preset", "varies"), "no preset 'varies': choose one of ogurob, "),
        (("--preset", "varied", "--poses", 3), "choose --scenes"),
        (("--scenes", 3), "choose --poses"),
        (("--preset", "varied", "--shard", "3/2"), "--shard 3/2: give the share"),
    ):
        code, _, err = run("simulate", "--out", tmp_path / "x", *options)
        assert code == 2
        assert err.startswith("doorstate: ")
        assert reason in err
        assert err.count("\n") == 1
    assert not (tmp_path / "x").exists()

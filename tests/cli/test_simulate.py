# SPDX-License-Identifier: Apache-2.0
"""`doorstate simulate`, `prepare`, `join` and `export-sdf`."""

from __future__ import annotations

import os
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

from doorstate._files import read_csv
from doorstate.dataset.store import open_dataset
from tests.cli.helpers import Run, check_error


def test_shards_are_joined_and_exported_as_worlds(run: Run, tmp_path: Path) -> None:
    folder, worlds = tmp_path / "scenes", tmp_path / "worlds"
    simulate = ("simulate", "--preset", "no-door", "--scenes", 9, "--out", folder, "--workers", 1)
    assert run(*simulate, "--shard", "1/2")[0] == 0
    assert not (folder / "manifest.csv").exists()
    assert run(*simulate)[0] == 0
    names = [row["sample_id"] for row in read_csv(folder / "manifest.csv")]
    assert names == [f"no-door-0-{number:05d}-no_door" for number in range(9)]
    assert run("export-sdf", folder, names[0], names[8], "--out", worlds)[0] == 0
    assert sorted(path.name for path in worlds.iterdir()) == [f"{names[0]}.sdf", f"{names[8]}.sdf"]
    assert ET.parse(worlds / f"{names[8]}.sdf").getroot().tag == "sdf"
    unknown = "no-door-0-00009-no_door"
    check_error(run("export-sdf", folder, unknown, "--out", tmp_path / "none"), 2, unknown)
    assert not (tmp_path / "none").exists()
    assert run("prepare", folder, "--out", tmp_path / "clouds", "--points", 128, "--workers", 1)[0] == 0
    assert [row["state"] for row in open_dataset(tmp_path / "clouds").rows] == ["no_door"] * 9


def test_scenes_are_simulated_and_prepared_in_one_go(run: Run, tmp_path: Path) -> None:
    folder, clouds = tmp_path / "scenes", tmp_path / "clouds"
    simulate = ("simulate", "--preset", "varied", "--scenes", 3, "--out", folder, "--workers", 1)
    prepared = ("--prepared", clouds, "--points", 128, "--thin", "--max-depth-m", 5)
    assert run(*simulate, *prepared)[0] == 0
    dataset = open_dataset(clouds)
    assert (len(dataset), dataset.num_points) == (9, 128)
    assert run("prepare", folder, "--out", clouds, *prepared[2:])[0] == 0, "the same settings continue"


def test_class_folders_are_prepared(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    pcd = simulated_folder / "pcd"
    code, _, err = run("prepare", pcd, "--out", tmp_path / "clouds", "--points", 128, "--workers", 1)
    assert (code, err) == (0, "")
    dataset = open_dataset(tmp_path / "clouds")
    assert [(dataset.labels == label).sum() for label in range(3)] == [12, 12, 12]
    shutil.copytree(pcd / "open", tmp_path / "partial" / "open")
    code, _, err = run(
        "prepare", tmp_path / "partial", "--out", tmp_path / "one", "--points", 128, "--workers", 1
    )
    assert code == 0
    assert err.count("\n") == 2, "one warning for each missing state"


def test_join_appends_data_sets(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    for name in ("closed", "open"):
        shutil.copytree(simulated_folder / "pcd" / name, tmp_path / name / name)
        source, out = tmp_path / name, tmp_path / f"{name}-128"
        assert run("prepare", source, "--out", out, "--points", 128, "--workers", 1)[0] == 0
    code, _, err = run("join", tmp_path / "closed-128", tmp_path / "open-128", "--out", tmp_path / "joined")
    assert (code, err) == (0, "")
    assert [row["state"] for row in open_dataset(tmp_path / "joined").rows] == ["closed"] * 12 + ["open"] * 12


def test_all_files_have_the_modes_of_the_user(run: Run, simulated_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "clouds"
    before = os.umask(0o027)
    try:
        assert (
            run("simulate", "--out", tmp_path / "s", "--poses", 1, "--keep", "depth", "--workers", 1)[0] == 0
        )
        command = ("prepare", simulated_folder, "--out", out, "--points", 128, "--workers", 1)
        assert run(*command)[0] == 0
        cloud = sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0]
        assert run("predict", cloud, "--rule", "plane_state", "--out", out / "states.csv")[0] == 0
    finally:
        os.umask(before)
    files = [path for folder in (out, tmp_path / "s") for path in folder.rglob("*")]
    modes = {path.name: oct(path.stat().st_mode & 0o777) for path in files if path.is_file()}
    assert {name: mode for name, mode in modes.items() if mode != "0o640"} == {}

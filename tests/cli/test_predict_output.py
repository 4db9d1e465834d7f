# SPDX-License-Identifier: Apache-2.0
"""Table, summary and files of `doorstate predict`, and what ends it early."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doorstate.cli import console
from doorstate.cli.prediction_output import WRITERS
from doorstate.cli.prediction_table import PredictionTable
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import prediction_values, rounded
from doorstate.types import DoorState
from tests.cli.helpers import Run

ANSWER: dict[str, Any] = {
    "method": "pointnet2",
    "state": "open",
    "probabilities": {"closed": 0.01, "semi_open": 0.04, "open": 0.95},
    "opening_angle_deg": 87.4,
    "passable_width_m": 0.812,
    "door_x_m": 3.0,
    "door_y_m": 4.0,
    "points": 1024,
    "milliseconds": 26.4,
}
REFUSED: dict[str, Any] = {
    "method": "pointnet2",
    "state": None,
    "raw_probabilities": {"closed": 0.4, "semi_open": 0.35, "open": 0.25},
    "opening_angle_deg": 12.0,
    "reason": "there seems to be no door: " + "the probability of one is 0.02, " * 4,
    "points": 1024,
    "milliseconds": 25.0,
}
PLANE_STATE = {"method": "plane_state", "state": "closed", "points": 76800, "milliseconds": 150.0}


def printed(
    rows: list[tuple[str, dict[str, Any]]], monkeypatch: pytest.MonkeyPatch, **options: Any
) -> list[str]:
    screen = console.PrintingConsole(
        file=io.StringIO(), highlight=False, markup=False, soft_wrap=True, **options
    )
    monkeypatch.setattr(console, "stdout", screen)
    table = PredictionTable(
        "file", [name for name, _ in rows], list(dict.fromkeys(r["method"] for _, r in rows))
    )
    for name, row in rows:
        table.add(name, row)
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue().splitlines()


def test_row_shows_probability_angle_width_and_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    titles, row = printed([("a.pcd", ANSWER)], monkeypatch)
    assert titles.split() == ["file", "state", "door", "prob.", "angle", "passable", "distance", "ms"]
    assert row.split() == ["a.pcd", "open", "─┨", "┠─", "0.95", "87°", "0.81", "m", "5.00", "m", "26"]


def test_numbers_are_rounded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    door = Door(2.3746, 0.0, 90.0, 0.9, DoorState.OPEN, opening_angle_deg=46.46, passable_width_m=0.5546)
    values = prediction_values(Prediction.from_doors([door], [], 1024, 26.46))
    _, row = printed([("a.pcd", {"method": "pointnet2"} | values)], monkeypatch)
    assert row.split()[-6:] == ["46°", "0.55", "m", "2.37", "m", "26"]
    rows = rounded({"stamp_s": 1.2345678} | values)
    assert (rows["stamp_s"], rows["doors"][0]["distance_m"], rows["milliseconds"]) == (
        1.2345678,
        2.375,
        26.46,
    )


def test_reason_is_below_its_row_without_numbers_that_look_like_an_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, row, reason = printed([("a.pcd", REFUSED)], monkeypatch)
    assert row.split() == ["a.pcd", "abstained", "─┨", "?", "┠─", "-", "-", "-", "-", "25"]
    assert reason.strip() == REFUSED["reason"].strip()


@pytest.mark.parametrize("name", ["a.pcd", "folder/" * 30 + "a.pcd"])
def test_terminal_of_80_columns_is_not_overrun(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed(
        [(name, ANSWER), (name, REFUSED)], monkeypatch, width=80, force_terminal=True, no_color=True
    )
    plain = [re.sub(r"\x1b\[[\d;]*m", "", line) for line in lines]
    assert max(map(len, plain)) <= 80
    assert sum("a.pcd" in line for line in plain) == 2


def test_names_are_whole_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "folder/" * 30 + "a.pcd"
    assert printed([(name, ANSWER)], monkeypatch)[1].startswith(name)


def test_colours_are_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    terminal = {"width": 80, "force_terminal": True, "color_system": "standard"}
    assert any("\x1b[32m" in line for line in printed([("a", ANSWER)], monkeypatch, **terminal))
    assert not any("\x1b" in line for line in printed([("a", ANSWER)], monkeypatch))
    monkeypatch.setenv("NO_COLOR", "1")
    assert not any("\x1b[32m" in line for line in printed([("a", ANSWER)], monkeypatch, **terminal))


def test_several_methods_stand_below_the_name(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [("a.pcd", ANSWER), ("a.pcd", PLANE_STATE), ("b.pcd", ANSWER), ("b.pcd", PLANE_STATE)]
    lines = printed(rows, monkeypatch)
    assert [line.split()[0] for line in lines[1:]] == [
        *("a.pcd", "pointnet2", "plane_state"),
        *("b.pcd", "pointnet2", "plane_state"),
    ]


@pytest.fixture
def folder(cloud: np.ndarray, tmp_path: Path) -> Path:
    """Two clouds, three tables without coordinates, and one damaged file."""
    path = tmp_path / "in"
    path.mkdir()
    for name in ("good", "=1+1"):
        np.save(path / f"{name}.npy", cloud)
    for number in range(3):
        (path / f"{number}.csv").write_text("foo,bar\n" + "1,2\n" * 300)
    (path / "bad\x1b[31m.npy").write_bytes(b"nothing")
    return path


DOORS = [
    {
        "state": "open",
        "x_m": 3.0,
        "y_m": 0.0,
        "yaw_deg": 90.0,
        "width_m": 0.9,
        "distance_m": 3.0,
        "bearing_deg": 0.0,
    },
    {
        "state": None,
        "reason": "unsure",
        "raw_probabilities": {"closed": 0.4, "semi_open": 0.35, "open": 0.25},
        "x_m": 2.0,
        "y_m": 2.0,
        "yaw_deg": 135.0,
        "width_m": 1.0,
        "distance_m": 2.828,
        "bearing_deg": 45.0,
        "position_error_m": 0.05,
    },
]


def test_further_doors_stand_below_their_cloud(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed([("corridor/left/frame-000123.pcd", ANSWER | {"doors": DOORS})], monkeypatch, width=100)
    assert len(lines) == 4
    assert "3.00 m" in lines[1]
    assert "door 2, 45° left" in lines[2]
    assert "2.83 m" in lines[2]
    assert "abstained" in lines[2]
    assert "unsure" in lines[3]
    short = printed([("a.pcd", ANSWER | {"doors": DOORS})], monkeypatch, width=100)
    assert len({line.index("2.83 m" if "2.83 m" in line else "3.00 m") for line in short[1:3]}) == 1


def named_answer() -> dict[str, Any]:
    doors = [door | {"name": name} for door, name in zip(DOORS, ("kitchen", "unknown door"), strict=True)]
    sightings = [
        {"id": "kitchen", "seen": True, "state": "open"},
        {"id": "hall", "seen": False, "state": None, "reason": "not seen: out of view"},
        {"id": "attic", "seen": False, "state": None, "reason": "not seen: out of view"},
        {"id": "cellar", "seen": True, "asked": True, "state": "closed"},
    ]
    return ANSWER | {"doors": doors, "named_doors": sightings}


def test_doors_of_a_list_have_their_names_and_the_others_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed([("corridor/left/frame-000123.pcd", named_answer())], monkeypatch, width=100)
    assert "kitchen, ahead" in lines[2]
    assert "unknown door, 45° left" in lines[3]
    assert lines[-2].strip() == "hall, attic: not seen: out of view"
    assert lines[-1].strip().startswith("cellar: closed")


def test_doors_are_drawn_from_above_within_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = console.PrintingConsole(file=io.StringIO(), highlight=False, markup=False, soft_wrap=True)
    monkeypatch.setattr(console, "stdout", screen)
    monkeypatch.setattr(type(screen), "encoding", "utf-8")
    table = PredictionTable("file", ["a.pcd"], ["pointnet2"], draws=True)
    table.add("a.pcd", named_answer())
    assert isinstance(screen.file, io.StringIO)
    lines = screen.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    drawing = lines[next(row for row, line in enumerate(lines) if line.startswith("  cellar")) + 1 :]
    assert "▲" in drawing[-1]
    assert any("kitchen  open" in line for line in drawing)
    assert any("\u2800" < character <= "\u28ff" for line in drawing for character in line)


def test_an_output_without_unicode_gets_ascii(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console.PrintingConsole, "encoding", "ascii")
    lines = printed([("a.pcd", ANSWER | {"doors": DOORS}), ("b.pcd", REFUSED)], monkeypatch)
    assert all(line.isascii() for line in lines)
    assert "-[   ]-" in lines[1]


def test_names_are_a_column_of_the_csv_file() -> None:
    stream = io.StringIO()
    write = WRITERS[".csv"](stream, "file", True)
    write({"file": "a.pcd"} | named_answer())
    write({"file": "b.pcd"} | REFUSED)
    rows = list(csv.DictReader(io.StringIO(stream.getvalue())))
    assert [row["name"] for row in rows] == ["kitchen", "unknown door", ""]


def test_a_csv_file_has_a_row_for_each_door() -> None:
    stream = io.StringIO()
    write = WRITERS[".csv"](stream, "file")
    write({"file": "a.pcd"} | ANSWER | {"doors": DOORS})
    write({"file": "b.pcd"} | REFUSED)
    write({"file": "c.pcd", "error": "empty"})
    first, second, refused, error = csv.DictReader(io.StringIO(stream.getvalue()))
    assert [row["door"] for row in (first, second, refused, error)] == ["1", "2", "", ""]
    assert {row["file"] for row in (first, second)} == {"a.pcd"}
    assert {row["points"] for row in (first, second)} == {"1024"}
    assert (first["state"], first["door_x_m"], first["opening_width_m"]) == ("open", "3.0", "0.9")
    assert (second["state"], second["door_y_m"], second["bearing_deg"], second["position_error_m"]) == (
        "",
        "2.0",
        "45.0",
        "0.05",
    )
    assert (second["reason"], second["closed"]) == ("unsure", "")
    assert (error["error"], error["state"]) == ("empty", "")


def test_alike_errors_are_one_line(run: Run, weights: Path, folder: Path) -> None:
    code, out, err = run("predict", folder, "--weights", weights)
    assert code == 1
    assert "\x1b" not in out + err
    grouped, single = sorted(err.splitlines(), key=lambda line: "bad" in line)
    assert grouped.startswith("3 files: ")
    assert grouped.endswith("0.csv")
    assert r"bad\x1b[31m.npy" in single
    assert out.splitlines()[-1].startswith("6 files: ")


def test_other_files_are_written_with_names_that_are_no_formulas(
    run: Run, weights: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    table = tmp_path / "out.csv"
    names = sorted(path.name for path in folder.iterdir())
    code, out, _ = run("predict", *names, "gone.pcd", "--weights", weights, "--out", table)
    assert code == 1
    assert str(table) in out
    with table.open(newline="") as stream:
        rows = {row["file"]: row for row in csv.DictReader(stream)}
    written = {"=1+1.npy": "./=1+1.npy", "bad\x1b[31m.npy": r"bad\x1b[31m.npy"}
    assert set(rows) == {written.get(name, name) for name in names} | {"gone.pcd"}
    assert {name for name, row in rows.items() if row["error"]} == {
        *("0.csv", "1.csv", "2.csv", "gone.pcd", r"bad\x1b[31m.npy")
    }
    assert {row["method"] for row in rows.values()} == {"pointnet", ""}


def test_several_methods_answer_side_by_side(run: Run, weights: Path, folder: Path) -> None:
    command = (
        "predict",
        folder / "good.npy",
        "--weights",
        weights,
        "--rule",
        "plane_state",
        "--rule",
        "angle_bins",
    )
    code, out, _ = run(*command, "--json")
    assert code == 0
    assert [json.loads(line)["method"] for line in out.splitlines()] == [
        "pointnet",
        "plane_state",
        "angle_bins",
    ]
    assert run(*command, "--points", 128)[0] == 0, "points are those of the network"


def test_more_points_than_in_training_are_warned_about(run: Run, weights: Path, folder: Path) -> None:
    for points, lines in ((256, 0), (300, 1)):
        _, _, err = run("predict", folder / "good.npy", "--weights", weights, "--points", points)
        assert err.count("\n") == lines
        assert err == "" or ("256" in err and "300" in err)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize(
    "arguments", [("predict", "--json", "--rule", "plane_state"), ("--help",), ("info",)]
)
def test_full_disk_is_one_line(arguments: tuple[str, ...], folder: Path) -> None:
    files = [str(folder / "good.npy")] if "predict" in arguments else []
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "doorstate", *arguments, *files]
        process = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    lines = [line for line in process.stderr.splitlines() if not line.startswith("Loading")]
    assert (process.returncode, len(lines)) == (1, 1)
    assert lines[0].startswith("doorstate: ")


def test_closed_pipe_ends_without_a_word(folder: Path) -> None:
    command = [sys.executable, "-m", "doorstate", "predict", "--json", "--rule", "plane_state"]
    files = [str(folder / "good.npy")] * 400
    with subprocess.Popen(
        [*command, *files], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        lines = [line for line in process.stderr if not line.startswith(("Loading", "Predicting"))]
    assert (process.returncode, lines) == (141, [])

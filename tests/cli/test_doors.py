# SPDX-License-Identifier: Apache-2.0
"""`doorstate doors`, and doors with names in `doorstate predict`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from doorstate.doors.door_file import read_doors, write_doors
from doorstate.doors.history import DoorHistory, read_history
from doorstate.doors.named_door import DoorList
from doorstate.doors.tracker import DoorEvent
from doorstate.inference.door import Door
from doorstate.inference.known import DoorHint, Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from tests.cli.helpers import Run, check_error
from tests.doors.examples import named, seen


class ScriptedPredictor(Predictor):
    """Sees a closed door 3 m ahead; asked for another place, it sees an open one there."""

    gate = None
    removes_outliers = False
    name = "scripted"

    def _predict(self, clouds: object, known: Known) -> list[Prediction]:
        doors: list[Door] = [seen(3.0, 0.0, score=0.9, door_probability=0.9)]
        if isinstance(known.hint, DoorHint):
            doors = [seen(known.hint.x_m or 0, known.hint.y_m or 0, state="open"), *doors]
        return [Prediction.from_doors(doors, [], 500, 12.0)]


@pytest.fixture(autouse=True)
def _scripted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Predictor, "load", lambda *_, **__: ScriptedPredictor())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six clouds with poses, and a list of a door ahead, one beside it and one behind."""
    monkeypatch.chdir(tmp_path)
    bearing = np.radians(np.linspace(-40, 40, 600))
    points = np.stack([3 * np.cos(bearing), 3 * np.sin(bearing), np.linspace(-1, 1, 600)], axis=1)
    lines = ["file,time,x,y,yaw"]
    for number in range(6):
        np.save(tmp_path / f"{number}.npy", points.astype(np.float32))
        lines.append(f"{number}.npy,{100 + number / 2},7,2,90")
    (tmp_path / "poses.csv").write_text("\n".join(lines))
    doors = (named("ahead", 7, 5, 180), named("beside", 5.6, 5, 180), named("behind", 7, -3, 0))
    write_doors(tmp_path / "doors.yaml", DoorList(doors=doors))
    return tmp_path


CLOUDS = [f"{number}.npy" for number in range(6)]
NAMED = ("--doors", "doors.yaml", "--poses", "poses.csv")


def test_json_has_names_and_a_reason_for_every_other_door(run: Run, folder: Path) -> None:
    code, out, _ = run("predict", *CLOUDS, *NAMED, "--json")
    assert code == 0
    rows = [json.loads(line) for line in out.splitlines()]
    assert {door["name"] for row in rows for door in row["doors"]} == {"ahead"}
    by_id = {door["id"]: door for door in rows[-1]["named_doors"]}
    assert (by_id["ahead"]["state"], by_id["ahead"]["last_seen_s"]) == ("closed", 102.5)
    assert [by_id[name]["seen"] for name in ("ahead", "beside", "behind")] == [True, False, False]
    assert by_id["beside"]["state"] is None
    assert by_id["behind"]["reason"].endswith("out of view")


def test_doors_in_view_are_asked_for(run: Run, folder: Path) -> None:
    _, out, _ = run(
        "predict", "0.npy", "--doors", "doors.yaml", "--camera-pose", "7 2 90", "--ask-doors", "--json"
    )
    by_id = {door["id"]: door for door in json.loads(out)["named_doors"]}
    assert (by_id["beside"]["state"], by_id["beside"]["asked"]) == ("open", True)
    assert "last_seen_s" not in by_id["beside"], "a cloud without a time stands alone"
    assert not by_id["behind"]["seen"]


def test_csv_and_history_carry_the_names(run: Run, folder: Path) -> None:
    code, _, _ = run("predict", *CLOUDS, *NAMED, "--out", "out.csv", "--history", "doors.sqlite")
    assert code == 0
    with Path("out.csv").open(newline="") as stream:
        assert {row["name"] for row in csv.DictReader(stream)} == {"ahead"}
    first, last = read_history(Path("doors.sqlite"))
    assert first[:3] == ("ahead", "not_seen", "closed")
    assert first.frame.endswith(".npy")
    assert last == DoorEvent("ahead", "closed", "not_seen", 102.5)


def test_a_table_and_a_plan_of_a_single_cloud(run: Run, folder: Path) -> None:
    code, out, _ = run("predict", "0.npy", *NAMED, "--plan", "plan.svg")
    assert code == 0
    assert "ahead" in out
    assert "ahead" in Path("plan.svg").read_text()
    assert "▲" in out
    assert "▲" not in run("predict", "0.npy", "--no-draw")[1]
    assert run("predict", *CLOUDS, "--draw")[1].count("▲") == 6


@pytest.mark.parametrize(
    "arguments",
    [
        ("--doors", "doors.yaml"),
        ("--poses", "poses.csv"),
        ("--history", "doors.sqlite"),
        (*NAMED, "--camera-pose", "1 2 3"),
        (*NAMED, "--door-known"),
        (*NAMED, "--rule", "plane_state", "--rule", "angle_bins"),
        ("--doors", "doors.yaml", "--camera-pose", "1 2"),
        (*NAMED, "--pose-error", "1"),
        (*NAMED, "--pose-axes", "sideways"),
        ("--plan", "plan.svg"),
        ("--plan", "plan.png"),
    ],
)
def test_options_that_do_not_fit_are_one_line(run: Run, folder: Path, arguments: tuple[str, ...]) -> None:
    check_error(run("predict", "0.npy", "1.npy", *arguments), 2)


def test_files_that_cannot_be_used_are_one_line(run: Run, folder: Path) -> None:
    check_error(run("predict", "0.npy", "--doors", "poses.csv", "--camera-pose", "0 0 0"), 1, "poses.csv")
    check_error(run("predict", "0.npy", "--doors", "doors.yaml", "--poses", "doors.yaml"), 1, "doors.yaml")
    check_error(run("predict", "0.npy", *NAMED, "--history", "poses.csv"), 1, "poses.csv")
    check_error(run("doors", "history", "0.npy"), 1, "0.npy")
    check_error(run("doors", "list", "none.yaml"), 1, "none.yaml")


def test_a_history_needs_times(run: Run, folder: Path) -> None:
    Path("poses.csv").write_text("file,x,y,yaw\n0.npy,7,2,90\n")
    code, _, err = run("predict", "0.npy", *NAMED, "--history", "doors.sqlite")
    assert code == 1
    assert "time" in err


def test_doors_are_added_to_a_list(run: Run, folder: Path) -> None:
    Path("doors.yaml").unlink()
    code, out, _ = run("doors", "add", *CLOUDS, "--poses", "poses.csv", "--name", "hall")
    assert code == 0
    assert out.startswith("hall-1: 7.00 5.00 m")
    (door,) = read_doors(Path("doors.yaml")).doors
    assert (door.id, door.place) == ("hall-1", (7.0, 5.0, 180.0))
    code, out, _ = run("doors", "add", "0.npy", "--poses", "poses.csv")
    assert (code, out.split()[0]) == (0, "0")
    check_error(run("doors", "add", "0.npy"), 2, "--poses")
    code, _, _ = run(
        "doors", "add", "0.npy", "--poses", "poses.csv", "--doors", "new.yaml", "--min-views", "2"
    )
    assert read_doors(Path("new.yaml")).doors == ()


def test_a_list_is_listed_and_checked(run: Run, folder: Path) -> None:
    _, out, _ = run("doors", "list", "doors.yaml", "--json")
    assert [json.loads(line)["id"] for line in out.splitlines()] == ["ahead", "beside", "behind"]
    assert run("doors", "list", "doors.yaml")[1].count("│") > 3
    code, out, _ = run("doors", "check", "doors.yaml", "--poses", "poses.csv")
    assert (code, out.splitlines()) == (0, ["3 doors in map", "6 poses in map"])
    code, out, _ = run("doors", "check", "doors.yaml", "--pose-error", "0.9 10")
    assert code == 0
    assert "ahead and beside" in out
    check_error(run("doors", "check", "doors.yaml", "--pose-error", "much"), 2, "--pose-error")
    Path("doors.yaml").write_text("doors:\n- id: a\n  width_m: 100\n")
    code, out, err = run("doors", "check", "doors.yaml")
    assert (code, out) == (1, "")
    assert [line.split(": ")[1] for line in err.splitlines()] == ["line 2", "line 3"]


def test_a_history_is_a_table_csv_json_and_a_picture(run: Run, folder: Path) -> None:
    day_s = 1_777_852_800.0  # 2026-05-04
    with DoorHistory(Path("doors.sqlite")) as history:
        history.record([DoorEvent("ahead", "not_seen", "open", day_s - 3600, 0.91, "a.npy")])
        history.record([DoorEvent("ahead", "open", "closed", day_s + 7200, 0.88, "=b.npy")])
    assert "2026-05-04 02:00:00" in run("doors", "history", "doors.sqlite", "--utc")[1]
    _, out, _ = run("doors", "history", "doors.sqlite", "--day", "2026-05-04", "--utc", "--json")
    assert [json.loads(line)["to"] for line in out.splitlines()] == ["closed"]
    code, out, _ = run(
        "doors",
        "history",
        "doors.sqlite",
        "--csv",
        "out.csv",
        "--plot",
        "day.svg",
        "--day",
        "2026-05-04",
        "--utc",
    )
    assert (code, out) == (0, "")
    with Path("out.csv").open(newline="") as stream:
        assert [row["frame"] for row in csv.DictReader(stream)] == ["./=b.npy"]
    assert Path("day.svg").read_text().count('fill="#CC79A7"') == 2, (
        "open since the day before, and the legend"
    )
    check_error(run("doors", "history", "doors.sqlite", "--day", "today"), 2)
    check_error(run("doors", "history", "doors.sqlite", "--plot", "day.png"), 2)

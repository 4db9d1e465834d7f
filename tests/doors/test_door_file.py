# SPDX-License-Identifier: Apache-2.0
"""Lists of doors: what is written is read, every problem has its line, and hand-made lines stay."""

from __future__ import annotations

import string
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.doors.door_file import add_doors, check_doors, overlap, read_doors, write_doors
from doorstate.doors.named_door import DoorList, DoorPlace, NamedDoor
from doorstate.doors.plane_pose import PlanePose
from doorstate.errors import DoorFileError
from tests.doors.examples import named

TEXT = """\
# The ground floor.
version: 1
frame: ground
doors:
- id: no       # not a truth value
  pose: {x_m: 1, y_m: 2e0, yaw_deg: -90}
  width_m: .9
  hinge: Left
- id: 0101
  frame: attic
  pose:
    x_m: 5.5
    y_m: 2
    yaw_deg: 0
  width_m: 1.8
  kind: double
  swing: null
"""

coordinate = st.floats(-1e4, 1e4).map(lambda number: round(number, 4))
door_ids = st.text(
    st.sampled_from(string.ascii_letters + string.digits + "_.- äß門"), min_size=1, max_size=20
)


@st.composite
def named_doors(draw: st.DrawFn) -> NamedDoor:
    fields: dict[str, Any] = {
        "id": draw(st.from_regex(r"\A\w[\w .-]{0,20}[\w.-]\Z")),
        "frame": draw(st.text(min_size=1, max_size=10).filter(lambda text: text.isprintable())),
        "pose": DoorPlace(x_m=draw(coordinate), y_m=draw(coordinate), yaw_deg=draw(st.floats(-360, 360))),
        "width_m": draw(st.floats(0.4, 6.0)),
        "hinge": draw(st.sampled_from([None, "left", "right"])),
        "swing": draw(st.sampled_from([None, "away", "towards"])),
        "kind": draw(st.sampled_from([None, "single", "sliding"])),
        "wall_m": draw(st.floats(0.02, 1.0)),
    }
    return NamedDoor(**fields)


def test_scalars_are_what_people_mean() -> None:
    doors, problems = check_doors(TEXT)
    assert problems == []
    assert doors is not None
    first, second = doors.doors
    assert (first.id, first.frame, first.hinge, first.width_m) == ("no", "ground", "left", 0.9)
    assert (second.id, second.frame, second.kind, second.swing) == ("0101", "attic", "double", None)
    assert second.place == PlanePose(5.5, 2.0, 0.0)


@settings(max_examples=25)
@given(st.lists(named_doors(), max_size=4, unique_by=lambda door: door.id.casefold()))
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, doors: list[NamedDoor]) -> None:
    path = tmp_path_factory.mktemp("doors") / "doors.yaml"
    apart = [
        door for number, door in enumerate(doors) if not any(overlap(door, other) for other in doors[:number])
    ]
    whole = DoorList(frame="here", doors=tuple(apart))
    write_doors(path, whole)
    assert read_doors(path) == whole
    path.unlink()
    for door in apart:
        add_doors(path, [door])
    assert not apart or read_doors(path).doors == whole.doors


@given(
    st.text(st.characters(codec="utf-8"), max_size=60)
    | st.text(st.sampled_from("doors:- {}[]id\n &*!?|>'\""), max_size=60)
)
def test_any_text_gives_doors_or_problems_with_a_line_of_it(text: str) -> None:
    doors, problems = check_doors(text)
    assert doors is not None or problems
    for problem in problems:
        assert (
            1
            <= problem.line
            <= text.count("\n")
            + text.count("\r")
            + text.count("\x85")
            + text.count("\u2028")
            + text.count("\u2029")
            + 2
        )
        assert problem.message


@pytest.mark.parametrize(
    ("change", "line", "field"),
    [
        (("width_m: .9", "width_m: 90"), 7, "doors[0].width_m"),
        (("width_m: .9", "width: .9"), 7, "doors[0].width"),
        (("x_m: 1,", "x_m: one,"), 6, "doors[0].pose.x_m"),
        (("x_m: 1,", "x_m: .inf,"), 6, "doors[0].pose.x_m"),
        (("    y_m: 2\n", ""), 11, "doors[1].pose.y_m"),
        (("hinge: Left", "hinge: top"), 8, "doors[0].hinge"),
        (("id: 0101", "id: a/b"), 9, "doors[1].id"),
        (("id: 0101", "id: NO"), 9, "doors[1].id"),
        (("version: 1", "version: 2"), 2, "version"),
        (("frame: attic", "id: again"), 10, ""),
        (("frame: ground", "frame: &a ground"), 0, ""),
        (("frame: attic", "frame: *a"), 1, ""),
        (("swing: null", "swing: [null"), 18, ""),
    ],
)
def test_a_problem_has_its_line_and_field(
    tmp_path: Path, change: tuple[str, str], line: int, field: str
) -> None:
    path = tmp_path / "doors.yaml"
    path.write_text(TEXT.replace(*change))
    _, problems = check_doors(path.read_text())
    if line == 0:
        assert problems == []
        return
    assert (line, field) in [(problem.line, problem.field) for problem in problems]
    with pytest.raises(DoorFileError) as caught:
        read_doors(path)
    assert (caught.value.path, caught.value.field) == (path, problems[0].field or None)
    assert caught.value.message.startswith(f"line {problems[0].line}: ")
    assert "\n" not in str(caught.value)


def test_doors_at_one_place_are_a_problem() -> None:
    text = (
        TEXT.replace("frame: attic", "frame: ground")
        .replace("x_m: 5.5", "x_m: 1")
        .replace("yaw_deg: 0", "yaw_deg: 93")
    )
    _, problems = check_doors(text)
    assert [(problem.line, problem.field) for problem in problems] == [(11, "doors[1].pose")]


def test_lines_of_hand_made_lists_stay(tmp_path: Path) -> None:
    path = tmp_path / "doors.yaml"
    path.write_text(TEXT)
    new = named("new", 9.0, 9.0, hinge="right", frame="ground")
    assert add_doors(path, [new]).doors[-1] == new
    assert path.read_text().startswith(TEXT)
    assert path.read_text()[len(TEXT) :] == (
        "- id: new\n  pose: {x_m: 9.0, y_m: 9.0, yaw_deg: 90.0}\n  width_m: 0.9\n  hinge: right\n"
    )
    assert add_doors(path, []).find("new") == new


def test_an_indented_list_and_an_empty_one_take_doors(tmp_path: Path) -> None:
    path = tmp_path / "doors.yaml"
    for text in (
        "doors:\n    - id: a\n      pose: {x_m: 0, y_m: 0, yaw_deg: 0}\n      width_m: 1\n",
        "doors: []\n",
        "frame: map\n",
    ):
        path.write_text(text)
        count = text.count("id:")
        assert [door.id for door in add_doors(path, [named("new", 9, 9)]).doors][count:] == ["new"]


@pytest.mark.parametrize(
    "text",
    [
        "doors: [{id: a, width_m: 1, pose: {x_m: 0, y_m: 0, yaw_deg: 0}}]\n",
        TEXT.replace("version: 1\n", "") + "version: 1\n",
    ],
)
def test_a_list_that_cannot_be_lengthened_is_left_alone(tmp_path: Path, text: str) -> None:
    path = tmp_path / "doors.yaml"
    path.write_text(text)
    with pytest.raises(DoorFileError) as caught:
        add_doors(path, [named("new", 9, 9)])
    assert (caught.value.path, caught.value.field) == (path, "doors")
    assert path.read_text() == text


def test_a_name_that_is_taken_is_not_added(tmp_path: Path) -> None:
    path = tmp_path / "doors.yaml"
    path.write_text(TEXT)
    with pytest.raises(DoorFileError) as caught:
        add_doors(path, [named("No", 9, 9)])
    assert caught.value.field == "doors[2].id"


def test_deep_nesting_and_missing_files_are_errors_of_the_file(tmp_path: Path) -> None:
    doors, problems = check_doors("doors: " + "[" * 1500)
    assert doors is None
    assert len(problems) == 1
    with pytest.raises(DoorFileError):
        read_doors(tmp_path / "none.yaml")

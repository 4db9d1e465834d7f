# SPDX-License-Identifier: Apache-2.0
"""Doors for Nav2 and Open-RMF: no old state is reported, and no open door that may be glass."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from doorstate_nav import memory as of_memory
from doorstate_nav import rmf
from doorstate_nav.edges import EdgeKeeper, read_edge_table
from doorstate_nav.memory import CLOSED, FRONT, OPEN, UNKNOWN, DoorMemory
from doorstate_nav.rmf import door_mode
from doorstate_nav.waiting import DoorWait

from doorstate.errors import ConfigError
from tests.ros2.doors import CONSTANTS, door, doors
from tests.ros2.package import ROS2

ACTION = (ROS2 / "doorstate_msgs" / "action" / "WaitForDoor.action").read_text(encoding="utf-8")
GOAL = dict(
    re.findall(r"^(?:\w+) (\w+) ?([\d.]+|true|false)?", ACTION.partition("---")[0], flags=re.MULTILINE)
)
BT = ROS2 / "doorstate_bt"


def goal(**changes: Any) -> Any:
    """A goal of the action with its defaults."""
    values = {name: yaml.safe_load(value) if value else "" for name, value in GOAL.items()}
    return SimpleNamespace(**values | {"door": "kitchen"} | changes)


def knowing(*listed: Any, now_s: float = 0.0) -> DoorMemory:
    memory = DoorMemory()
    memory.update(doors(*listed), now_s)
    return memory


def test_constants_are_those_of_the_messages() -> None:
    assert {name: getattr(of_memory, name) for name in CONSTANTS} == CONSTANTS
    assert (rmf.MODE_CLOSED, rmf.MODE_MOVING, rmf.MODE_OPEN, rmf.MODE_OFFLINE, rmf.MODE_UNKNOWN) == (
        0,
        1,
        2,
        3,
        4,
    )


def test_a_state_is_forgotten_in_time_and_with_a_clock_that_goes_back() -> None:
    memory = knowing(door())
    assert memory.at("kitchen", 1.9).state == OPEN
    assert memory.at("kitchen", 2.0).state == UNKNOWN
    assert memory.at("lab", 0.0).reason
    memory.update(doors(door("lab"), stamp_s=5.0), 1.0)
    assert memory.at("kitchen", 1.0).state == UNKNOWN, "before the clock went back"
    assert memory.at("lab", 1.0).state == OPEN


def test_cameras_whose_stamps_differ_a_little_forget_nothing() -> None:
    memory = knowing(door())
    memory.update(doors(door("lab"), stamp_s=99.99), 0.1)
    assert (memory.at("kitchen", 0.1).state, memory.at("lab", 0.1).state) == (OPEN, OPEN)


def test_a_single_message_does_not_hold() -> None:
    wait, memory = DoorWait(goal(timeout_s=5.0), 0.0), knowing(door())
    assert [wait.step(memory, tenth / 10).reached for tenth in range(50)] == [None] * 50
    assert wait.step(memory, 5.0).reached is False


def test_a_door_that_is_not_seen_is_unknown_and_the_front_door_needs_no_name() -> None:
    memory = knowing(door(seen=False, reason="not seen: out of view"), door("", "CLOSED"))
    assert memory.at("kitchen", 0.0) == of_memory.KnownDoor(reason="not seen: out of view", taken_s=0.0)
    assert memory.at(FRONT, 0.0).state == CLOSED
    memory.update(doors(reason="no message for 1 s"), 0.5)
    assert memory.at(FRONT, 0.5).reason == "no message for 1 s"


def test_a_wait_ends_when_the_state_has_held() -> None:
    memory, wait = DoorMemory(), DoorWait(goal(), 0.0)
    assert wait.step(memory, 0.1).reached is None
    for tenth in range(2, 11):
        memory.update(doors(door()), tenth / 10)
        assert wait.step(memory, tenth / 10).reached is None
    memory.update(doors(door(state="SEMI_OPEN")), 1.1)
    assert wait.step(memory, 1.1).held_s == 0.0
    memory.update(doors(door()), 1.2)
    assert wait.step(memory, 1.2).reached is None
    memory.update(doors(door()), 2.2)
    progress = wait.step(memory, 2.2)
    assert (progress.reached, progress.state, progress.held_s) == (True, OPEN, pytest.approx(1.0))


@pytest.mark.parametrize(
    ("shown", "changes", "word"),
    [
        (door(state="CLOSED"), {}, "closed"),
        (door(leaf_seen=False), {}, "glass"),
        (door(probability=0.6), {}, "0.60"),
        (door(passable_width_m=0.5), {"min_passable_width_m": 0.7}, "0.50"),
        (door(passable_width_m=math.nan), {"min_passable_width_m": 0.7}, "nan"),
        (door(filtered_state=0, reason="unsure"), {}, "unsure"),
        (door(seen=False, reason="out of view"), {}, "out of view"),
    ],
)
def test_a_wait_times_out_with_the_reason(shown: Any, changes: dict[str, Any], word: str) -> None:
    wait = DoorWait(goal(timeout_s=5.0, hold_s=0.0, **changes), 0.0)
    assert wait.step(knowing(shown), 0.0).reached is None
    progress = wait.step(knowing(shown, now_s=5.0), 5.0)
    assert progress.reached is False
    assert word in progress.reason
    assert (
        DoorWait(goal(timeout_s=0.0, hold_s=0.0, **changes), 0.0).step(knowing(shown, now_s=1e4), 1e4).reached
        is None
    )


def test_an_old_state_reaches_no_goal_and_a_rule_needs_no_probability() -> None:
    assert DoorWait(goal(hold_s=0.0), 0.0).step(knowing(door()), 3.0).reached is None
    assert DoorWait(goal(hold_s=0.0), 0.0).step(knowing(door(probability=math.nan)), 0.1).reached is True
    assert (
        DoorWait(goal(hold_s=0.0, require_leaf=False), 0.0).step(knowing(door(leaf_seen=False)), 0.1).reached
    )


@pytest.mark.parametrize("changes", [{"state": 0}, {"state": 4}, {"timeout_s": -1.0}, {"hold_s": math.nan}])
def test_impossible_goals_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(changes))):
        DoorWait(goal(**changes), 0.0)


def edge_table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "edges.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_edges_follow_doors_and_only_changes_are_told(tmp_path: Path) -> None:
    table = read_edge_table(ROS2 / "doorstate_nav" / "config" / "edges.yaml")
    keeper = EdgeKeeper(table)

    def told(*listed: Any) -> tuple[list[int], list[int]]:
        memory = knowing(*listed)
        return tuple(keeper.changes({entry.door: memory.at(entry.door, 0.0) for entry in table.doors}))

    assert told(door(state="CLOSED"), door("lab")) == ([12, 13], [20, 21])
    assert told(door(state="CLOSED"), door("lab")) == ([], [])
    assert told(door(leaf_seen=False), door("lab", filtered_state=0)) == ([], []), "nothing is known: kept"
    assert told(door(state="SEMI_OPEN", passable_width_m=0.75)) == ([], [12, 13])
    assert told(door(state="SEMI_OPEN", passable_width_m=0.5)) == ([12, 13], [])
    assert told(door(passable_width_m=0.6), door("lab", passable_width_m=math.nan)) == ([], [])
    keeper.forget()
    assert told(door(state="SEMI_OPEN", passable_width_m=math.nan), door("lab")) == ([12, 13], [20, 21])


@pytest.mark.parametrize(
    ("unknown", "expected"), [("close", ([7], [])), ("open", ([], [7])), ("keep", ([], []))]
)
def test_a_door_without_a_state_follows_the_rule_of_the_table(
    unknown: str, expected: tuple[list[int], list[int]], tmp_path: Path
) -> None:
    text = f"unknown: {unknown}\ndoors: [{{door: lab, edges: [7]}}]\n"
    keeper = EdgeKeeper(read_edge_table(edge_table(tmp_path, text)))
    assert tuple(keeper.changes({"lab": of_memory.NEVER_SEEN})) == expected


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("doors: []\n", "doors"),
        ("doors: [{door: lab, edges: [70000]}]\n", "70000"),
        ("doors: [{door: lab, edges: [1]}, {door: hall, edges: [1]}]\n", "edge 1"),
        ("doors: [{door: lab, edge: [1]}]\n", "edge"),
        ("doors: [", "line"),
        ("unknown: guess\ndoors: [{door: lab, edges: [1]}]\n", "unknown"),
    ],
)
def test_wrong_tables_are_one_line(text: str, word: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        read_edge_table(edge_table(tmp_path, text))
    assert word in str(caught.value)
    assert "edges.yaml" in str(caught.value)
    with pytest.raises(ConfigError):
        read_edge_table(tmp_path / "absent.yaml")


def test_modes_of_open_rmf() -> None:
    modes = {state: door_mode(knowing(door(state=state)), "kitchen", 0.1) for state in CONSTANTS}
    assert modes == {
        "UNKNOWN": rmf.MODE_UNKNOWN,
        "CLOSED": rmf.MODE_CLOSED,
        "SEMI_OPEN": rmf.MODE_MOVING,
        "OPEN": rmf.MODE_OPEN,
    }
    assert door_mode(knowing(door(state="SEMI_OPEN")), "kitchen", 0.1, semi_open="closed") == rmf.MODE_CLOSED
    assert door_mode(knowing(door(leaf_seen=False)), "kitchen", 0.1) == rmf.MODE_UNKNOWN
    assert door_mode(knowing(door()), "lab", 0.1) == rmf.MODE_UNKNOWN
    assert door_mode(knowing(door()), "kitchen", 3.0) == rmf.MODE_UNKNOWN
    assert door_mode(knowing(door()), "kitchen", 5.0) == rmf.MODE_OFFLINE
    assert door_mode(DoorMemory(), "kitchen", 0.0) == rmf.MODE_OFFLINE


def test_ports_of_the_behaviour_tree_are_those_of_its_nodes_and_of_the_action() -> None:
    sources = {path.stem: path.read_text(encoding="utf-8") for path in (BT / "src").glob("*.cpp")}
    ports = {
        name: set(re.findall(r"(?:Input|Output)Port<[\w:]+>\(\"(\w+)\"", sources[stem]))
        for name, stem in (("IsDoorOpen", "is_door_open"), ("WaitForDoor", "wait_for_door"))
    }
    assert ports["WaitForDoor"] == set(GOAL) | {"reason"}
    assert set(re.findall(r"goal_\.(\w+)", sources["wait_for_door"])) == set(GOAL)
    for name, stem in (("IsDoorOpen", "is_door_open"), ("WaitForDoor", "wait_for_door")):
        assert f'"{name}"' in sources[stem]
        used = [
            node.attrib
            for tree in (BT / "trees").glob("*.xml")
            for node in ElementTree.parse(tree).iter(name)
        ]
        assert used
        assert set().union(*used) <= ports[name]
    fields = set(re.findall(r"door->(\w+)", sources["is_door_open"]))
    assert fields <= set(door().__dict__)

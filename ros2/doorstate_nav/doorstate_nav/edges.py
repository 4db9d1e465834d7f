# SPDX-License-Identifier: Apache-2.0
"""Edges of a route graph that lead through doors, and when they are closed (nav2_msgs/DynamicEdges). Needs no ROS.

Source: https://docs.nav2.org/configuration/packages/configuring-route-server.html
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from pydantic import Field, ValidationError

from doorstate._input import MAX_SETTINGS_BYTES, read_input_text
from doorstate._models import FrozenModel
from doorstate.errors import ConfigError
from doorstate.io.located_yaml import LocatedYamlError, parse_located_yaml
from doorstate_nav.memory import OPEN, SEMI_OPEN, UNKNOWN, KnownDoor

EdgeId: TypeAlias = int
_MAX_EDGE = 2**16 - 1  # of DynamicEdges
UnknownPolicy = Literal["keep", "close", "open"]


class DoorEdges(FrozenModel):
    """Edges through one door, both directions."""

    door: str = Field(min_length=1, description="Id of the door in the list of doors.")
    edges: tuple[int, ...] = Field(min_length=1, description="Ids of the edges through it.")


class EdgeTable(FrozenModel):
    """Doors and edges, and the rules for them.

    Attributes:
        doors: edges of each door.
        robot_width_m: with its margin; an edge is open where the passable width is at least this.
        unknown: what becomes of the edges of a door without a state.
        require_leaf: an open door without a visible leaf, which may be glass, counts as unknown.
    """

    doors: tuple[DoorEdges, ...] = Field(min_length=1)
    robot_width_m: float = Field(0.7, gt=0, lt=10)
    unknown: UnknownPolicy = "keep"
    require_leaf: bool = True


class EdgeChanges(NamedTuple):
    """Request of DynamicEdges."""

    closed: list[EdgeId]
    opened: list[EdgeId]


def read_edge_table(path: Path) -> EdgeTable:
    """Read a table of edges.

    Raises:
        ConfigError: the file cannot be read, or has another content.
    """
    text = read_input_text(path, MAX_SETTINGS_BYTES, ConfigError)
    try:
        table = EdgeTable.model_validate(parse_located_yaml(text).value)
    except LocatedYamlError as error:
        raise ConfigError(f"line {error.line}: {error.message}", path=path) from error
    except ValidationError as error:
        problem = error.errors()[0]
        name = ".".join(str(part) for part in problem["loc"])
        raise ConfigError(problem["msg"].lower(), path=path, field=name or None) from error
    edges = Counter(edge for door in table.doors for edge in door.edges)
    for edge, count in edges.items():
        if not 0 <= edge <= _MAX_EDGE:
            raise ConfigError(f"edge {edge} is no number of 16 bits", path=path, field="edges")
        if count > 1:
            raise ConfigError(f"edge {edge} is listed {count} times", path=path, field="edges")
    return table


class EdgeKeeper:
    """Keeps the edges of a route graph as the doors are; gives changes alone.

    Args:
        table: doors and edges.
    """

    def __init__(self, table: EdgeTable) -> None:
        self._table = table
        self._is_open: dict[EdgeId, bool] = {}  # as the route server was told

    def changes(self, doors: Mapping[str, KnownDoor]) -> EdgeChanges:
        """Return the edges to close and to open; call `forget` if the server does not take them.

        Args:
            doors: doors of the table as they are now.
        """
        closed: list[EdgeId] = []
        opened: list[EdgeId] = []
        for entry in self._table.doors:
            is_open = self._wanted(doors[entry.door])
            for edge in entry.edges:
                if is_open is None or self._is_open.get(edge) == is_open:
                    continue
                (opened if is_open else closed).append(edge)
                self._is_open[edge] = is_open
        return EdgeChanges(closed, opened)

    def forget(self) -> None:
        """Assume that the route server knows nothing, as after it was started."""
        self._is_open.clear()

    def _wanted(self, door: KnownDoor) -> bool | None:
        """Return True for open, False for closed, None to keep what is."""
        table = self._table
        is_glass = door.state == OPEN and table.require_leaf and not door.leaf_seen
        if door.state == UNKNOWN or is_glass:
            return {"keep": None, "close": False, "open": True}[table.unknown]
        # Without a width (NaN) a semi-open door is no way, and an open one is.
        if door.state == SEMI_OPEN:
            return door.passable_width_m >= table.robot_width_m
        return door.state == OPEN and not door.passable_width_m < table.robot_width_m

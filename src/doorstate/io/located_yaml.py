# SPDX-License-Identifier: Apache-2.0
"""YAML that people write, with the line of every value; scalars stay text, so that `no` and `0101` are not changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import yaml

from doorstate.io.plain_yaml import plain_node

Key = tuple[str | int, ...]
"""Keys and positions that lead to a value."""

_NULLS = ("", "~", "null", "Null", "NULL")  # unquoted


class LocatedYaml(NamedTuple):
    """Values of a document: mappings, lists, texts and None."""

    value: Any
    lines: Mapping[Key, int]  # by the way to a value; the first line is 1

    def line_of(self, key: Key) -> int:
        """Return the line of a value, or of the innermost thing that holds it."""
        while key not in self.lines and key:
            key = key[:-1]
        return self.lines.get(key, 1)


class LocatedYamlError(yaml.YAMLError):
    """A text is no YAML, or none that this reader takes.

    Args:
        message: what is wrong.
        line: where; the first line is 1.
    """

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.message, self.line = message, line


def parse_located_yaml(text: str) -> LocatedYaml:
    """Parse one document.

    Raises:
        LocatedYamlError: no YAML, several documents, an alias, nesting without end, or a key that is given twice.
    """
    try:
        node = plain_node(text)
        lines: dict[Key, int] = {}
        return LocatedYaml(None if node is None else _value(node, (), lines), lines)
    except LocatedYamlError:
        raise
    except RecursionError as error:
        raise LocatedYamlError("is nested too deeply", 1) from error
    except (yaml.YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or error
        raise LocatedYamlError(f"no YAML: {problem}", 1 if mark is None else mark.line + 1) from error


def _value(node: yaml.Node, key: Key, lines: dict[Key, int]) -> Any:
    lines[key] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        return dict(_items(node, key, lines))
    if isinstance(node, yaml.SequenceNode):
        return [_value(item, (*key, number), lines) for number, item in enumerate(node.value)]
    is_null = isinstance(node, yaml.ScalarNode) and node.style is None and node.value in _NULLS
    return None if is_null else node.value


def _items(node: yaml.MappingNode, key: Key, lines: dict[Key, int]) -> Iterator[tuple[str, Any]]:
    names = set()
    for name, value in node.value:
        line = name.start_mark.line + 1
        if not isinstance(name, yaml.ScalarNode):
            raise LocatedYamlError("a key is no text", line)
        if name.value in names:
            raise LocatedYamlError(f"the key {name.value!r} is given twice", line)
        names.add(name.value)
        inner = (*key, name.value)
        yield name.value, _value(value, inner, lines)
        lines[inner] = line  # people look for the key

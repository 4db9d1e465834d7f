# SPDX-License-Identifier: Apache-2.0
"""YAML as recorders and calibrations write it: a few lines with aliases may stand for gigabytes, and are refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml


class _PlainLoader(yaml.SafeLoader):
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("refers to itself with an alias (*)")
        return super().compose_node(parent, index)


def plain_documents(text: str) -> Iterator[Any]:
    """Documents of a YAML stream, each read when it is asked for.

    Raises:
        yaml.YAMLError: no YAML, or one with aliases.
    """
    found: Iterator[Any] = yaml.load_all(text, Loader=_PlainLoader)
    return found

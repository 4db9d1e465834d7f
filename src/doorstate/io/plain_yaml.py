# SPDX-License-Identifier: Apache-2.0
"""YAML without aliases: a few lines with aliases can expand to gigabytes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml


class _PlainLoader(yaml.SafeLoader):
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("refers to itself with an alias (*)")
        return super().compose_node(parent, index)


def _opencv(loader: _PlainLoader, suffix: str, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


# OpenCV's FileStorage tags its matrices `!!opencv-matrix`.
_PlainLoader.add_multi_constructor("tag:yaml.org,2002:opencv-", _opencv)


def plain_documents(text: str) -> Iterator[Any]:
    """Iterate over the documents of a YAML stream.

    Raises:
        yaml.YAMLError: no YAML, or an alias.
    """
    documents: Iterator[Any] = yaml.load_all(text, Loader=_PlainLoader)
    return documents


def plain_node(text: str) -> yaml.Node | None:
    """Return the tree of the one document of a YAML text, with its lines; None of an empty text.

    Raises:
        yaml.YAMLError: no YAML, several documents, or an alias.
    """
    node: yaml.Node | None = yaml.compose(text, Loader=_PlainLoader)
    return node

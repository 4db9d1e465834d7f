# SPDX-License-Identifier: Apache-2.0
"""Parts of a job for machines that share nothing, or nothing but a folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple, Self, TypeVar

from doorstate.errors import ConfigError

Piece = TypeVar("Piece")


class Shard(NamedTuple):
    """One of `shards` equal parts of a job; `number` counts from 1."""

    number: int
    shards: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse text such as `2/8`.

        Raises:
            ConfigError: the text has another form, or there is no such shard.
        """
        match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
        shard = cls(*(int(digits) for digits in match.groups())) if match else cls(0, 0)
        if not 1 <= shard.number <= shard.shards:
            raise ConfigError(f"{text!r} is not a shard", field="shard", expected="number/count, such as 2/8")
        return shard

    @property
    def name(self) -> str:
        """Name for files, such as `2-of-8`."""
        return f"{self.number}-of-{self.shards}"

    def select(self, pieces: Sequence[Piece]) -> Sequence[Piece]:
        """Return every `shards`-th piece, so that all shards take about as long."""
        return pieces[self.number - 1 :: self.shards]

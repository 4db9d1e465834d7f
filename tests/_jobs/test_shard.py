# SPDX-License-Identifier: Apache-2.0
"""Shards: parts of a job for machines that share nothing but a folder."""

from __future__ import annotations

import pytest

from doorstate._jobs import Shard
from doorstate.errors import ConfigError


def test_shards_cover_all_pieces() -> None:
    pieces = list(range(11))
    for count in (1, 3, 8, 11, 20):
        shares = [Shard.parse(f"{number}/{count}").select(pieces) for number in range(1, count + 1)]
        assert sorted(piece for share in shares for piece in share) == pieces
        assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize("text", ["", "2", "0/3", "4/3", "1/0", "-1/2", "1/2/3", "a/b", "1/2 ", "1.0/2"])
def test_other_texts_are_no_shards(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Shard.parse(text)
    assert caught.value.field == "shard"

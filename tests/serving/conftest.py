# SPDX-License-Identifier: Apache-2.0
"""Client of a service that several tests share."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

pytest.importorskip("fastapi")

from tests.serving.helpers import serving


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    with serving(max_bytes=100_000) as shared:
        yield shared

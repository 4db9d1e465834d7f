# SPDX-License-Identifier: Apache-2.0
"""The base of settings and rows: values that are checked once, do not change, and hold nothing unknown."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class FrozenModel(BaseModel):
    """A model whose fields cannot be set, and that takes no other ones."""

    model_config = ConfigDict(frozen=True, extra="forbid")

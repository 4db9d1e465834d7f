# SPDX-License-Identifier: Apache-2.0
"""Base class of settings and rows."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class FrozenModel(BaseModel):
    """Pydantic model without assignment and without unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")

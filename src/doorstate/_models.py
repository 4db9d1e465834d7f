# SPDX-License-Identifier: Apache-2.0
"""Base class of settings and rows, and types of fields that many of them have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

MAX_NAME_LENGTH = 100
_FORBIDDEN = "/\\"


class FrozenModel(BaseModel):
    """Pydantic model without assignment, unknown fields, infinities and NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def without_defaults(fields: dict[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return dumped fields without those, of the named ones, that have their default."""
    return {name: value for name, value in fields.items() if name not in defaults or value != defaults[name]}


def _check_order(values: tuple[float, float]) -> tuple[float, float]:
    if values[0] > values[1]:
        raise ValueError("the first of the two is the smaller one")
    return values


Ordered = AfterValidator(_check_order)
"""Validator of a range: its first value is not the larger one."""


def _check_name(name: str) -> str:
    is_plain = name.isprintable() and not any(character in name for character in _FORBIDDEN)
    if not is_plain or not 0 < len(name) <= MAX_NAME_LENGTH or name.startswith(".") or name != name.strip():
        raise ValueError(
            f"is no name of a folder: expected 1 to {MAX_NAME_LENGTH} printable characters without / and \\, "
            "not starting with a dot, not starting or ending with a blank"
        )
    return name


Name = Annotated[str, AfterValidator(_check_name)]
"""Name that becomes part of a path, and stays inside its folder."""

Seed = Annotated[int, Field(ge=0, lt=2**63)]
"""Seed of random numbers."""

Metres = Annotated[float, Field(ge=-1e4, le=1e4)]
"""Length or coordinate in a scene."""

Degrees = Annotated[float, Field(ge=-3600, le=3600)]
"""Angle in a scene."""
